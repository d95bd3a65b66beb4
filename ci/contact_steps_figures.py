"""The figures of ci/contact_steps_tables, as self-contained SVG: step time against active pairs, and a
sheet on a slope."""
import math
from dataclasses import dataclass

from bench_json import digits, groups
from convergence_figures import LogAxis, circle, draw_axes, padded, polyline, text_width
from svg import document, line, nice, origin, text

WIDTH, HEIGHT = 1200, 560
LEFT, RIGHT, TOP, BOTTOM, GAP = 74, 24, 112, 66, 74
# Hues that colour-blind people tell apart [Okabe, Ito].
COLOURS = ("#D55E00", "#0072B2", "#00795A", "#A0527F", "#E69F00", "#56B4E9", "#222222")
STICKS = math.tan(math.radians(20))  # kSlope in benchmarks/contact_scenes.hpp
SOLIDS = {"plane": "#D55E00", "mesh": "#0072B2"}


@dataclass
class LinearAxis:
    """Values from 0 to pixels, as convergence_figures.LogAxis."""
    high: float
    start: float
    end: float

    def __call__(self, value):
        return self.start + value / self.high * (self.end - self.start)

    def ticks(self):
        step = nice(self.high / 8, up=True)
        return [step * i for i in range(math.floor(self.high / step * 1.0001) + 1)]

    def label(self, value):
        return f"{value:.6g}"


def columns(parts=2):
    """Left and right edges of panels side by side."""
    width = (WIDTH - LEFT - RIGHT - GAP * (parts - 1)) / parts
    return [(LEFT + i * (width + GAP), LEFT + i * (width + GAP) + width) for i in range(parts)]


def legend(entries):
    """entries: (words, colour), from left to right, in a second line where the first is full."""
    out, x, y = [], LEFT, 56
    for words, colour in entries:
        width = 20 + text_width(words, 12) + 18
        if x + width > WIDTH - RIGHT:
            x, y = LEFT, y + 20
        out += [circle(x + 6, y - 4, colour), text(x + 16, y, words, 12, "start")]
        x += width
    return out


def whole(heading, context, below, parts):
    return document(WIDTH, HEIGHT, [
        text(LEFT, 30, heading, 18, "start", ' font-weight="bold"'),
        text(WIDTH - RIGHT, 30, origin(context), 11, "end", ' fill="#555"'), *parts,
        text(WIDTH - RIGHT, HEIGHT - 8, below, 11, "end", ' fill="#555"')])


def fit(points):
    """(exponent, factor) of the power law through points, least squares of logarithms; None: the
    points show none."""
    logs = [(math.log(x), math.log(y)) for x, y in points]
    n, sx, sy = len(logs), sum(x for x, _ in logs), sum(y for _, y in logs)
    sxx, sxy = sum(x * x for x, _ in logs), sum(x * y for x, y in logs)
    spread = n * sxx - sx * sx
    if n < 3 or spread <= 1e-9 * n * sxx:
        return None
    exponent = (n * sxy - sx * sy) / spread
    return exponent, math.exp((sy - exponent * sx) / n)


def runs_of(raw):
    """Of each scene and size the run at the default tolerance on the most threads; points are
    dicts."""
    usual = [r for r in raw["runs"] if float(r["tolerance"]) == 0.01]
    for of_scene in groups(usual, lambda r: (r["scene"], r["n"])).values():
        run = max(of_scene, key=lambda r: r["threads"])
        yield run, [dict(zip(raw["columns"], p)) for p in run["points"]]


def time_curves(raw, per_iteration):
    """run name -> (pairs, ms) of its steps in contact."""
    curves = {}
    for run, points in runs_of(raw):
        words = f"{run['scene']}, {run['n']} vertices, {run['threads']} threads"
        curves[words] = [
            (p["pairs"], p["step_ms"] / (p["iterations"] if per_iteration else 1))
            for p in points if p["pairs"] > 0 and p["iterations"] > 0 and p["step_ms"] > 0]
    return {words: points for words, points in curves.items() if points}


