"""The figures of ci/convergence_tables, as self-contained SVG: error-versus-time fronts, iterations
against the number of vertices, and the gradient beside Newton's method."""
import math
from dataclasses import dataclass

from bench_json import groups
from convergence_rows import CLOTHS, OURS, place
from svg import box, document, line, origin, text

WIDTH, HEIGHT = 1200, 600
LEFT, RIGHT, TOP, BOTTOM, GAP = 74, 24, 106, 72, 62  # margins around all panels, and between them
SECOND_LINE = 74  # height of the legend

# Hues that colour-blind people tell apart [Okabe, Ito]; ours is the widest line, Newton's are
# dashed.
STYLES = {
    "default": ("default (L-BFGS, K⁻¹ + N Kn⁻¹ Nᵀ)", "#D55E00", ""),
    "lbfgs": ("L-BFGS, K⁻¹", "#E69F00", ""),
    "anderson": ("Anderson", "#00795A", ""),
    "chebyshev": ("Chebyshev", "#56B4E9", ""),
    "pd_tree": ("PD, tree", "#0072B2", ""),
    "vanilla_pd": ("PD, CHOLMOD", "#222222", ""),
    "newton": ("Newton, CHOLMOD", "#A0527F", "8 4"),
    "newton_pcg": ("Newton, PCG", "#C98BB0", "3 3"),
    "pd_jacobi": ("PD-Jacobi, Chebyshev", "#7A7A2A", "8 3 2 3"),
    "xpbd": ("XPBD", "#999999", "2 3"),
}
OTHER_STYLE = ("", "#B8B8B8", "")
PAPER_DX = 1e-3  # ||dx||_2 in the unit box, the paper's stop
FLOOR = 5e-7  # energy error at which a run ends
NARROW, WIDE = 1.8, 3.4
SHORTEST_STAIR = 5  # pixels: shorter ones are not seen, and thinned traces would make up some
ITERATIONS_LEVEL = "1e-4"
IN_GROWTH = ("default", "anderson", "pd_tree")
RAISED = "⁻⁰¹²³⁴⁵⁶⁷⁸⁹ᵀ"
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass
class LogAxis:
    """Values to pixels; `low` lies at `start`, `high` at `end`."""
    low: float
    high: float
    start: float
    end: float
    given: tuple = ()  # ticks

    def __call__(self, value):
        inside = min(max(value, self.low), self.high)
        part = math.log(inside / self.low) / math.log(self.high / self.low)
        return self.start + part * (self.end - self.start)

    def ticks(self):
        """Decades; with 2 and 5 between them where there are few. Or what the axis was given."""
        if self.given:
            return list(self.given)
        first, last = math.floor(math.log10(self.low)), math.ceil(math.log10(self.high))
        few = self.high < 2000 * self.low
        steps = (1, 2, 5) if few else (1,)
        values = [m * 10.0 ** e for e in range(first, last + 1) for m in steps]
        return [v for v in values if 0.999 * self.low <= v <= 1.001 * self.high]

    def label(self, value):
        """Powers of ten where the axis is long, plain numbers where it is not."""
        if self.high >= 2000 * self.low and (self.low < 1e-2 or self.high > 1e5):
            return "10" + str(round(math.log10(value))).translate(SUPERSCRIPTS)
        return f"{int(value):,}".replace(",", "\u202f") if value >= 1e4 else f"{value:.6g}"


def label_of(method):
    return STYLES.get(method, OTHER_STYLE)[0] or method


def stroke(method):
    _, colour, dashes = STYLES.get(method, OTHER_STYLE)
    dash = f' stroke-dasharray="{dashes}"' if dashes else ""
    width = WIDE if method == OURS else NARROW
    return f'stroke="{colour}" stroke-width="{width}"{dash}'


def polyline(points, style):
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke-linejoin="round" {style}/>'


def diamond(x, y, colour, size=6.5):
    corners = ((x, y - size), (x + size, y), (x, y + size), (x - size, y))
    path = " ".join(f"{a:.1f},{b:.1f}" for a, b in corners)
    return f'<polygon points="{path}" fill="{colour}" stroke="#000" stroke-width="1.2"/>'


def circle(x, y, colour, fill=None, radius=4):
    return (f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{fill or colour}" '
            f'stroke="{colour}" stroke-width="1.8"/>')


def padded(values, factor):
    """Range of a logarithmic axis around values, at least a factor of two wide."""
    low, high = min(values), max(values)
    if high < 2 * low:
        low, high = low / 1.5, high * 1.5
    return low / factor, high * factor


def paper_stop(trace):
    """The first point that meets the paper's rule, or None."""
    return next((p for p in trace.points if p["iteration"] > 0
                 and p.get("dx_2", math.inf) <= PAPER_DX), None)


def drawable(points, horizontal, vertical):
    """(h, v) of points that a logarithmic diagram can show."""
    return [(p[horizontal], p[vertical]) for p in points
            if p.get(horizontal, 0) > 0 and p.get(vertical) is not None]


