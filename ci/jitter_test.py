#!/usr/bin/env python3
"""Tests of ci/jitter.py with a program that only writes what piecework would."""
import json
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import jitter

SCRIPT = Path(__file__).resolve().parent / "jitter.py"
SCENE = {"name": "pile", "cloths": [
    {"translate": [1, 2, 3], "mesh": {"generator": "sheet", "columns": 50, "rows": 6}},
    {"translate": [0, 0, 0], "mesh": {"generator": "tube", "columns": 40, "rows": 60}},
    {"translate": [0, 0, 0], "mesh": {"file": "skirt.obj", "columns": 50, "rows": 50}}]}

# Takes the place of piecework: "pile" is sound, in the third run of "leak" something passes through,
# "crash" ends with an error, "lost" cannot be read.
PROGRAM = f"""#!{sys.executable}
import json, os, signal, sys
from pathlib import Path
name, directory = sys.argv[2], Path(sys.argv[4])
if name == "lost":
    sys.exit("piecework: {jitter.ROOT}/scenes/lost.json: file not found")
number = 0 if "--frames" in sys.argv else int(directory.name)
passed = 2 if name == "leak" and number == 3 else 0
counters = {{"interpenetrations": passed, "contact_pairs": 10 * number, "converged_steps": 1,
            "iterations": 8}}
frames = [dict(steps=1, step_ms=4.0, counters=counters), dict(steps=2, step_ms=1.0,
          counters=dict(counters, interpenetrations=0))]
record = dict(environment=dict(cpu="Abacus", revision="cafe"), frames=frames, scene=dict(
    vertices=9, resolved={SCENE!r}, settings=sys.argv[5:]))
directory.mkdir(parents=True, exist_ok=True)
(directory / "run.json").write_text(json.dumps(record))
if name == "killed" and number:
    os.kill(os.getpid(), signal.SIGKILL)
if name == "crash" and number == 1:
    sys.exit("piecework: step 3: not finite")
sys.exit(1 if passed and "--strict" in sys.argv else 0)
"""


class Settings(unittest.TestCase):
    def test_a_number_always_means_the_same_run_and_numbers_differ(self):
        first = jitter.jitter_settings(SCENE, 1)
        self.assertEqual(first, jitter.jitter_settings(SCENE, 1))
        self.assertFalse(set(first[:1]) & set(jitter.jitter_settings(SCENE, 2)))
        self.assertNotEqual(first[0], jitter.jitter_settings({**SCENE, "name": "knot"}, 1)[0])

    def test_cloths_are_shifted_together_and_a_little(self):
        settings = dict(s.split("=") for s in jitter.jitter_settings(SCENE, 1))
        places = [json.loads(settings[f"cloths.{i}.translate"]) for i in range(3)]
        shifts = [[b - a for a, b in zip(c["translate"], p)] for c, p in zip(SCENE["cloths"], places)]
        for shift in shifts:
            for a, b in zip(shift, shifts[1]):
                self.assertAlmostEqual(a, b, 9)
        self.assertEqual(shifts[1][1], 0)
        self.assertTrue(0 < max(abs(s) for s in shifts[1]) <= jitter.FARTHEST)

    def test_only_grids_are_triangulated_anew(self):
        text = "\n".join(jitter.jitter_settings(SCENE, 4))
        self.assertEqual(text.count("delaunay"), 1)
        self.assertIn("cloths.0.mesh.seed=4000", text)

    def test_coarse_meshes_are_half_as_fine_but_never_too_coarse(self):
        self.assertEqual(jitter.coarse_settings(SCENE), [
            "cloths.0.mesh.columns=25", "cloths.0.mesh.rows=4",
            "cloths.1.mesh.columns=20", "cloths.1.mesh.rows=30"])

    def test_scenes_without_contact_are_left_out(self):
        names = jitter.contact_scenes(jitter.ROOT / "scenes")
        self.assertIn("stack_of_20", names)
        self.assertNotIn("hanging_tablecloth", names)


class Runs(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.program = self.folder / "piecework"
        self.program.write_text(PROGRAM)
        self.program.chmod(0o755)

    def run_script(self, *arguments):
        done = subprocess.run(
            [sys.executable, SCRIPT, "--program", self.program, "--work", self.folder / "work",
             "--out", self.folder / "jitter.md", *arguments], capture_output=True, text=True)
        return done.returncode, (self.folder / "jitter.md").read_text()

    def test_sound_runs(self):
        status, text = self.run_script("--runs", "4", "--coarse", "pile")
        self.assertEqual(status, 0, text)
        self.assertIn("0 interpenetrations in 4 runs of 1 scene, 12 steps: reached.", text)
        cells = [c.strip() for c in text.splitlines()[-1].split("|")[1:-1]]
        # Two of three steps converged, 16 iterations and 6 ms in three steps.
        self.assertEqual(cells, ["pile", "9", "4", "12", "0", "0", "40", "66.7", "5.33", "2"])

    def test_what_passes_through_is_counted_and_the_exit_code_says_so(self):
        status, text = self.run_script("--runs", "3", "pile", "leak")
        self.assertEqual(status, 1)
        self.assertIn("2 interpenetrations in 6 runs of 2 scenes, 18 steps: **not reached**", text)

    def test_runs_that_fail_and_scenes_without_files_are_named(self):
        status, text = self.run_script("--runs", "2", "crash", "lost")
        self.assertEqual(status, 1)
        self.assertIn("1 run did not end: **not reached**", text)
        self.assertIn("- crash, run 1: piecework: step 3: not finite", text)
        self.assertIn("- lost was left out: piecework: scenes/lost.json: file not found", text)

    def test_runs_that_ended_are_kept_until_something_changes(self):
        self.run_script("--runs", "2", "leak", "crash")
        record = self.folder / "work/leak/02/run.json"
        def fresh(*arguments):
            record.write_text(record.read_text().replace("Abacus", "kept"))
            status, text = self.run_script(*arguments, "leak", "crash")
            self.assertIn("crash, run 1: piecework: step 3: not finite", text)
            self.assertEqual(status, 1)
            return "kept" not in record.read_text()
        self.assertFalse(fresh("--runs", "3"))
        self.assertTrue(fresh("--runs", "3", "--coarse"))
        self.program.write_text(PROGRAM + "# another version")
        self.assertTrue(fresh("--runs", "3", "--coarse"))

    def test_a_run_that_was_killed_has_not_ended(self):
        self.run_script("--runs", "1", "killed", "pile")
        ended = [p.parent.parent.name for p in (self.folder / "work").glob("*/*/jitter.json")]
        self.assertEqual(ended, ["pile"])

    def test_settings_of_a_scene_reach_that_scene_only(self):
        self.run_script("--runs", "1", "--set", "pile:cloths.2.mesh.file=other.obj", "pile", "leak")
        def given(name):
            record = json.loads((self.folder / "work" / name / "01" / "run.json").read_text())
            return record["scene"]["settings"]
        self.assertIn("cloths.2.mesh.file=other.obj", given("pile"))
        self.assertNotIn("cloths.2.mesh.file=other.obj", given("leak"))


if __name__ == "__main__":
    unittest.main()
