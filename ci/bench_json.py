"""What the scripts that turn a benchmark driver's raw JSON into tables share."""
import json
import math
import re

# Fields of Google Benchmark that are no counters of ours.
PLUMBING = {
    "name", "family_index", "per_family_instance_index", "run_name", "run_type", "repetitions",
    "repetition_index", "threads", "iterations", "real_time", "cpu_time", "time_unit", "label",
    "error_occurred", "error_message", "aggregate_name", "aggregate_unit",
}

SKIP_PREFIX = "skipped: "  # kSkipPrefix in benchmarks/bench_main.cpp
TO_MS = {"ns": 1e-6, "us": 1e-3, "ms": 1.0, "s": 1e3}

CONTEXT_KEYS = ("date", "num_cpus", "mhz_per_cpu", "load_avg", "cpu_model", "kernel", "compiler",
                "compiler_flags", "build_type", "revision", "dirty")


def load(path):
    """The raw JSON; Google Benchmark's NaN and Infinity are read as such."""
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def digits(value):
    """Three significant digits, without exponent where a person would not write one."""
    if not isinstance(value, (int, float)):
        return str(value)
    if not math.isfinite(value):
        return "-"
    if value == int(value) and abs(value) < 1e9:
        return str(int(value))
    if not 1e-3 <= abs(value) < 1e6:
        return f"{value:.2e}"
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}"


def interval_text(median, low, high):
    """ "12.3 [11.9-12.8]", or the median alone where an end is missing."""
    if low is None or high is None:
        return digits(median)
    return f"{digits(median)} [{digits(low)}-{digits(high)}]"


def cell(row, counter):
    """ "12.3 [11.9-12.8]" where the row has an interval, else the value, "-" if it has none."""
    if counter not in row:
        return "-"
    return interval_text(row[counter], row.get(counter + "_low"), row.get(counter + "_high"))


def counter_names(rows):
    """Counters in order of appearance."""
    names = []
    for row in rows:
        names += [k for k in row if k not in PLUMBING and k not in names]
    return names


def columns(rows):
    """Counters that get a column; ends of intervals belong to their medians."""
    names = counter_names(rows)
    ends = {name + end for name in names for end in ("_low", "_high")}
    return [name for name in names if name not in ends]


def short_name(row):
    """The row's name without what says only how it was timed."""
    return re.sub(r"/(real_time|manual_time|iterations:\d+)", "", row["name"])


def context_lines(context, keys=CONTEXT_KEYS):
    """The environment as a Markdown list, in the order of `keys`."""
    return [f"- {key}: {context[key]}" for key in keys if key in context]


def iterations(raw):
    """The rows as they were timed; aggregates of repetitions are left out."""
    return [r for r in raw["benchmarks"] if r.get("run_type", "iteration") == "iteration"]


def status_of(row):
    """(ok | failed | skipped, why)"""
    if not row.get("error_occurred"):
        return "ok", ""
    message = row.get("error_message", "")
    if message.startswith(SKIP_PREFIX):
        return "skipped", message[len(SKIP_PREFIX):]
    return "failed", message


def groups(rows, key):
    """Rows by key(row), in order of appearance."""
    result = {}
    for row in rows:
        result.setdefault(key(row), []).append(row)
    return result


def numbers(values):
    """ "1, 4, 8": each once, ascending."""
    return ", ".join(str(v) for v in sorted(set(values)))


def plural(count, noun):
    return f"{count} {noun}" + ("" if count == 1 else "s")
