"""The figure of ci/contact_tables: residual and true error of the contact system against time, as
self-contained SVG."""
from bench_json import groups
from convergence_figures import (LogAxis, clipped, draw_axes, padded, polyline, stairs, text_width)
from svg import document, line, origin, text

WIDTH, HEIGHT = 1200, 600
LEFT, RIGHT, TOP, BOTTOM, GAP = 74, 24, 116, 66, 66
PREFERRED_SIZE, PREFERRED_RATIO, PREFERRED_SET = 90000, 1000, "disk"
FLOOR = 1e-7

# In the order of tables. Hues that colour-blind people tell apart [Okabe, Ito]; the paper's are
# dashed.
SOLVERS = {
    "refactor": ("refactored, 32 bits", "#D55E00", ""),
    "refactor_f64": ("refactored, 64 bits", "#E69F00", ""),
    "pcg_last_factor_2": ("last factor, 2 % changed", "#00795A", ""),
    "pcg_last_factor_10": ("last factor, 10 %", "#00795A", "8 4"),
    "pcg_last_factor_30": ("last factor, 30 %", "#00795A", "2 3"),
    "pcg_last_factor": ("last factor", "#00795A", ""),
    "low_rank": ("Woodbury", "#7A7A2A", ""),
    "frozen_schur": ("frozen Schur complement", "#0072B2", ""),
    "hybrid": ("hybrid", "#56B4E9", ""),
    "dual": ("dual, lumped", "#999999", ""),
    "woodbury_sd_pcg": ("the paper's start, K⁻¹-CG", "#A0527F", "8 4"),
    "woodbury_sd5_pcg": ("five steps recomputed, K⁻¹-CG", "#C98BB0", "3 3"),
    "kinv_pcg": ("K⁻¹-CG", "#222222", ""),
    "jacobi_pcg": ("Jacobi-CG", "#7A7A2A", "8 3 2 3"),
}


def stroke(solver):
    _, colour, dashes = SOLVERS[solver]
    dash = f' stroke-dasharray="{dashes}"' if dashes else ""
    return f'stroke="{colour}" stroke-width="{3.2 if solver == "refactor" else 1.9}"{dash}'


def chosen(traces):
    """Those of one problem: the preferred one where it was measured."""
    def rank(key):
        n, name, ratio, threads = key
        return (n != PREFERRED_SIZE, -n, name != PREFERRED_SET, ratio != PREFERRED_RATIO, -threads)
    by_problem = groups(traces, lambda t: (t["n"], t["set"], t["ratio"], t["threads"]))
    return by_problem[min(by_problem, key=rank)]


def curve(trace, columns, vertical):
    """(ms, value) where both can stand on a logarithmic axis, from the first to the floor."""
    x, y = columns.index("ms"), columns.index(vertical)
    points = [(p[x], p[y]) for p in trace["points"]
              if p[x] and p[x] > 0 and p[y] is not None and p[y] > 0]
    return clipped(points, FLOOR)


def legend(solvers):
    out, x, y = [], LEFT, 54
    for solver in solvers:
        words = SOLVERS[solver][0]
        width = 32 + text_width(words, 12) + 14
        if x + width > WIDTH - RIGHT:
            x, y = LEFT, y + 19
        out += [line(x, y - 4, x + 26, y - 4, stroke(solver)), text(x + 32, y, words, 12, "start")]
        x += width
    return out


def panel(curves, left, right, heading):
    """One diagram; curves: solver -> points."""
    drawn = {s: c for s, c in curves.items() if c}
    x_axis = LogAxis(*padded([x for c in drawn.values() for x, _ in c], 1.15), left, right)
    highest = max(y for c in drawn.values() for _, y in c)
    y_axis = LogAxis(FLOOR, 1.5 * highest, HEIGHT - BOTTOM, TOP)
    out = [text(left, TOP - 8, heading, 13, "start", ' font-weight="bold"')]
    out += draw_axes(x_axis, y_axis, "time since the contact set changed, ms")
    for solver, points in drawn.items():
        out.append(polyline(stairs([(x_axis(x), y_axis(y)) for x, y in points]), stroke(solver)))
    return out


def figure(raw, context):
    traces = [t for t in chosen(raw["traces"]) if t["solver"] in SOLVERS]
    first = traces[0]
    middle = (LEFT + WIDTH - RIGHT) / 2
    edges = ((LEFT, middle - GAP / 2), (middle + GAP / 2, WIDTH - RIGHT))
    kinds = (("residual", "what a residual says: ‖b - (K + D) x‖ / ‖b‖"),
             ("true_error", "true error: max |x - x*| / max |x*|"))
    parts = legend([s for s in SOLVERS if any(t["solver"] == s for t in traces)])
    for (vertical, heading), (left, right) in zip(kinds, edges):
        parts += panel({t["solver"]: curve(t, raw["columns"], vertical) for t in traces}, left, right,
                       heading)
    title = (f"Contact system: {first['n']} vertices, {first['set']}, w_k = {first['ratio']:g} k_s, "
             f"{first['threads']} threads")
    return document(WIDTH, HEIGHT, [
        text(LEFT, 30, title, 18, "start", ' font-weight="bold"'),
        text(WIDTH - RIGHT, 30, origin(context), 11, "end", ' fill="#555"'), *parts,
        text(WIDTH - RIGHT, HEIGHT - 10, "our analogue of the paper's Fig. 8; a quarter of the "
             "vertices in contact", 11, "end", ' fill="#555"')])
