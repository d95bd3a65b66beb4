"""The rows of bench_global as the tables and the figure of ci/global_tables see them."""
import re
from dataclasses import dataclass, field
from typing import Optional

from bench_json import PLUMBING, TO_MS, interval_text, iterations, status_of

DISTURBED_BELOW = 0.85  # of the row's threads

# Baseline first, then from what many would write to our newest; bounds and factorisations last.
ORDER = ("cholmod", "eigen_llt", "eigen_ldlt", "cholmod_3n", "literal_primal_dual", "primal_dual",
         "primal_dual_refined", "tree_f64", "tree_f32", "tree_pair_f32", "read_limit_f64",
         "read_limit_f32", "read_limit_", "refactor_f64", "refactor_f32", "refactor_")


@dataclass(frozen=True)
class Interval:
    """A median and, if it was measured often enough, the ends of its interval."""
    median: float
    low: Optional[float] = None
    high: Optional[float] = None

    def __str__(self):
        return interval_text(self.median, self.low, self.high)

    def __truediv__(self, other):
        """The quotient; its ends are the worst cases of both."""
        if None in (self.low, self.high, other.low, other.high):
            return Interval(self.median / other.median)
        return Interval(self.median / other.median, self.low / other.high, self.high / other.low)

    def contains(self, value):
        return self.low is not None and self.high is not None and self.low <= value <= self.high


ONE = Interval(1, 1, 1)


@dataclass
class Row:
    family: str  # global, global_stretch_only
    method: str
    n: int
    domains: int
    threads: int
    status: str = "ok"  # failed, skipped
    message: str = ""
    real_ms: float = 0
    counters: dict = field(default_factory=dict)

    @property
    def ok(self):
        return self.status == "ok"

    @property
    def solves(self):
        """Whether the row's time is that of a solve."""
        return not self.method.startswith(("read_limit_", "refactor_"))

    @property
    def precision(self):
        return "f32" if self.method.endswith("_f32") else "f64"

    @property
    def key(self):
        """Deterministic order of rows."""
        return (self.n, self.family, rank(self.method), self.method, self.domains, self.threads)

    @property
    def disturbed(self):
        busy = self.counters.get("cpu_over_wall")
        return busy is not None and busy < DISTURBED_BELOW * self.threads

    def interval(self, name):
        """A counter with its interval, or None."""
        if name not in self.counters:
            return None
        get = self.counters.get
        return Interval(get(name), get(name + "_low"), get(name + "_high"))

    @property
    def ms(self):
        return self.interval("ours_ms") or Interval(self.real_ms)

    @property
    def cost(self):
        """Our time in units of the baseline's, measured side by side, or None."""
        paired = self.interval("paired_ratio")
        if paired is None and self.counters.get("ratio"):
            return Interval(1 / self.counters["ratio"])
        return paired


def rank(method):
    """Place of a method in ORDER; exact names before prefixes, unknown methods last."""
    if method in ORDER:
        return ORDER.index(method)
    prefixes = [i for i, name in enumerate(ORDER) if name.endswith("_") and method.startswith(name)]
    return prefixes[0] if prefixes else len(ORDER)


def relative(row, other):
    """Time of `row` over time of `other`, both in units of CHOLMOD's: what disturbs a row disturbs
    its baseline too, so that rows timed minutes apart can be compared. Without: of the times."""
    if row.cost is not None and other.cost is not None:
        return row.cost / other.cost
    return row.ms / other.ms


def parse(raw):
    """Row of a raw one: global/METHOD/n:N/D:D/threads:T/..."""
    family, method, *rest = raw["name"].split("/")
    sizes = {k: int(v) for k, v in re.findall(r"(n|D|threads):(\d+)", "/".join(rest))}
    row = Row(family, method, sizes["n"], sizes.get("D", 1), sizes.get("threads", 1))
    row.status, row.message = status_of(raw)
    if not row.ok:
        return row
    row.real_ms = raw["real_time"] * TO_MS[raw["time_unit"]]
    row.counters = {k: v for k, v in raw.items() if k not in PLUMBING}
    return row


def read_rows(raw):
    """All rows, sorted; aggregates of repetitions are left out."""
    return sorted((parse(r) for r in iterations(raw)), key=lambda row: row.key)
