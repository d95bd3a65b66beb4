#!/usr/bin/env python3
"""Tests of ci/iterations_tables on a small raw JSON written by hand."""
import unittest
import xml.etree.ElementTree as ElementTree

from tables_test_case import TablesTestCase

CONTEXT = {"date": "2026-01-02T03:04:05+00:00", "num_cpus": 2, "cpu_model": "Abacus",
           "build_type": "Release", "revision": "cafe", "dirty": "false"}
LEVELS = ("1e-1", "1e-2", "1e-3", "1e-4", "1e-5", "1e-6")


def method(name, its, ms, least):
    counters = {f"{name}:iterations_{level}": i for level, i in zip(LEVELS, its)}
    counters.update({f"{name}:time_ms_{level}": t for level, t in zip(LEVELS, ms)})
    return {**counters, f"{name}:least_error": least, f"{name}:ms_per_iteration": 2.0}


def raw_row(name, **counters):
    return {"name": name, "run_type": "iteration", "iterations": 1, "threads": 1, "real_time": 9.0,
            "time_unit": "ms", **counters}


RAW = {"context": CONTEXT, "benchmarks": [
    raw_row("fig13/h:60/n:100/threads:2/iterations:1/manual_time",
            **method("pd_jacobi", (2, 100, 200, 400, -1, -1), (1, 10, 20, 40, -1, -1), 1e-4),
            **method("default", (1, 4, 5, -1, -1, -1), (5, 20, 10, -1, -1, -1), 5e-4)),
    raw_row("fig12/h:120/n:100/threads:2/iterations:1/manual_time",
            **method("jacobi", (1, 10, 20, 40, 80, -1), (1, 10, 20, 40, 80, -1), 2e-6),
            **method("gauss_seidel", (1, 5, 10, 20, 64, 90), (2, 20, 40, 80, 160, 300), 1e-6),
            **method("literal_eq12", (-1,) * 6, (-1,) * 6, 0.7),
            **{"jacobi:spread": 1.5, "gauss_seidel:spread": 1.05}),
    raw_row("fig7/sweeps/gauss_seidel/fixed/n:100", moran=0.5, moran_first=0.6, persistence=0.9,
            residual=0.1, sweeps=16),
    raw_row("fig7/sweeps/gauss_seidel/alternating/n:100", moran=0.25, moran_first=0.6,
            persistence=0.3, residual=0.1, sweeps=16),
    raw_row("fig7/sweeps/literal_eq12/fixed/n:100", error_occurred=True, error_message="too short"),
]}
TRACES = {"columns": ["iteration", "ms", "energy_error", "position_error", "gradient", "dx_2"],
          "traces": [{"family": "fig12", "method": "jacobi", "n": 100, "h": 1 / 120,
                      "points": [[0, 0, 1, 1, None, 0], [1, 2, 0.5, 1, 1, 1], [9, 20, 1e-3, 1, 1, 1]]},
                     {"family": "fig13", "method": "pd_jacobi", "n": 100, "h": 1 / 60,
                      "points": [[1, 1, 0.5, 1, 1, 1], [100, 9, 1e-4, 1, 1, 1]]}]}


class IterationsTables(TablesTestCase):
    name = "iterations"
    raw = RAW
    traces = TRACES

    def test_sweeps_are_judged_by_the_target(self):
        self.assertIn("gauss_seidel / jacobi. Iterations 1e-1: 1, 1e-2: 0.500, 1e-3: 0.500, "
                      "1e-4: 0.500, 1e-5: 0.800 (the target of 0.75 is met at 1e-2, 1e-3, 1e-4); "
                      "time 1e-1: 2, 1e-2: 2, 1e-3: 2, 1e-4: 2, 1e-5: 2.", self.text)
        self.assertIn("never gets below an energy error of 0.700", self.text)

    def test_wins_of_pd_jacobi_are_said(self):
        self.assertIn("1e-2: 25 x fewer iterations, **pd_jacobi 2 x faster**; "
                      "1e-3: 40 x fewer iterations, 2 x faster; 1e-4: pd_jacobi only, 40 ms.",
                      self.text)

    def test_patterns_and_failures_are_named(self):
        self.assertIn("Moran's I 0.500 -> 0.250, persistence 0.900 -> 0.300", self.text)
        self.assertIn("- FAIL fig7/sweeps/literal_eq12/fixed/n:100: too short", self.text)

    def test_methods_keep_their_order(self):
        methods = [line.split("|")[1].strip() for line in self.text.splitlines()
                   if line.startswith(("| jacobi", "| gauss_seidel ", "| literal_eq12 "))]
        self.assertEqual(methods, ["jacobi †", "gauss_seidel", "literal_eq12"])

    def test_figures_are_svg_with_a_curve_per_trace(self):
        for name in ("fig12.svg", "fig13.svg"):
            root = ElementTree.parse(self.out / name).getroot()
            curves = root.findall(".//{http://www.w3.org/2000/svg}polyline")
            self.assertEqual(len(curves), 2)  # against iterations and against time

    def test_unequal_times_are_marked(self):
        self.assertIn("| jacobi †", self.text)
        self.assertNotIn("| gauss_seidel †", self.text)

    def test_csv_has_a_line_per_method(self):
        lines = (self.out / "iterations.csv").read_text().splitlines()
        self.assertEqual(len(lines), 1 + 2 + 3 + 3)


if __name__ == "__main__":
    unittest.main()
