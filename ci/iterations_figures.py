"""The figures of ci/iterations_tables: energy error against iterations and time, as self-contained
SVG."""
from bench_json import groups
from convergence_figures import LogAxis, clipped, draw_axes, drawable, padded, polyline, text_width
from svg import document, line, origin, text

WIDTH, PANEL_HEIGHT = 1200, 330
LEFT, RIGHT, TOP, BOTTOM, GAP_X, GAP_Y = 74, 24, 100, 66, 58, 74

# Hues that colour-blind people tell apart [Okabe, Ito]; what the paper proposes is solid.
STYLES = {
    "jacobi": ("Jacobi (vanilla PD)", "#222222", ""),
    "gauss_seidel": ("Gauss-Seidel, corrected", "#D55E00", ""),
    "gauss_seidel_fixed": ("the same, fixed order", "#E69F00", "6 4"),
    "gauss_seidel_one_domain": ("the same, one domain", "#56B4E9", ""),
    "literal_eq12": ("Eq. 12 as printed", "#A0527F", ""),
    "literal_eq12_fixed": ("the same, fixed order ", "#C98BB0", "6 4"),
    "jacobi_anderson": ("Jacobi + Anderson", "#0072B2", "3 3"),
    "gauss_seidel_anderson": ("Gauss-Seidel + Anderson", "#00795A", "3 3"),
    "pd_jacobi": ("PD-Jacobi, Chebyshev", "#0072B2", ""),
    "vanilla_pd": ("vanilla PD, CHOLMOD", "#222222", ""),
    "default": ("our default", "#00795A", ""),
}
FLOORS = {"fig12": 5e-7, "fig13": 5e-5}
CEILING = 30  # energy errors above say only that a method is wrong
HEADINGS = {"fig12": "Local step: energy error of one step (cotton, 64 domains, h = 1/120 s)",
            "fig13": "Against PD-Jacobi: energy error of one step (cotton)"}


def read_traces(raw):
    """Traces as dicts, points as dicts; what is not finite is left out."""
    traces = []
    for trace in raw["traces"]:
        points = [{k: v for k, v in zip(raw["columns"], p) if v is not None}
                  for p in trace["points"]]
        traces.append({**trace, "points": points})
    return traces


def stroke(method):
    _, colour, dashes = STYLES[method]
    dash = f' stroke-dasharray="{dashes}"' if dashes else ""
    width = 3.2 if method in ("gauss_seidel", "default") else 1.9
    return f'stroke="{colour}" stroke-width="{width}"{dash}'


def legend(methods):
    out, x, y = [], LEFT, 52
    for method in methods:
        words = STYLES[method][0].strip()
        width = 32 + text_width(words, 12) + 14
        if x + width > WIDTH - RIGHT:
            x, y = LEFT, y + 19
        out += [line(x, y - 4, x + 26, y - 4, stroke(method)), text(x + 32, y, words, 12, "start")]
        x += width
    return out


def panel(traces, horizontal, edges, heights, floor, words, heading):
    """One diagram: edges are its left and right, heights its bottom and top."""
    curves = {t["method"]: clipped([(h, min(v, CEILING)) for h, v in
                                    drawable(t["points"], horizontal, "energy_error") if v > 0], floor)
              for t in traces if t["method"] in STYLES}
    curves = {m: c for m, c in curves.items() if c}
    if not curves:
        return []
    highest = max(v for c in curves.values() for _, v in c)
    x_axis = LogAxis(*padded([h for c in curves.values() for h, _ in c], 1.1), *edges)
    y_axis = LogAxis(floor, 1.3 * highest, *heights)
    out = [text(edges[0], heights[1] - 8, heading, 13, "start", ' font-weight="bold"')]
    out += draw_axes(x_axis, y_axis, words)
    for method in STYLES:
        if method in curves:
            places = [(x_axis(h), y_axis(v)) for h, v in curves[method]]
            out.append(polyline(places, stroke(method)))
    return out


def figure(name, traces, context):
    """A row of panels per size, against iterations; for fig13 a second one against time."""
    sizes = groups(sorted(traces, key=lambda t: (t["n"], -round(1 / t["h"]))), lambda t: t["n"])
    kinds = [("iteration", "iterations"), ("ms", "time, ms")]
    parts, row = [], 0
    for n, of_size in sizes.items():
        rates = groups(of_size, lambda t: round(1 / t["h"]))
        rows = [[(h, k) for k in kinds for h in rates]] if len(rates) == 1 else [
            [(h, k) for h in rates] for k in kinds]
        for cells in rows:
            width = (WIDTH - LEFT - RIGHT - GAP_X * (len(cells) - 1)) / len(cells)
            top = TOP + row * (PANEL_HEIGHT + GAP_Y)
            for i, (rate, (horizontal, words)) in enumerate(cells):
                left = LEFT + i * (width + GAP_X)
                parts += panel(rates[rate], horizontal, (left, left + width),
                               (top + PANEL_HEIGHT, top + 22), FLOORS[name], words,
                               f"{n} vertices, h = 1/{rate} s")
            row += 1
    height = TOP + row * (PANEL_HEIGHT + GAP_Y) - GAP_Y + BOTTOM
    shown = [m for m in STYLES if any(t["method"] == m for t in traces)]
    return document(WIDTH, height, [
        text(LEFT, 28, HEADINGS[name], 17, "start", ' font-weight="bold"'),
        *legend(shown), *parts,
        text(LEFT, height - 8, "vertical: (E - E*) / (E(z) - E*)", 11, "start", ' fill="#555"'),
        text(WIDTH - RIGHT, height - 8, origin(context), 11, "end", ' fill="#555"')])


def figures(raw, context):
    """name -> SVG of every figure for which there are traces."""
    return {f"{name}.svg": figure(name, traces, context)
            for name, traces in groups(read_traces(raw), lambda t: t["family"]).items()
            if name in HEADINGS}
