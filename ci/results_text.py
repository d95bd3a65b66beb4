"""The files of results/tables/: Markdown, CSV and JSON with their environment."""
import csv
import io
import json
import math

from bench_json import context_lines

SCHEMA = "piecework.results/1"
FIRST_KEYS = ("date", "cpu_model", "num_cpus", "available_threads", "mhz_per_cpu", "kernel",
              "load_before", "load_avg", "compiler", "compiler_flags", "build_type", "revision",
              "dirty")
# Nobody's business, or not what it seems: Debian's Google Benchmark always says "debug".
HIDDEN_KEYS = {"executable", "host_name", "library_build_type", "caches", "json_schema_version",
               "cpu_scaling_enabled"}


def environment(context):
    """What of the context is published: known keys first, then libraries and whatever is new."""
    keys = [k for k in FIRST_KEYS if k in context]
    keys += sorted(k for k in context if k not in FIRST_KEYS and k not in HIDDEN_KEYS)
    return {key: context[key] for key in keys}


def cores(context):
    """Threads this machine runs at once; 0 if unknown."""
    return int(context.get("available_threads", context.get("num_cpus", 0)))


def preamble(title, context):
    """Heading and environment, with a warning where times mean nothing."""
    known = environment(context)
    lines = [f"# {title}", "", *context_lines(known, known), ""]
    if str(context.get("quick")) == "true":
        lines += ["**A --quick run: it shows that the driver works; its times mean nothing.**", ""]
    if str(context.get("build_type", "Release")) != "Release":
        lines += [f"**A {context['build_type']} build: its times mean nothing.**", ""]
    return lines


def markdown(head, rows):
    """An aligned table: the first column to the left, numbers to the right."""
    cells = [list(head)] + rows
    widths = [max(3, *(len(line[i]) for line in cells)) for i in range(len(head))]
    rule = [":" + "-" * (widths[0] - 1)] + ["-" * (w - 1) + ":" for w in widths[1:]]
    padded = [[line[0].ljust(widths[0])] + [c.rjust(w) for c, w in zip(line[1:], widths[1:])]
              for line in cells]
    return ["| " + " | ".join(line) + " |" for line in [padded[0], rule] + padded[1:]]


def finite(counters):
    """Counters in the order of their names; JSON has no NaN, so what is not finite is absent."""
    return {k: v for k, v in sorted(counters.items())
            if not isinstance(v, float) or math.isfinite(v)}


def results_json(name, records, context):
    document = {"schema": SCHEMA, "name": name, "context": environment(context),
                "rows": records}
    return json.dumps(document, indent=1) + "\n"


def results_csv(records, context, first):
    """Columns `first` before the others. The environment is repeated in every line: lines get
    copied out of files."""
    where = {k: context[k] for k in ("cpu_model", "compiler", "revision", "dirty") if k in context}
    records = [{**r, **where} for r in records]
    others = sorted({k for r in records for k in r} - set(first) - set(where))
    out = io.StringIO()
    writer = csv.DictWriter(out, [*first, *others, *where], lineterminator="\r\n")
    writer.writeheader()
    writer.writerows(records)
    return out.getvalue()


def write(path, text):
    """Exactly `text`: the CSV's line ends are its own."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text.encode())
