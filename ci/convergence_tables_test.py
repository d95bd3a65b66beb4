#!/usr/bin/env python3
"""Tests of ci/convergence_tables on a small raw JSON written by hand: every number can be checked
so."""
import copy
import csv
import io
import json
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree
from pathlib import Path

HERE = Path(__file__).resolve().parent
SCRIPT = HERE / "convergence_tables"
SVG = "{http://www.w3.org/2000/svg}"

CONTEXT = {"date": "2026-01-02T03:04:05+00:00", "executable": "/somewhere/bench_convergence",
           "num_cpus": 2, "cpu_model": "Abacus", "build_type": "Release", "revision": "cafe",
           "dirty": "false"}
LEVELS = ("1e-1", "1e-2", "1e-3", "1e-4", "1e-6")


def raw_row(method, cloth, n, family="convergence", **more):
    return {"name": f"{family}/{method}/{cloth}/n:{n}/threads:2/iterations:3/manual_time",
            "run_type": "iteration", "threads": 1, "iterations": 3, "real_time": 9.5,
            "time_unit": "ms", **more}


def valid(method, cloth, n, iterations, ms, position_ms, **more):
    """A row; vanilla projective dynamics takes 100 ms to 1e-3 and 400 ms to 1e-4. -1: not reached.
    """
    counters = {f"iterations_{level}": float(i) for level, i in zip(LEVELS, iterations)}
    counters.update({f"time_ms_{level}": float(t) for level, t in zip(LEVELS, ms)})
    for level, base, time in (("1e-3", 100.0, ms[2]), ("1e-4", 400.0, ms[3])):
        counters[f"ratio_{level}"] = base / time if time > 0 else -1.0
    counters.update({"position_time_ms_1e-2": position_ms, "error": 4e-7, "position_error": 2e-4,
                     "gradient": 0.003, "paper_iterations": -1.0, "paper_error": -1.0,
                     "paper_position": -1.0, "spread": 1.02, "base_spread": 1.05})
    return raw_row(method, cloth, n, **{**counters, **more})


# Deliberately not in the order of the table.
RAW = {"context": CONTEXT, "benchmarks": [
    valid("newton", "cotton", 100, (1, 1, 1, 2, 3), (30, 30, 30, 60, 90), 30.0),
    valid("default", "cotton", 100, (0, 2, 4, 5, 9), (1, 8, 10, 16, 32), 8.0, paper_iterations=4.0,
          paper_error=5e-4, paper_position=0.004),
    valid("vanilla_pd", "cotton", 100, (3, 20, 50, 200, -1), (10, 40, 100, 400, -1), 50.0,
          paper_iterations=6.0, paper_error=0.05, paper_position=0.04, spread=1.3),
    raw_row("lbfgs", "cotton", 100, error_occurred=True,
            error_message="the reference is no minimum"),
    valid("anderson", "cotton", 100, (1, 3, 9, 20, 70), (0.5, 4, 12, 24, 80), 6.0),
    valid("default", "soft", 100, (0, 1, 2, 3, 4), (1, 2, 3, 4, 5), 2.0),
    valid("default", "cotton", 900, (0, 2, 4, 5, 9), (10, 80, 100, 160, 320), 80.0),
]}

# 5 iterations of the default, halving the step's time; the paper's rule holds from the fourth on.
TRACES = {"schema": "piecework.traces/1",
          "columns": ["iteration", "ms", "energy_error", "position_error", "gradient", "dx_2"],
          "traces": [{"family": "convergence", "method": "default", "cloth": "cotton", "n": 100,
                      "threads": 2, "h": 0.00833,
                      "points": [[0, 0.5, 1, 1, 1, 0], [1, 1, 1e-1, 1e-1, None, 1],
                                 [2, 8, 1e-2, 1e-2, 1e-2, 1e-1], [4, 10, 1e-3, 1e-3, 1e-3, 1e-3],
                                 [5, 100, 1e-5, 1e-4, 1e-5, 1e-5]]},
                     {"family": "fig21", "method": "newton", "cloth": "cotton", "n": 100,
                      "threads": 2, "h": 0.01667,
                      "points": [[0, 1, 1, 1, 10, 0], [1, 50, 1e-3, 1e-2, 0.1, 1]]}]}