def time_panel(curves, edges, heading, colours):
    points = [p for of_run in curves.values() for p in of_run]
    x_axis = LogAxis(*padded([x for x, _ in points], 1.15), *edges)
    y_axis = LogAxis(*padded([y for _, y in points], 1.15), HEIGHT - BOTTOM, TOP)
    out = [text(edges[0], TOP - 10, heading, 13, "start", ' font-weight="bold"')]
    out += draw_axes(x_axis, y_axis, "active pairs")
    at = TOP + 16
    for words, of_run in curves.items():
        colour = colours[words]
        out += [circle(x_axis(x), y_axis(y), colour, fill="none", radius=2.6) for x, y in of_run]
        law = fit(of_run)
        if not law:
            continue
        ends = [min(x for x, _ in of_run), max(x for x, _ in of_run)]
        out.append(polyline([(x_axis(x), y_axis(law[1] * x ** law[0])) for x in ends],
                            f'stroke="{colour}" stroke-width="2"'))
        out.append(text(edges[0] + 10, at, f"pairs^{digits(law[0])}", 12, "start",
                        f' fill="{colour}"'))
        at += 16
    return out


def fig11(raw, context):
    """Time of a step, and of one iteration, against the pairs in contact at its end."""
    step, iteration = time_curves(raw, False), time_curves(raw, True)
    colours = {words: COLOURS[i % len(COLOURS)] for i, words in enumerate(step)}
    left, right = columns()
    parts = legend(list(colours.items()))
    if step:
        parts += time_panel(step, left, "time of a step, ms", colours)
        parts += time_panel(iteration, right, "time of one iteration, ms", colours)
    return whole("Step time against active pairs", context,
                 "our analogue of the paper's Fig. 11; a dot per step, lines: power laws", parts)


def slope_panel(rows, edges, heading, counter, highest):
    """A quantity against friction, a mark per solid."""
    top = max(highest, *(r.get(counter) for r in rows))
    x_axis = LinearAxis(1.08 * max(r.number("mu") for r in rows) or 1, *edges)
    y_axis = LinearAxis(1.1 * top or 1, HEIGHT - BOTTOM, TOP)
    out = [text(edges[0], TOP - 10, heading, 13, "start", ' font-weight="bold"')]
    out += draw_axes(x_axis, y_axis, "coefficient of friction")
    marks = []
    for row in rows:
        solid = row.names["solid"]
        radius = 7 if solid == "mesh" else 4
        marks.append(circle(x_axis(row.number("mu")), y_axis(row.get(counter)), SOLIDS[solid],
                            fill="none", radius=radius))
    return x_axis, y_axis, out, marks


def law(rows):
    """(mu, mm) of Coulomb's law, with its kink where cloth begins to stick."""
    points = {(r.number("mu"), r.get("expected_mm")) for r in rows}
    sliding, sticking = ([p for p in points if (p[0] < STICKS) == slides] for slides in (True, False))
    return sorted(sliding + sticking + ([(STICKS, 0)] if sliding and sticking else []))


def fig14(rows, context):
    """How far a sheet slides, with what Coulomb's law says, and the iterations of its steps."""
    left, right = columns()
    x_axis, y_axis, parts, marks = slope_panel(
        rows, left, "way in 30 steps, mm; line: Coulomb's law", "slid_mm",
        max(r.get("expected_mm") for r in rows))
    parts.append(polyline([(x_axis(mu), y_axis(mm)) for mu, mm in law(rows)],
                          'stroke="#222" stroke-width="1.5"'))
    if STICKS < x_axis.high:
        at = x_axis(STICKS)
        parts.append(line(at, y_axis.start, at, y_axis.end, 'stroke="#888" stroke-dasharray="4 4"'))
        parts.append(text(at + 6, TOP + 14, "sticks", 12, "start"))
    _, _, other, other_marks = slope_panel(rows, right, "iterations per step, mean",
                                           "iterations_mean", 0)
    names = {"plane": "half-space", "mesh": "mesh"}
    entries = [(names[s], SOLIDS[s]) for s in SOLIDS if any(r.names["solid"] == s for r in rows)]
    return whole("A sheet on a slope of 20°", context, "our analogue of the paper's Fig. 14",
                 legend(entries) + parts + marks + other + other_marks)
