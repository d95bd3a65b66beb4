#!/usr/bin/env python3
"""Tests of ci/contact_steps_tables on a small raw JSON written by hand."""
import re
import unittest
import xml.etree.ElementTree as ElementTree

from tables_test_case import TablesTestCase

CONTEXT = {"date": "2026-01-02T03:04:05+00:00", "num_cpus": 2, "cpu_model": "Abacus",
           "build_type": "Release", "revision": "cafe", "dirty": "false"}


def raw_row(name, **counters):
    return {"name": f"contact_steps/{name}/iterations:1/manual_time", "run_type": "iteration",
            "threads": 1, "real_time": 9.0, "cpu_time": 8.0, "time_unit": "ms", **counters}


def steps(name, **counters):
    """A valid row; `iterations` stands twice in the driver's JSON, and the counter comes last."""
    usual = {"steps": 60, "cpu_ms": 20, "cpu_ms_mean": 25, "step_ms": 21, "max_over_median": 3,
             "iterations": 9, "iterations_mean": 9.5, "iterations_max": 30, "solves": 80,
             "cull_share": 0.05, "narrow_share": 0.25, "check_share": 0.02, "pairs": 900,
             "pairs_max": 2000, "interpenetrations": 0, "converged": 1, "growth_by_pairs": 1.25}
    return raw_row(name, **{**usual, **counters})


def weight(ratio, tolerance, its, free):
    return steps(f"weight/state:sliding/support:rigid/ratio:{ratio}/tolerance:{tolerance}",
                 iterations=its, free_iterations=free, free_solves=free, stiffness_ratio=0.5 * ratio,
                 speed=0.4)


def slope(solid, mu, slid, expected):
    return steps(f"friction/solid:{solid}/mu:{mu}", slid_mm=slid, expected_mm=expected)


RAW = {"context": CONTEXT, "benchmarks": [
    steps("detection/n:2500", us_per_triangle_step=1.5, us_per_triangle_iteration=0.125,
          cull_us_per_triangle_step=0.5),
    steps("detection/n:10000", us_per_triangle_step=1.75, us_per_triangle_iteration=0.25,
          cull_us_per_triangle_step=0.5, growth_by_n=1.375),
    steps("drape/n:2500/tolerance:1e-2/threads:1", cpu_ms=8, true_error=5e-3, true_error_max=0.1),
    steps("drape/n:2500/tolerance:1e-3/threads:1", true_error=2e-3, true_error_max=0.5,
          converged=0.95, cull_share=0.2),
    steps("active/scene:stack_of_20/threads:2", max_over_median=7, vertices=2880),
    weight(1, "1e-2", 6, 4), weight(1, "1e-3", 12, 8), weight(100, "1e-2", 18, 6),
    slope("plane", 0.2, 100, 101), slope("mesh", 0.2, 110, 101), slope("plane", 0.6, 0.1, 0),
    raw_row("drape/n:19881/tolerance:1e-2/threads:2", error_occurred=True,
            error_message="3 interpenetrations"),
    raw_row("drape/n:19881/tolerance:1e-2/threads:4", error_occurred=True,
            error_message="skipped: 4 threads on 2 cores"),
]}
COLUMNS = ["step", "step_ms", "cpu_ms", "cull_ms", "narrow_ms", "iterations", "pairs", "true_error"]


def run(scene, tolerance, threads):
    """Times grow as the square of the pairs."""
    points = [[0, 1, 1, 0, 0, 1, 0, None]]
    points += [[k, 0.01 * p * p, 1, 0, 0, 10, p, None] for k, p in enumerate((10, 20, 40, 80), 1)]
    return {"family": "drape", "scene": scene, "n": 2500, "tolerance": tolerance,
            "threads": threads, "points": points}


TRACES = {"columns": COLUMNS, "runs": [run("ball", "1e-1", 1), run("ball", "1e-2", 1),
                                       run("ball", "1e-2", 2), run("pile", "0.01", 1)]}