TABLE = """\
| method                           | its to 1e-2 | its to 1e-3 | its to 1e-4 | its to 1e-6 | ms to 1e-2 | ms to 1e-3 | ms to 1e-4 | ms to 1e-6 | vanilla / this, 1e-3 | vanilla / this, 1e-4 | ms to position 1e-2 | energy error at the end | position error at the end | gradient at the end |
| :------------------------------- | ----------: | ----------: | ----------: | ----------: | ---------: | ---------: | ---------: | ---------: | -------------------: | -------------------: | ------------------: | ----------------------: | ------------------------: | ------------------: |
| vanilla_pd †                     |          20 |          50 |         200 |           - |         40 |        100 |        400 |          - |                    1 |                    1 |                  50 |                4.00e-07 |                  2.00e-04 |             0.00300 |
| anderson                         |           3 |           9 |          20 |          70 |      **4** |         12 |         24 |         80 |                 8.33 |                 16.7 |               **6** |                4.00e-07 |                  2.00e-04 |             0.00300 |
| lbfgs                            |        FAIL |           - |           - |           - |          - |          - |          - |          - |                    - |                    - |                   - |                       - |                         - |                   - |
| default                          |           2 |           4 |           5 |           9 |          8 |     **10** |     **16** |     **32** |               **10** |               **25** |                   8 |                4.00e-07 |                  2.00e-04 |             0.00300 |
| newton                           |       **1** |       **1** |       **2** |       **3** |         30 |         30 |         60 |         90 |                 3.33 |                 6.67 |                  30 |                4.00e-07 |                  2.00e-04 |             0.00300 |
| ◆ vanilla_pd at the paper's stop |           - |           - |           - |           - |          - |          - |          - |          - |                    - |                    - |                   - |                  0.0500 |                    0.0400 |                   - |
"""

WORDS = """\

◆ The paper's ||dx|| <= 1e-3 (2-norm) would stop

- vanilla_pd after 6 iterations with energy error 0.0500 and position error 0.0400
- default after 4 iterations with energy error 5.00e-04 and position error 0.00400

Where another method beats default:

- its to 1e-2: newton (1); default 2.
- its to 1e-3: newton (1); default 4.
- its to 1e-4: newton (2); default 5.
- its to 1e-6: newton (3); default 9.
- ms to 1e-2: anderson (4); default 8.
- ms to position 1e-2: anderson (6); default 8.

- FAIL lbfgs: the reference is no minimum
"""


def make(raw, traces=None):
    """name -> text of every file that the script writes."""
    with tempfile.TemporaryDirectory() as folder:
        source, beside = Path(folder, "raw.json"), Path(folder, "traces.json")
        source.write_text(json.dumps(raw), encoding="utf-8")
        out = Path(folder, "tables")
        command = [sys.executable, SCRIPT, source, "--out", out]
        if traces:
            beside.write_text(json.dumps(traces), encoding="utf-8")
            command += ["--traces", beside]
        subprocess.run(command, check=True)
        return {path.name: path.read_bytes().decode() for path in out.iterdir()}


def section(text, heading):
    """Lines of a section of a Markdown file."""
    lines = text.split("\n")
    rest = lines[lines.index(heading) + 2:]
    end = next((i for i, words in enumerate(rest) if words.startswith("## ")), len(rest))
    return "\n".join(rest[:end]).rstrip("\n") + "\n"


def changed(method, **counters):
    """RAW with other counters in the cotton row of n = 100 of a method."""
    raw = copy.deepcopy(RAW)
    row = next(r for r in raw["benchmarks"]
               if r["name"].startswith(f"convergence/{method}/cotton/n:100/"))
    row.update(counters)
    return raw


