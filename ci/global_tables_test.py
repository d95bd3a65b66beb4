#!/usr/bin/env python3
"""Tests of ci/global_tables on a small raw JSON written by hand: every number can be checked so."""
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
SCRIPT = HERE / "global_tables"

CONTEXT = {"date": "2026-01-02T03:04:05+00:00", "executable": "/somewhere/bench_global",
           "num_cpus": 2, "load_avg": [0.5, 0.25, 0.125], "cpu_model": "Abacus",
           "build_type": "Release", "compiler": "GNU 12.2.0", "revision": "cafe", "dirty": "false",
           "eigen": "3.4.0", "library_build_type": "debug"}


def raw_row(method, domains, threads, **more):
    return {"name": f"global/{method}/n:100/D:{domains}/threads:{threads}/iterations:6/manual_time",
            "run_type": "iteration", "threads": 1, "iterations": 6, "real_time": 9.5,
            "time_unit": "ms", **more}


def valid(method, domains, threads, ms, paired_ratio, **more):
    """A row whose intervals reach 10 % down and 25 % up."""
    counters = {"n": 6.0, "base_ms": 10.0, "cpu_over_wall": 0.95 * threads}
    for name, value in (("ours_ms", ms), ("paired_ratio", paired_ratio)):
        counters.update({name: value, name + "_low": 0.9 * value, name + "_high": 1.25 * value})
    return raw_row(method, domains, threads, **{**counters, **more})


def invalid(method, domains, threads, message):
    return raw_row(method, domains, threads, real_time=0.0, error_occurred=True,
                   error_message=message)


# Deliberately not in the order of the table.
RAW = {"context": CONTEXT, "benchmarks": [
    valid("tree_f64", 8, 1, 5.0, 0.5, cpu_over_wall=0.5),  # disturbed
    valid("tree_f64", 1, 1, 4.0, 0.4, bytes=12.5e6, nnz=1.5e6, analyze_ms=30.0, factor_ms=4.0,
          GB_per_s=6.25, error=2e-13),
    valid("primal_dual", 8, 1, 20.0, 2.0, domains_ms=15.0, interface_ms=4.5),
    invalid("primal_dual", 4, 1, "error 0.5, allowed 1e-09"),
    invalid("tree_f64", 1, 4, "skipped: 4 threads on 2 cores"),
    invalid("tree_f64", 8, 4, "skipped: 4 threads on 2 cores"),
    invalid("tree_f64", 1, 8, "skipped: 8 threads on 2 cores"),
    invalid("tree_f64", 8, 8, "skipped: 8 threads on 2 cores"),
    invalid("literal_primal_dual", 8, 1, "skipped: G_RR needs 9 GB"),
    valid("read_limit_f64", 1, 1, 2.0, 0.2),
    raw_row("cholmod", 1, 1, ours_ms=10.0, base_ms=10.0, ratio=1.0, error=float("nan")),
]}

TABLE = """\
| method         |   D | threads |              ms |      CHOLMOD / ours | ours / read limit | K_RR, ms | G, ms | set-up, ms | memory, MB | nnz, M | GB/s |    error | cpu/wall |
| :------------- | --: | ------: | --------------: | ------------------: | ----------------: | -------: | ----: | ---------: | ---------: | -----: | ---: | -------: | -------: |
| cholmod        |   1 |       1 |              10 |                   1 |                 5 |        - |     - |          - |          - |      - |    - |        - |        - |
| primal_dual    |   4 |       1 |            FAIL |                   - |                 - |        - |     - |          - |          - |      - |    - |        - |        - |
| primal_dual    |   8 |       1 |      20 [18-25] | 0.500 [0.400-0.556] |                10 |       15 |  4.50 |          - |          - |      - |    - |        - |    0.950 |
| tree_f64       |   1 |       1 |      4 [3.60-5] |       2.50 [2-2.78] |                 2 |        - |     - |         34 |       12.5 |   1.50 | 6.25 | 2.00e-13 |    0.950 |
| tree_f64       |   8 |       1 | 5 [4.50-6.25] † |       2 [1.60-2.22] |              2.50 |        - |     - |          - |          - |      - |    - |        - |    0.500 |
| read_limit_f64 |   1 |       1 |   2 [1.80-2.50] |          5 [4-5.56] |                 - |        - |     - |          - |          - |      - |    - |        - |    0.950 |
"""

NOT_RUN = ("Not run: G_RR needs 9 GB (literal_primal_dual D = 8). "
           "4 threads on 2 cores, 8 threads on 2 cores (tree_f64 D = 1, 8).")


