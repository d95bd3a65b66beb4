#!/usr/bin/env python3
"""Tests of ci/contact_tables on a small raw JSON written by hand."""
import unittest
import xml.etree.ElementTree as ElementTree

from tables_test_case import TablesTestCase

CONTEXT = {"date": "2026-01-02T03:04:05+00:00", "num_cpus": 2, "cpu_model": "Abacus",
           "build_type": "Release", "revision": "cafe", "dirty": "false"}


def raw_row(name, **counters):
    return {"name": name + "/iterations:9/manual_time", "run_type": "iteration", "iterations": 9,
            "threads": 1, "real_time": 9.0, "time_unit": "ms", **counters}


def valid(solver, ms, its, ratio, where="n:60025/ratio:50/threads:2", family="contact"):
    return raw_row(f"{family}/{solver}/{where}", ours_ms=ms, ours_ms_low=0.9 * ms,
                   ours_ms_high=1.1 * ms, ratio=ratio, update_ms=0.75 * ms, solve_ms=0.25 * ms,
                   iterations=its, applications=its, residual=1e-5, true_error=9e-4, n=9)


FOLDS = "n:60025/ratio:50/threads:2/set:folds"
SMALL = "n:3721/ratio:10000/threads:1"
CHANGED = "changed:12/n:60025/ratio:1000/threads:2"
RAW = {"context": CONTEXT, "benchmarks": [
    valid("jacobi_pcg", 480, 400, 0.5), valid("kinv_pcg", 240, 40, 1), valid("refactor", 40, 1, 6),
    valid("jacobi_pcg", 240, 200, 0.5, FOLDS), valid("kinv_pcg", 100, 20, 1, FOLDS),
    valid("refactor", 25, 1, 4, FOLDS), valid("refactor", 2, 1, 7, SMALL),
    valid("kinv_pcg", 14, 50, 1, SMALL),
    raw_row("contact/hybrid/" + SMALL, error_occurred=True, error_message="an error is left"),
    valid("refactor", 20, 1, 1, CHANGED, "crossover"),
    valid("pcg_last_factor", 8, 4, 1, CHANGED, "crossover"),
]}
TRACES = {"columns": ["iteration", "ms", "residual", "true_error"],
          "traces": [{"solver": solver, "set": "disk", "n": n, "ratio": 50, "threads": 2,
                      "points": [[0, 0, 1, 1], [1, 5, 0.1, 0.8], [2, 9, 1e-3, 1e-9], [3, 12, None, 0]]}
                     for n in (3721, 60025) for solver in ("kinv_pcg", "refactor", "dual")]}


class ContactTables(TablesTestCase):
    name = "contact"
    raw = RAW
    traces = TRACES

    def lines(self, start):
        return [[c.strip() for c in line.split("|")[1:-1]] for line in self.text.splitlines()
                if line.startswith(start)]

    def test_goals_are_judged_and_misses_are_named(self):
        self.assertIn("refactor against kinv_pcg at n = 60025, connected sets: 4 to 6 times faster; "
                      "the goal of 5 is missed at folds, ratio 50, 2 threads: 4.", self.text)
        self.assertIn("refactor against jacobi_pcg at n = 60025, connected sets: 8 to 12 times "
                      "faster; the goal of 10 is missed at folds, ratio 50, 2 threads: 8.",
                      self.text)

    def test_counts_stand_side_by_side(self):
        head = self.lines("| iterations")[0]
        self.assertEqual(head[1:], ["3721, 10000", "60025, 50"], "only what was measured")
        self.assertEqual(self.lines("| kinv_pcg")[0], ["kinv_pcg", "50", "20 to 40"])

    def test_refactoring_comes_first_in_every_table(self):
        after = self.text.split("### disk, ratio 50, 2 threads")[1].splitlines()
        rows = [line.split("|")[1].strip() for line in after if line.startswith("| ")][2:5]
        self.assertEqual(rows, ["refactor", "kinv_pcg", "jacobi_pcg"])
        self.assertIn(" 40 [36-44] |", self.text)

    def test_crossover_depends_on_the_number_of_solves(self):
        row = self.lines("| 12 ")[0]
        self.assertEqual(row, ["12", "15 + 5 (1)", "6 + 2 (4)", "pcg_last_factor",
                               "pcg_last_factor"])

    def test_failures_are_named(self):
        self.assertIn("- FAIL contact/hybrid, n = 3721, disk, ratio 10000: an error is left",
                      self.text)

    def test_the_figure_shows_one_problem(self):
        svg = (self.out / "contact.svg").read_text()
        ElementTree.fromstring(svg)
        self.assertIn("60025 vertices, disk", svg)
        self.assertEqual(svg.count("<polyline"), 6)

    def test_csv_has_a_line_per_row(self):
        self.assertEqual(len((self.out / "contact.csv").read_text().splitlines()), 12)


if __name__ == "__main__":
    unittest.main()