def draw_axes(x_axis, y_axis, words):
    """Grid, numbers and words of both axes."""
    out = []
    for tick in y_axis.ticks():
        level = y_axis(tick)
        out.append(line(x_axis.start, level, x_axis.end, level, 'stroke="#DDD"'))
        out.append(text(x_axis.start - 7, level + 4, y_axis.label(tick), 12, "end"))
    for tick in x_axis.ticks():
        at = x_axis(tick)
        out.append(line(at, y_axis.start, at, y_axis.end, 'stroke="#EEE"'))
        out.append(text(at, y_axis.start + 17, x_axis.label(tick), 12))
    out.append(line(x_axis.start, y_axis.start, x_axis.end, y_axis.start, 'stroke="#333"'))
    out.append(line(x_axis.start, y_axis.start, x_axis.start, y_axis.end, 'stroke="#333"'))
    out.append(text((x_axis.start + x_axis.end) / 2, y_axis.start + 39, words, 14))
    return out


def drawing_order(traces):
    """Ours last: on top."""
    return sorted(traces, key=lambda t: t.method == OURS)


def clipped(points, floor):
    """Points down to the first one below the floor."""
    result = []
    for h, v in points:
        result.append((h, v))
        if v <= floor:
            break
    return result


def stairs(points):
    """An error is reached when its iteration ends; until then the last one holds."""
    result = points[:1]
    for (start, before), (x, y) in zip(points, points[1:]):
        result += [(x, before)] if x - start > SHORTEST_STAIR else []
        result.append((x, y))
    return result


def draw_curves(traces, horizontal, vertical, x_axis, y_axis):
    """Curves, then the paper's stops over all of them."""
    out, marks = [], []
    for trace in drawing_order(traces):
        points = clipped(drawable(trace.points, horizontal, vertical), y_axis.low)
        places = [(x_axis(h), y_axis(v)) for h, v in points]
        out.append(polyline(stairs(places) if horizontal == "ms" else places,
                            stroke(trace.method)))
        stop = paper_stop(trace)
        if stop and stop.get(vertical, 0) >= y_axis.low and stop.get(horizontal, 0) > 0:
            colour = STYLES.get(trace.method, OTHER_STYLE)[1]
            marks.append(diamond(x_axis(stop[horizontal]), y_axis(stop[vertical]), colour))
    return out + marks


def text_width(words, size):
    """Roughly, of a sans-serif font."""
    widths = (0.36 if letter in RAISED else 0.75 if letter.isupper() else 0.56 for letter in words)
    return size * sum(widths)


def legend(methods, with_stop):
    """Entries from left to right, in a second line where the first is full."""
    out, x, y = [], LEFT, 54
    entries = [(label_of(m), m) for m in methods] + ([("the paper's stop, ‖Δx‖₂ ≤ 10⁻³", None)]
                                                      if with_stop else [])
    for words, method in entries:
        if x + 34 + text_width(words, 12) > WIDTH - RIGHT:
            x, y = LEFT, SECOND_LINE
        if method:
            out.append(line(x, y - 4, x + 26, y - 4, stroke(method)))
        else:
            out.append(diamond(x + 13, y - 4, "#FFF"))
        extra = ' font-weight="bold"' if method == OURS else ""
        out.append(text(x + 32, y, words, 12, "start", extra))
        x += 32 + text_width(words, 12) * (1.12 if extra else 1) + 10
    return out


def frame(heading, context, vertical_words, parts, below):
    """A whole figure around its panels."""
    middle = (TOP + HEIGHT - BOTTOM) / 2
    return document(WIDTH, HEIGHT, [
        text(LEFT, 30, heading, 18, "start", ' font-weight="bold"'),
        text(WIDTH - RIGHT, 30, origin(context), 11, "end", ' fill="#555"'), *parts,
        text(22, middle, vertical_words, 14, "middle", f' transform="rotate(-90 22 {middle:.1f})"'),
        text(WIDTH - RIGHT, HEIGHT - 10, below, 11, "end", ' fill="#555"')])


def panel_edges(count):
    """Left and right end of each panel."""
    width = (WIDTH - LEFT - RIGHT - GAP * (count - 1)) / count
    return [(LEFT + i * (width + GAP), LEFT + i * (width + GAP) + width) for i in range(count)]


def curves(traces, vertical, floor):
    """Two panels: against time and against iterations, over the same vertical axis."""
    values = [v for t in traces for _, v in drawable(t.points, "ms", vertical) if v > floor]
    if not values:
        return None
    y_axis = LogAxis(floor, 1.3 * max(values), HEIGHT - BOTTOM, TOP)
    out = []
    for horizontal, words, (left, right) in zip(("ms", "iteration"), ("time, ms", "iterations"),
                                                panel_edges(2)):
        across = [h for t in traces
                  for h, _ in clipped(drawable(t.points, horizontal, vertical), floor)]
        low, high = padded(across, 1.15)
        x_axis = LogAxis(low, high, left, right)
        out += draw_axes(x_axis, y_axis, words)
        out += draw_curves(traces, horizontal, vertical, x_axis, y_axis)
    methods = [t.method for t in sorted(traces, key=lambda t: place(t.method, list(STYLES)))]
    return legend(methods, any(paper_stop(t) for t in traces)) + out


