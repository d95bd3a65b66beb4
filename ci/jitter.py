#!/usr/bin/env python3
"""Runs scenes with contact several times, each time a little different, and makes a table of what
happened; see jitter.sh.

A run is made different by its number alone: sheets and strips are triangulated anew, with their inner
vertices moved in their plane; all cloths together are shifted sideways by up to 2 mm. So it is the
same wherever it is run, but folds fall otherwise than in the scene itself.

A run that ended is not run again by the same program with the same settings: an interrupted job goes
on where it was, and several at once (with tables of their own) share the work that a last one reads."""
import argparse
import hashlib
import json
import random
import re
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

from bench_json import digits, plural
from results_text import markdown, write

ROOT = Path(__file__).resolve().parent.parent
FARTHEST = 2e-3  # m
GRIDS = ("sheet", "strip")
FEWEST = 4  # vertices along a side of a coarse mesh
BAD_SCENE, BROKEN = 2, 1  # exit codes of piecework: wrong input; --strict, or a failed simulation
ENVIRONMENT = ("cpu", "cores", "compiler", "revision")

ABOUT = f"""\
Each scene run several times with jittered starts: sheets triangulated anew, all cloths shifted
sideways by up to {digits(1e3 * FARTHEST)} mm. After every step an independent check counts edges that pass through
triangles and vertices inside of bodies; what stays there counts in every step. `bash ci/jitter.sh`
makes this table."""


@dataclass
class Run:
    """What run.json says of one run; no frames: it did not end."""
    steps: int = 0
    interpenetrations: int = 0  # sum over the steps
    pairs: int = 0  # the most of any step
    converged: int = 0
    iterations: int = 0
    step_ms: float = 0  # sum
    vertices: int = 0
    failure: str = ""


@dataclass
class Scene:
    name: str
    runs: list = field(default_factory=list)
    missing: str = ""  # why it was not run

    def total(self, member):
        return sum(getattr(r, member) for r in self.runs)

    @property
    def sound(self):
        return all(not r.interpenetrations and not r.failure for r in self.runs)


def contact_scenes(folder):
    """Names of the scenes in which something can touch."""
    touching = re.compile(r'"self_collision"\s*:\s*true|"colliders"\s*:')
    return sorted(p.stem for p in folder.glob("*.json") if touching.search(p.read_text()))


def coarse_settings(scene):
    """Meshes that are generated get half as many vertices along each side."""
    settings = []
    for i, cloth in enumerate(scene["cloths"]):
        if cloth["mesh"].get("generator"):
            settings += [f"cloths.{i}.mesh.{key}={max(FEWEST, cloth['mesh'][key] // 2)}"
                         for key in ("columns", "rows")]
    return settings


def jitter_settings(scene, number):
    """Overrides of run `number`, from the resolved scene."""
    random_numbers = random.Random(f"{scene['name']}/{number}")
    shift = [random_numbers.uniform(-FARTHEST, FARTHEST) for _ in range(2)]
    settings = []
    for i, cloth in enumerate(scene["cloths"]):
        x, y, z = cloth["translate"]
        settings.append(f"cloths.{i}.translate=[{x + shift[0]:.6f},{y},{z + shift[1]:.6f}]")
        if cloth["mesh"].get("generator") in GRIDS:
            settings += [f"cloths.{i}.mesh.pattern=delaunay",
                         f"cloths.{i}.mesh.seed={1000 * number + i}"]
    return settings


def read_run(directory):
    record = json.loads((directory / "run.json").read_text())
    run = Run(vertices=record["scene"]["vertices"])
    for frame in record["frames"]:
        counters = frame["counters"]
        run.steps += frame["steps"]
        run.interpenetrations += counters["interpenetrations"]
        run.pairs = max(run.pairs, counters["contact_pairs"])
        run.converged += counters["converged_steps"]
        run.iterations += counters["iterations"]
        run.step_ms += frame["step_ms"] * frame["steps"]
    return run, record


def reason(done):
    """The last line of what a program said; paths as seen from here."""
    lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
    return lines[-1].replace(f"{ROOT}/", "")


def digest(data):
    return hashlib.sha256(data).hexdigest()


