"""The rows and traces of bench_convergence as ci/convergence_tables sees them."""
import re
from dataclasses import dataclass, field

from bench_json import PLUMBING, TO_MS, iterations, status_of

NOT_REACHED = -1  # kNotReached in benchmarks/bench_convergence.cpp
DISTURBED_ABOVE = 1.1  # slowest run over fastest: more than 5 % of variation

OURS = "default"
# The baseline first, then from what many would write to ours; Newton's method is of another kind.
ORDER = ("vanilla_pd", "pd_tree", "chebyshev", "anderson", "lbfgs", "default", "newton",
         "newton_pcg", "pd_jacobi", "xpbd")
CLOTHS = ("soft", "cotton", "stiff")
FAMILIES = ("convergence", "fig21")


def place(name, order):
    """Place of a name in its order; unknown ones last."""
    return order.index(name) if name in order else len(order)


@dataclass
class Row:
    family: str
    method: str
    cloth: str
    n: int
    threads: int
    status: str = "ok"  # failed, skipped
    message: str = ""
    real_ms: float = 0
    counters: dict = field(default_factory=dict)  # only what was reached

    @property
    def ok(self):
        return self.status == "ok"

    @property
    def problem(self):
        return (self.family, self.cloth, self.n)

    @property
    def key(self):
        """Deterministic order of rows."""
        return (place(self.family, FAMILIES), self.n, place(self.cloth, CLOTHS), self.cloth,
                place(self.method, ORDER), self.method, self.threads)

    @property
    def disturbed(self):
        """Whether equal runs, of the method or of its baseline, took unequal times."""
        return any(self.counters.get(k, 1) > DISTURBED_ABOVE for k in ("spread", "base_spread"))


def parse(raw):
    """Row of a raw one: convergence/METHOD/CLOTH/n:N/threads:T/..."""
    family, method, cloth, *rest = raw["name"].split("/")
    sizes = {k: int(v) for k, v in re.findall(r"(n|threads):(\d+)", "/".join(rest))}
    row = Row(family, method, cloth, sizes["n"], sizes.get("threads", 1))
    row.status, row.message = status_of(raw)
    if row.ok:
        row.real_ms = raw["real_time"] * TO_MS[raw["time_unit"]]
        row.counters = {k: v for k, v in raw.items() if k not in PLUMBING and v != NOT_REACHED}
    return row


def read_rows(raw):
    """All rows, sorted."""
    return sorted((parse(r) for r in iterations(raw)), key=lambda row: row.key)


@dataclass
class Trace:
    """What a method reached: one dict per iteration, of which long runs keep only some."""
    family: str
    method: str
    cloth: str
    n: int
    points: list

    @property
    def problem(self):
        return (self.family, self.cloth, self.n)


def read_traces(raw):
    """What bench_convergence wrote with --traces; null (not finite) is left out."""
    columns = raw["columns"]
    traces = []
    for trace in raw["traces"]:
        points = [{k: v for k, v in zip(columns, point) if v is not None}
                  for point in trace["points"]]
        traces.append(Trace(trace["family"], trace["method"], trace["cloth"], trace["n"], points))
    return sorted(traces, key=lambda t: place(t.method, ORDER))


def level_trace(row):
    """The few points that the row's own counters know, where there is no trace."""
    points = []
    for counter, ms in row.counters.items():
        level = re.fullmatch(r"time_ms_(.*)", counter)
        if level and f"iterations_{level[1]}" in row.counters:
            points.append({"iteration": row.counters[f"iterations_{level[1]}"], "ms": ms,
                           "energy_error": float(level[1])})
    points.sort(key=lambda p: -p["energy_error"])
    return Trace(row.family, row.method, row.cloth, row.n, points)


def complete_traces(rows, traces):
    """A trace for every valid row, in the order of the rows."""
    known = {(t.problem, t.method): t for t in traces}
    return [known.get((r.problem, r.method)) or level_trace(r) for r in rows if r.ok]