class ConvergenceTables(unittest.TestCase):
    maxDiff = None

    @classmethod
    def setUpClass(cls):
        cls.files = make(RAW, TRACES)

    def test_table_and_words(self):
        self.assertEqual(section(self.files["convergence.md"], "## cotton, n = 100"), TABLE + WORDS)

    def test_a_seeded_loss_is_said(self):
        """Words follow the data: a default that is slower, or fails to arrive, is told so."""
        slower = make(changed("default", **{"time_ms_1e-3": 50.0}))["convergence.md"]
        self.assertIn("- ms to 1e-3: anderson (12), newton (30); default 50.", slower)
        lost = make(changed("default", **{"time_ms_1e-6": -1.0}))["convergence.md"]
        self.assertIn("- ms to 1e-6: anderson (80), newton (90); default not reached.", lost)

    def test_nothing_beats_the_default(self):
        words = section(self.files["convergence.md"], "## soft, n = 100")
        self.assertIn("No other method beats default in any column.", words)
        self.assertIn("◆ No method meets the paper's", words)

    def test_a_default_without_result_is_said(self):
        failed = make(changed("default", error_occurred=True, error_message="singular"))
        self.assertIn("**There is no valid row of default to compare.**", failed["convergence.md"])

    def test_at_a_glance(self):
        self.assertEqual(section(self.files["convergence.md"], "## At a glance").split("\n")[2:5], [
            "| soft   | 100 |           3 |          4 |                    33.3 |"
            "                     100 |                     - |                  - |",
            "| cotton | 100 |           5 |         16 |                      10 |"
            "                      25 |              anderson |               1.50 |",
            "| cotton | 900 |           5 |        160 |                       1 |"
            "                    2.50 |                     - |                  - |"])

    def test_disturbed_rows_are_counted(self):
        self.assertIn("**1 of 6 rows are disturbed (†)", self.files["convergence.md"])
        quiet = make(changed("vanilla_pd", spread=1.0))["convergence.md"]
        self.assertNotIn("rows are disturbed", quiet)

    def test_disturbed_fronts_say_so(self):
        self.assertIn("1 of 4 methods disturbed", self.files["front_cotton_100.svg"])
        self.assertNotIn("disturbed", self.files["front_soft_100.svg"])

    def test_csv(self):
        text = self.files["convergence.csv"]
        self.assertEqual(text.count("\r\n"), text.count("\n"))
        rows = list(csv.DictReader(io.StringIO(text, newline="")))
        self.assertEqual(len(rows), len(RAW["benchmarks"]))
        self.assertEqual({r["revision"] for r in rows}, {"cafe"})
        vanilla = next(r for r in rows if r["method"] == "vanilla_pd")
        self.assertEqual((vanilla["cloth"], vanilla["time_ms_1e-4"], vanilla["time_ms_1e-6"]),
                         ("cotton", "400.0", ""))

    def test_json(self):
        document = json.loads(self.files["convergence.json"])
        self.assertEqual((document["schema"], document["name"]),
                         ("piecework.results/1", "convergence"))
        failed = next(r for r in document["rows"] if r["method"] == "lbfgs")
        self.assertEqual((failed["status"], failed["message"]),
                         ("failed", "the reference is no minimum"))
        self.assertNotIn("/somewhere", self.files["convergence.json"])

    def test_order_of_the_raw_file_does_not_matter(self):
        self.assertEqual(make({**RAW, "benchmarks": RAW["benchmarks"][::-1]}, TRACES), self.files)

    def test_names_of_figures(self):
        self.assertEqual(sorted(n for n in self.files if n.endswith(".svg")),
                         ["front_cotton_100.svg", "front_cotton_900.svg", "front_soft_100.svg",
                          "iterations_vs_n.svg"])

    def test_front(self):
        """From 1e-1 to 1e-3 the default's line falls as far as from 1e-3 to 1e-5, and goes as far
        from 1 to 10 ms as from 10 to 100. The diamond lies on the point where the rule holds."""
        svg = ElementTree.fromstring(self.files["front_cotton_100.svg"])
        ours = next(p for p in svg.iter(SVG + "polyline") if p.get("stroke") == "#D55E00")
        points = [tuple(map(float, p.split(","))) for p in ours.get("points").split()]
        (_, _, (x1, y1), _, _, _, (x3, y3), (x, y), (x5, y5)) = points
        self.assertEqual((x, y), (x5, y3))  # until its end an iteration has reached nothing
        self.assertAlmostEqual(y3 - y1, y5 - y3, delta=0.3)
        self.assertAlmostEqual(x3 - x1, x5 - x3, delta=0.3)
        mark = next(p for p in svg.iter(SVG + "polygon") if p.get("fill") == "#D55E00")
        top = tuple(map(float, mark.get("points").split()[0].split(",")))
        self.assertEqual((top[0], round(top[1] + 6.5, 1)), (x3, y3))

    def test_front_without_traces(self):
        svg = ElementTree.fromstring(make(RAW)["front_cotton_100.svg"])
        ours = next(p for p in svg.iter(SVG + "polyline") if p.get("stroke") == "#D55E00")
        self.assertEqual(len(ours.get("points").split()), 2 * len(LEVELS) - 1)

    def test_gradient_figure_needs_its_row(self):
        raw = copy.deepcopy(RAW)
        raw["benchmarks"].append(valid("newton", "cotton", 100, (1, 1, 1, 2, 3),
                                       (30, 30, 30, 60, 90), 30.0, family="fig21"))
        files = make(raw, TRACES)
        self.assertIn("h = 1/60 s: cotton, 100 vertices", files["fig21.svg"])
        self.assertIn("## cotton, n = 100, long step h = 1/60 s (our analogue of the paper's "
                      "Fig. 21)", files["convergence.md"])
        self.assertNotIn("fig21.svg", make(raw))

    def test_iterations_do_not_grow(self):
        """5 iterations at 100 and at 900 vertices: a level line; none where it is not reached."""
        svg = ElementTree.fromstring(self.files["iterations_vs_n.svg"])
        lines = [p.get("points").split() for p in svg.iter(SVG + "polyline")
                 if p.get("stroke") == "#D55E00"]
        level = next(points for points in lines if len(points) == 2)
        self.assertEqual(level[0].split(",")[1], level[1].split(",")[1])

    def test_nothing_valid(self):
        """A run that failed altogether is reported, not a crash."""
        files = make({"context": CONTEXT, "benchmarks": [
            raw_row("default", "soft", 100, error_occurred=True, error_message="singular")]})
        self.assertIn("- FAIL default: singular", files["convergence.md"])
        self.assertEqual([n for n in files if n.endswith(".svg")], [])


if __name__ == "__main__":
    unittest.main()