class ContactStepsTables(TablesTestCase):
    name = "contact_steps"
    raw = RAW
    traces = TRACES

    def line(self, start):
        lines = [line for line in self.text.splitlines() if line.startswith("| " + start)]
        self.assertEqual(len(lines), 1, start)
        return [cell.strip() for cell in lines[0].split("|")[1:-1]]

    def goal(self, start):
        return self.line(start)[1:]

    def test_interpenetrations_are_a_goal_missed_and_a_failure_named(self):
        self.assertEqual(self.goal("no interpenetration"),
                         ["0", "1 of 12 rows, 660 steps", "**not reached**"])
        self.assertIn("- FAILED drape, n 19881, tolerance 1e-2, threads 2: 3 interpenetrations",
                      self.text)
        self.assertIn("- SKIPPED drape, n 19881, tolerance 1e-2, threads 4: 4 threads on 2 cores",
                      self.text)

    def test_the_worst_row_is_named(self):
        self.assertEqual(self.goal("steps that converge"),
                         ["100 %", "95 % (drape, n 2500, tolerance 1e-3, threads 1)",
                          "**not reached**"])

    def test_others_are_quoted_with_our_goals(self):
        self.assertEqual(self.goal("CPU ms per step against C-IPC"), ["9.84 (1/200)", "8", "reached"])
        self.assertEqual(self.goal("CPU ms per step against Ly"), ["5.20 (1/10)", "8", "**not reached**"])
        self.assertEqual(self.line("C-IPC")[3], "246")
        self.assertIn("**Quoted**", self.text)

    def test_true_errors_are_judged_by_their_tolerance(self):
        self.assertEqual(self.goal("true error, median, at tolerance 1e-2"),
                         ["0.0100", "0.00500", "reached"])
        self.assertEqual(self.goal("true error, median, at tolerance 1e-3")[2], "**not reached**")

    def test_shares_and_spreads_are_over_all_scenes(self):
        self.assertEqual(self.goal("detection's share"), ["58 %", "30 to 45 %", "reached"])
        self.assertEqual(self.goal("broad phase's share"), ["15 %", "5 to 20 %", "**not reached**"])
        self.assertEqual(self.goal("slowest over median"), ["3.90", "3 to 7", "**not reached**"])

    def test_growth_stands_beside_pairs_of_scenes_at_the_usual_tolerance(self):
        lines = [line for line in self.text.splitlines() if line.startswith("| stack_of_20, 2880, 2")]
        self.assertEqual(len(lines), 2)
        self.assertEqual([c.strip() for c in lines[0].split("|")[2:-1]],
                         ["900", "2000", "21", "1.25", "-"])
        self.assertEqual(self.line("drape_on_sphere, -, 1")[1:3], ["900", "2000"])

    def test_sliding_is_judged_stiffness_by_stiffness(self):
        name = "iterations of sliding contact over those without it, stiffness x "
        self.assertEqual(self.goal(name + "1 "), ["2", "1.50", "reached"])
        self.assertEqual(self.goal(name + "100"), ["2", "3", "**not reached**"])
        row = self.line("sliding, rigid, 100")
        self.assertEqual(row[1:5], ["50", "18 (30)", "6", "3"])
        self.assertEqual(row[8:], ["-"] * 6)

    def test_coulomb_and_detection(self):
        self.assertEqual(self.goal("sliding distance")[1:], ["8.9 %", "**not reached**"])
        self.assertEqual(self.goal("detection, us"), ["0.150", "0.125 to 0.250", "**not reached**"])
        self.assertEqual(self.line("0.6 ")[1:4], ["0", "0.100", "-"])

    def test_figures_are_drawn(self):
        pairs = (self.out / "fig11.svg").read_text()
        ElementTree.fromstring(pairs)
        # Two panels; of each scene one run, four steps in contact.
        self.assertEqual(len(re.findall('r="2.6"', pairs)), 2 * 2 * 4)
        self.assertEqual(pairs.count("pairs^2"), 4)
        self.assertIn("ball, 2500 vertices, 2 threads", pairs)
        slope_figure = (self.out / "fig14.svg").read_text()
        ElementTree.fromstring(slope_figure)
        self.assertEqual(slope_figure.count("<polyline"), 1)

    def test_csv_has_a_line_per_row(self):
        self.assertEqual(len((self.out / "contact_steps.csv").read_text().splitlines()),
                         1 + len(RAW["benchmarks"]))


if __name__ == "__main__":
    unittest.main()
