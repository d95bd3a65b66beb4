#!/usr/bin/env python3
"""Tests of ci/front_tables on a sweep written by hand."""
import copy
import json
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree
from pathlib import Path

SCRIPT = Path(__file__).resolve().parent / "front_tables"


def case(ms, relative, exit_code=0, **settings):
    error = {"max_m": 0.1 * relative, "rms_m": 0.01 * relative, "relative": relative,
             "time_ratio": 1.0}
    return {"name": "c", "settings": {k.replace("__", "."): v for k, v in settings.items()},
            "exit_code": exit_code, "steps": 30, "converged_steps": 29,
            "ms_per_step": {"median": ms, "low": ms, "high": ms, "n": 30}, "disturbed": ms > 50,
            "iterations_per_step": 4.5, "worst_gradient": 0.5, "worst_error_mean_edges": 0.1,
            "position_error": error if relative else None}


SWEEP = {"schema": "piecework.sweep/1", "description": "A sheet, hanging: a test.",
         "environment": {"cpu": "Abacus"},
         "cases": [case(100.0, 0, quality__preset="reference"),
                   case(2.0, 0.01, quality__preset="default"),
                   case(4.0, 0.001, quality__tolerance=1e-4),
                   case(3.0, 0.02, solver__method="vanilla_pd", quality__stop="dx_2"),
                   case(1.0, 0.05, quality__accelerate="anderson"),
                   case(5.0, 0.5, exit_code=1, solver__method="xpbd")]}


def run(*sweeps):
    with tempfile.TemporaryDirectory() as folder:
        paths = []
        for i, sweep in enumerate(sweeps):
            paths.append(Path(folder) / f"{i}.json")
            paths[-1].write_text(sweep if isinstance(sweep, str) else json.dumps(sweep))
        done = subprocess.run([sys.executable, SCRIPT, *paths, "--out", folder],
                              capture_output=True, text=True)
        if done.returncode != 0:
            return done, "", ""
        return (done, (Path(folder) / "front.md").read_text(),
                (Path(folder) / "front.svg").read_text())


def cells(markdown, start):
    line = next(l for l in markdown.splitlines() if l.startswith("| " + start))
    return [c.strip() for c in line.strip("|").split("|")]


class FrontTables(unittest.TestCase):
    def test_numbers_and_names(self):
        _, markdown, _ = run(SWEEP)
        self.assertIn("## A sheet, hanging\n", markdown)
        self.assertEqual(cells(markdown, "PD, CHOLMOD"),
                         ["PD, CHOLMOD", "the paper's, ‖Δx‖₂ ≤ 10⁻³", "3", "4.50", "2", "0.200",
                          "5.0e-01", "29/30"])
        self.assertIn("100 †", markdown)
        self.assertEqual(cells(markdown, "XPBD")[2], "failed (1)")

    def test_the_front_is_what_nothing_beats(self):
        _, markdown, _ = run(SWEEP)
        self.assertEqual(cells(markdown, "Anderson")[2], "**1**")
        self.assertNotIn("**3**", markdown, "the default is faster and more exact")
        self.assertIn("On the front without being ours: Anderson (error ≤ 0.01).", markdown)
        slower = copy.deepcopy(SWEEP)
        slower["cases"][4]["ms_per_step"]["median"] = 2.5
        _, markdown, _ = run(slower)
        self.assertNotIn("without being ours", markdown)

    def test_the_picture_is_svg_with_a_point_per_case(self):
        _, _, svg = run(SWEEP, SWEEP)
        root = ElementTree.fromstring(svg)
        diamonds = [e for e in root.iter() if e.tag.endswith("polygon")]
        self.assertEqual(len(diamonds), 3, "two points and the legend")

    def test_what_is_no_sweep_is_refused(self):
        done, _, _ = run("{}")
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("no sweep.json", done.stderr)


if __name__ == "__main__":
    unittest.main()