def make(raw):
    """name -> text of every file that the script writes."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "raw.json")
        source.write_text(json.dumps(raw), encoding="utf-8")
        out = Path(folder, "tables")
        subprocess.run([sys.executable, SCRIPT, source, "--out", out], check=True)
        return {path.name: path.read_bytes().decode() for path in out.iterdir()}


class GlobalTables(unittest.TestCase):
    maxDiff = None

    @classmethod
    def setUpClass(cls):
        cls.files = make(RAW)

    def lines_of(self, name, heading):
        """Lines of a file after a heading."""
        lines = self.files[name].split("\n")
        return lines[lines.index(heading) + 1:]

    def test_table(self):
        expected = ["", *TABLE.split("\n"), NOT_RUN, "",
                    "- FAIL primal_dual D = 4, 1 thread: error 0.5, allowed 1e-09", ""]
        self.assertEqual(self.lines_of("global.md", "## n = 100"), expected)

    def test_environment_without_paths(self):
        lines = self.files["global.md"].split("\n")
        self.assertEqual(lines[:11], [
            "# One global solve", "", "- date: 2026-01-02T03:04:05+00:00", "- cpu_model: Abacus",
            "- num_cpus: 2", "- load_avg: [0.5, 0.25, 0.125]", "- compiler: GNU 12.2.0",
            "- build_type: Release", "- revision: cafe", "- dirty: false", "- eigen: 3.4.0"])
        for name, text in self.files.items():
            self.assertNotIn("/somewhere", text, name)

    def test_more_threads_than_cores(self):
        busy = {"context": CONTEXT, "benchmarks": [valid("tree_f64", 1, 4, 4.0, 0.4)]}
        self.assertIn("|   1 |       4 | 4 [3.60-5] ‡ |", make(busy)["global.md"])

    def test_crossover_says_where_it_loses(self):
        self.assertEqual(self.lines_of("crossover.md", "Where the decomposition loses:"), [
            "",
            "- primal_dual, 1 thread, loses to CHOLMOD at every D (8); at its best, D = 8, it takes "
            "2 [1.80-2.50] times as long.",
            "- primal_dual, 1 thread, loses to tree_f64 undivided at every D (8); at its best, "
            "D = 8, it takes 5 [3.60-6.94] times as long.",
            "- tree_f64, 1 thread, loses to tree_f64 undivided at every D (8); at its best, D = 8, "
            "it takes 1.25 [0.900-1.74] times as long; the interval does not tell them apart.",
            "- literal_primal_dual, 1 thread, has no result at D = 8 (skipped: G_RR needs 9 GB).",
            "- primal_dual, 1 thread, has no result at D = 4 (failed: error 0.5, allowed 1e-09).",
            ""])

    def test_crossover_table(self):
        row = ("| tree_f64    |       1 |      8 | 5 [4.50-6.25] † |       2 [1.60-2.22] | "
               "0.800 [0.576-1.11] ~ | 0.800 [0.576-1.11] ~ |          tree_f64 undivided |")
        self.assertIn(row, self.lines_of("crossover.md", "## n = 100"))

    def test_csv(self):
        text = self.files["global.csv"]
        self.assertEqual(text.count("\r\n"), text.count("\n"))
        rows = list(csv.DictReader(io.StringIO(text, newline="")))
        self.assertEqual(len(rows), len(RAW["benchmarks"]))
        failed = next(r for r in rows if r["status"] == "failed")
        self.assertEqual((failed["method"], failed["D"], failed["message"], failed["ours_ms"]),
                         ("primal_dual", "4", "error 0.5, allowed 1e-09", ""))
        self.assertEqual({r["n"] for r in rows}, {"100"})  # not the counter of samples

    def test_json(self):
        def refuse(constant):
            raise ValueError(f"{constant} is no JSON")
        document = json.loads(self.files["global.json"], parse_constant=refuse)
        self.assertEqual(document["schema"], "piecework.results/1")
        self.assertEqual(document["context"]["eigen"], "3.4.0")
        cholmod = document["rows"][0]
        self.assertEqual((cholmod["method"], cholmod["ours_ms"]), ("cholmod", 10.0))
        self.assertNotIn("error", cholmod)

    def test_order_of_the_raw_file_does_not_matter(self):
        self.assertEqual(make({**RAW, "benchmarks": RAW["benchmarks"][::-1]}), self.files)

    def test_figure(self):
        """20 ms of primal_dual stand four times as high as the tree's 5 ms, in parts 15, 4.5, 0.5.
        """
        svg = ElementTree.fromstring(self.files["fig9.svg"])
        heights = {}
        for box in svg.iter("{http://www.w3.org/2000/svg}rect"):
            heights.setdefault(box.get("fill"), []).append(float(box.get("height")))
        tree = max(heights["#00795A"]) / 5
        self.assertAlmostEqual(max(heights["#0072B2"]), 15 * tree, delta=0.2)
        self.assertAlmostEqual(max(heights["#9CCBEA"]), 4.5 * tree, delta=0.2)
        texts = [t.text for t in svg.iter("{http://www.w3.org/2000/svg}text")]
        self.assertIn("n = 100, 1 thread", texts)
        self.assertEqual((texts.count("†"), texts.count("×")), (1, 1))

    def test_nothing_valid(self):
        """A run that failed altogether is reported, not a crash."""
        files = make({"context": CONTEXT, "benchmarks": [invalid("tree_f64", 8, 1, "singular")]})
        self.assertIn("FAIL", files["global.md"])
        self.assertIn("no valid row", files["fig9.svg"])


if __name__ == "__main__":
    unittest.main()
