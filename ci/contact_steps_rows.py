"""Rows of bench_contact_steps as ci/contact_steps_tables sees them, and figures of others."""
import re
from dataclasses import dataclass, field

from bench_json import PLUMBING, iterations, status_of

FAMILIES = ("drape", "active", "friction", "weight", "detection")


@dataclass
class Row:
    family: str
    names: dict  # what the row's name says: n, tolerance, threads, scene, solid, mu, ...
    status: str = "ok"
    message: str = ""
    counters: dict = field(default_factory=dict)

    @property
    def ok(self):
        return self.status == "ok"

    @property
    def label(self):
        return self.family + ", " + ", ".join(f"{k} {v}" for k, v in self.names.items())

    def get(self, counter):
        return self.counters.get(counter)

    def number(self, name):
        return float(self.names[name])


def parse(raw):
    """Row of contact_steps/FAMILY/KEY:VALUE/..."""
    _, family, *rest = raw["name"].split("/")
    names = dict(re.fullmatch(r"([^:]+):(.+)", part).groups() for part in rest
                 if ":" in part and not part.startswith("iterations:"))
    status, message = status_of(raw)
    counters = {k: v for k, v in raw.items()
                if isinstance(v, (int, float)) and (k not in PLUMBING or k == "iterations")}
    return Row(family, names, status, message, counters if status == "ok" else {})


def read_rows(raw):
    """All rows, families in the order of the tables."""
    return sorted(map(parse, iterations(raw)), key=lambda row: FAMILIES.index(row.family))


@dataclass
class Peer:
    """A public simulator on scene B with 2500 vertices, on one thread of another machine."""
    name: str
    cpu_ms: float  # per step, median
    iterations: str
    notes: str
    part: int = 0  # the goal: at most this part of its time; 0: none


# Measured with their public sources on another machine of this kind (2 cores of Zen 4).
PEERS = (
    Peer("C-IPC (Codim-IPC 9c6cbe3)", 1968, "9 (65)", "projected Newton to 1e-3 m/s, no interpenetration",
         200),
    Peer("Stark 16197f7", 430, "11 (53)", "Newton to 1e-3 m/s, no continuous detection", 50),
    Peer("Ly et al. 2020, 20 iterations", 52, "20", "projective dynamics, not converged", 10),
    Peer("Ly et al. 2020, 100 iterations", 189, "100", "the same"),
)