def note(words, rows):
    """What stands below a figure; a warning where other work made times long."""
    disturbed = sum(r.disturbed for r in rows)
    return words + (f"; {disturbed} of {len(rows)} methods disturbed: times provisional"
                    if disturbed else "")


def front(rows, traces, context):
    """Energy error against time and iterations."""
    _, cloth, n = traces[0].problem
    parts = curves(traces, "energy_error", FLOOR)
    below = note("error against the exact minimum; runs end at 5·10⁻⁷ or after 20 s", rows)
    return parts and frame(f"Error of one step: {cloth}, {n} vertices", context,
                           "relative energy error", parts, below)


def gradient_figure(rows, traces, context):
    """Our analogue of the paper's Fig. 21, as deep as the methods get."""
    least = min((v for t in traces for _, v in drawable(t.points, "ms", "gradient") if v > 0),
                default=None)
    if least is None:
        return None
    _, cloth, n = traces[0].problem
    below = note("our analogue of the paper's Fig. 21; runs end at a gradient of 10⁻⁵ or after 20 s",
                 rows)
    return frame(f"Gradient of one step, h = 1/60 s: {cloth}, {n} vertices", context,
                 "gradient: rms residual / mean nodal weight",
                 curves(traces, "gradient", 0.7 * least), below)


def growth_points(rows, traces, method):
    """[(n, iterations, reached)]: where the level was not reached, how far the run got without."""
    last = {(t.cloth, t.n): t.points[-1]["iteration"] for t in traces
            if t.method == method and t.points}
    result = []
    for row in sorted((r for r in rows if r.method == method and r.ok), key=lambda r: r.n):
        count = row.counters.get(f"iterations_{ITERATIONS_LEVEL}")
        if count is not None:
            result.append((row.n, max(count, 1), True))
        elif (row.cloth, row.n) in last:
            result.append((row.n, last[row.cloth, row.n], False))
    return result


def draw_growth(method, points, x_axis, y_axis):
    """A line with circles; open ones where the level lies beyond, with an arrow up."""
    colour = STYLES[method][1]
    places = [(x_axis(n), y_axis(count)) for n, count, _ in points]
    out = [polyline(places, stroke(method))]
    for (x, y), (_, count, reached) in zip(places, points):
        out.append(circle(x, y, colour, None if reached else "#FFF"))
        words = f"{count:.0f}" if reached else f"> {count:.0f}"
        out.append(text(x, y - 10, words, 11, "middle", f' fill="{colour}"'))
    return out


def growth(rows, traces, context):
    """Iterations against the number of vertices, a panel for each cloth."""
    cloths = sorted({r.cloth for r in rows}, key=lambda c: (place(c, CLOTHS), c))
    lines = {(c, m): growth_points([r for r in rows if r.cloth == c],
                                   [t for t in traces if t.cloth == c], m)
             for c in cloths for m in IN_GROWTH}
    drawn = [p for points in lines.values() for p in points]
    if not drawn:
        return None
    y_low, y_high = padded([count for _, count, _ in drawn], 1.6)
    y_axis = LogAxis(max(1, y_low), y_high, HEIGHT - BOTTOM, TOP + 14)
    sizes = tuple(sorted({n for n, _, _ in drawn}))
    x_range = padded(sizes, 1.5)
    out = legend([m for m in STYLES if any(lines[c, m] for c in cloths if (c, m) in lines)], False)
    for cloth, (left, right) in zip(cloths, panel_edges(len(cloths))):
        x_axis = LogAxis(*x_range, left, right, sizes)
        out.append(text(left, TOP + 2, cloth, 14, "start", ' font-weight="bold"'))
        out += draw_axes(x_axis, y_axis, "vertices")
        for method in IN_GROWTH:
            out += draw_growth(method, lines[cloth, method], x_axis, y_axis)
    return frame(f"Iterations to an energy error of {ITERATIONS_LEVEL}", context, "iterations", out,
                 "open circles: not reached within 20 s")


def figures(traces, rows, context):
    """name -> SVG of every figure for which there is something to draw."""
    result = {}
    for problem, of_problem in groups(traces, lambda t: t.problem).items():
        family, cloth, n = problem
        its_rows = [r for r in rows if r.ok and r.problem == problem]
        if family == "fig21":
            result["fig21.svg"] = gradient_figure(its_rows, of_problem, context)
        else:
            result[f"front_{cloth}_{n}.svg"] = front(its_rows, of_problem, context)
    ordinary = [r for r in rows if r.family == "convergence"]
    result["iterations_vs_n.svg"] = growth(
        ordinary, [t for t in traces if t.family == "convergence"], context)
    return {name: svg for name, svg in result.items() if svg}