class Runner:
    def __init__(self, options):
        self.options = options
        self.environment = {}
        self.program = digest(Path(options.program).read_bytes())

    def command(self, name, directory, settings, extra):
        given = [s.split(":", 1)[1] for s in self.options.set if s.startswith(name + ":")]
        sets = [word for s in settings + given for word in ("--set", s)]
        threads = ["--threads", str(self.options.threads)] if self.options.threads else []
        return [self.options.program, "run", name, "-o", str(directory), "--overwrite", "--no-images",
                "--no-state", *threads, *extra, *sets]

    def resolved(self, name):
        """The scene with every default, or None and why it cannot be run."""
        directory = self.options.work / name / "start"
        done = subprocess.run(self.command(name, directory, [], ["--frames", "0"]),
                              capture_output=True, text=True)
        if done.returncode:
            return None, reason(done)
        return json.loads((directory / "run.json").read_text())["scene"]["resolved"], ""

    def ended(self, directory, command, inputs):
        """How the command ended: now, or when it was run before with the same inputs."""
        memory = directory / "jitter.json"
        made_by = [*inputs, *command[1:]]
        if memory.is_file():
            known = json.loads(memory.read_text())
            if known["made_by"] == made_by:
                return subprocess.CompletedProcess(command, known["exit"], "", known["stderr"])
            memory.unlink()
        done = subprocess.run(command, capture_output=True, text=True)
        if directory.is_dir() and done.returncode >= 0:  # below: killed
            write(memory, json.dumps({"made_by": made_by, "exit": done.returncode,
                                      "stderr": done.stderr}))
        return done

    def run(self, name, scene, number):
        directory = self.options.work / name / f"{number:02}"
        settings = jitter_settings(scene, number)
        settings += coarse_settings(scene) if self.options.coarse else []
        command = self.command(name, directory, settings, ["--strict"])
        done = self.ended(directory, command, [self.program, digest(json.dumps(scene).encode())])
        if done.returncode not in (0, BROKEN):
            return Run(failure=reason(done))
        run, record = read_run(directory)
        self.environment = record["environment"]
        if done.returncode == BROKEN and not run.interpenetrations:
            run.failure = reason(done)
        return run

    def scene(self, name):
        result = Scene(name)
        scene, result.missing = self.resolved(name)
        for number in range(1, self.options.runs + 1) if scene else []:
            result.runs.append(self.run(name, scene, number))
            run = result.runs[-1]
            print(f"{name} {number}/{self.options.runs}: {plural(run.steps, 'step')}, "
                  f"{plural(run.interpenetrations, 'interpenetration')} {run.failure}",
                  file=sys.stderr, flush=True)
        return result


HEAD = ("scene", "vertices", "runs", "steps", "interpenetrations", "runs with any", "pairs, most",
        "converged, %", "its per step", "ms per step")


def row(scene):
    steps = max(1, scene.total("steps"))
    broken = sum(1 for r in scene.runs if r.interpenetrations)
    return [scene.name, str(max(r.vertices for r in scene.runs)), str(len(scene.runs)),
            str(scene.total("steps")), str(scene.total("interpenetrations")), str(broken),
            str(max(r.pairs for r in scene.runs)), digits(100 * scene.total("converged") / steps),
            digits(scene.total("iterations") / steps), digits(scene.total("step_ms") / steps)]


def verdict(scenes):
    """One line: the goal and whether it was reached."""
    ran = [s for s in scenes if s.runs]
    runs, steps = sum(len(s.runs) for s in ran), sum(s.total("steps") for s in ran)
    found = sum(s.total("interpenetrations") for s in ran)
    failed = sum(1 for s in ran for r in s.runs if r.failure)
    ends = f"; {plural(failed, 'run')} did not end" if failed else ""
    word = "reached" if ran and not found and not failed else "**not reached**"
    return (f"Goal: no interpenetration. {plural(found, 'interpenetration')} in {plural(runs, 'run')} of "
            f"{plural(len(ran), 'scene')}, {plural(steps, 'step')}{ends}: {word}.")


def jitter_md(scenes, environment, coarse):
    lines = ["# Jittered runs of the scenes with contact", "",
             ", ".join(f"{k}: {environment[k]}" for k in ENVIRONMENT if k in environment), "", ABOUT, ""]
    lines += ["Meshes of half the resolution (--coarse).", ""] if coarse else []
    lines += [verdict(scenes), ""]
    ran = [s for s in scenes if s.runs]
    lines += markdown(HEAD, [row(s) for s in ran]) if ran else []
    notes = [f"- {s.name} was left out: {s.missing}" for s in scenes if not s.runs]
    notes += [f"- {s.name}, run {i}: {r.failure}" for s in ran for i, r in enumerate(s.runs, 1)
              if r.failure]
    return "\n".join(lines + ([""] + notes if notes else [])) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", help="default: all with contact")
    parser.add_argument("--program", required=True, help="piecework")
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--coarse", action="store_true", help="half as many vertices along each side")
    parser.add_argument("--threads", type=int, help="default: as the scene says, else all")
    parser.add_argument("--set", action="append", default=[], help="SCENE:KEY=VALUE")
    parser.add_argument("--work", type=Path, default=Path("out/jitter"), help="directory for the runs")
    parser.add_argument("--out", type=Path, default=ROOT / "results/tables/jitter.md")
    options = parser.parse_args()
    if not Path(options.program).is_file():
        parser.error(f"{options.program}: no such program; bash ci/jitter.sh builds one")
    runner = Runner(options)
    scenes = [runner.scene(name) for name in options.scenes or contact_scenes(ROOT / "scenes")]
    write(options.out, jitter_md(scenes, runner.environment, options.coarse))
    print(options.out)
    return 0 if all(s.sound for s in scenes) else 1


if __name__ == "__main__":
    sys.exit(main())
