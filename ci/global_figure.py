"""The figure of ci/global_tables: stacked bars as in the paper's Fig. 9, as self-contained SVG."""
import math
import statistics
from dataclasses import dataclass, field

from bench_json import groups, plural
from svg import box, document, line, nice, origin, text

WIDTH, HEIGHT = 1200, 700
LEFT, RIGHT, TOP, BOTTOM = 74, 14, 76, 66  # margins around all panels
GAP_X, GAP_Y, TITLE = 52, 26, 20  # between panels; of a panel's title
LOG_FROM = 12  # with a larger range within one size, small bars could not be read on a linear axis

# Hues that colour-blind people tell apart [Okabe, Ito], dark for the domains, light for the rest:
# the parts differ in lightness too, so that the figure survives a grey printer.
METHODS = {
    "literal_primal_dual": ("literal primal-dual", "#D55E00", "#F5BF94"),
    "primal_dual": ("primal-dual", "#0072B2", "#9CCBEA"),
    "tree_f64": ("tree, 64 bits", "#00795A", "#8ED8BF"),
    "tree_f32": ("tree, 32 bits", "#A0527F", "#E5B3CF"),
}
PARTS = (("domains_ms", "interface_ms"), ("subtrees_ms", "top_ms"))
OTHER = "#B8B8B8"


@dataclass
class Bar:
    method: str
    domains: int
    total: float  # ms
    parts: list = field(default_factory=list)  # (ms, colour), from below
    mark: str = ""  # above the bar: † disturbed, × no valid result


@dataclass
class Scale:
    """Times to heights above the axis, in pixels."""
    low: float
    high: float
    height: float
    log: bool

    def __call__(self, ms):
        if not self.log:
            return self.height * ms / self.high
        return self.height * max(0.0, math.log(max(ms, self.low) / self.low)
                                 / math.log(self.high / self.low))


def bar_of(row):
    """Parts of a row's time; one colour where the row does not know them."""
    if not row.ok:
        return Bar(row.method, row.domains, 0, [], "×")
    _, dark, light = METHODS[row.method]
    total = row.ms.median
    bar = Bar(row.method, row.domains, total, [(total, dark)], "†" if row.disturbed else "")
    for inner, outer in PARTS:
        if inner in row.counters and outer in row.counters:
            bar.parts = [(row.counters[inner], dark), (row.counters[outer], light)]
            rest = total - sum(ms for ms, _ in bar.parts)
            if rest > 0:
                bar.parts.append((rest, OTHER))
    return bar


def bars_of(rows):
    """Bars by D, in the order of METHODS."""
    bars = [bar_of(r) for r in rows if r.status != "skipped" and r.method in METHODS]
    order = list(METHODS)
    return groups(sorted(bars, key=lambda b: (b.domains, order.index(b.method))),
                  lambda b: b.domains)


def shown_threads(rows):
    """One row of panels for one thread, one for the most threads with a result."""
    threads = [r.threads for r in rows if r.ok and r.method in METHODS]
    return sorted({min(threads), max(threads)}) if threads else []


def ticks(scale):
    if not scale.log:
        step = nice(scale.high / 6, up=True)
        return [i * step for i in range(1 + math.floor(scale.high / step * 1.0001))]
    values, value = [], nice(scale.low, up=True)
    while value <= scale.high * 1.0001:
        values.append(value)
        value = nice(value * 1.5, up=True)
    return values


def is_log(columns):
    """Whether the bars of one size differ too much for a linear axis."""
    for rows in columns.values():
        totals = [r.ms.median for r in rows if r.ok and r.method in METHODS]
        if totals and max(totals) > LOG_FROM * min(totals):
            return True
    return False


def scale_of(rows, cholmod, height, log):
    """One scale per size, so that the panels of its thread counts can be compared."""
    times = [r.ms.median for r in rows if r.ok and r.method in METHODS]
    times += [cholmod] if cholmod else []
    if log:
        # Half of the smallest, for its bar to have a height.
        return Scale(nice(min(times) / 2, up=False), 1.15 * max(times), height, True)
    return Scale(0, 1.08 * max(times), height, False)


def draw_bar(bar, x, base, width, scale):
    """Every boundary lies at its time on the axis, whatever the scale."""
    out, below = [], 0.0
    for ms, colour in bar.parts:
        bottom, top = scale(below), scale(below + ms)
        out.append(box(x, base - top, width, top - bottom, colour))
        below += ms
    if bar.mark:
        out.append(text(x + width / 2, base - scale(below) - 3, bar.mark, 10))
    return out


def draw_axes(x, y, width, scale):
    """Grid, numbers of the time axis, and the two axes."""
    out = []
    for tick in ticks(scale):
        level = y + scale.height - scale(tick)
        out.append(line(x, level, x + width, level, 'stroke="#DDD"'))
        out.append(text(x - 6, level + 4, f"{tick:.12g}", 11, "end"))
    out.append(line(x, y, x, y + scale.height, 'stroke="#333"'))
    return out


def draw_panel(rows, threads, cholmod, x, y, width, scale):
    """One size and number of threads."""
    base = y + scale.height
    out = [text(x, y - 6, f"n = {rows[0].n}, {plural(threads, 'thread')}", 13, "start",
                ' font-weight="bold"')]
    out += draw_axes(x, y, width, scale)
    by_domains = bars_of([r for r in rows if r.threads == threads])
    group = width / max(1, len(by_domains))
    slot = min(26.0, 0.8 * group / max([1] + [len(b) for b in by_domains.values()]))
    for i, (domains, bars) in enumerate(by_domains.items()):
        middle = x + (i + 0.5) * group
        for k, bar in enumerate(bars):
            left = middle + (k - len(bars) / 2) * slot
            out += draw_bar(bar, left, base, 0.9 * slot, scale)
        out.append(text(middle, base + 15, str(domains), 11))
    out.append(line(x, base, x + width, base, 'stroke="#333"'))
    if cholmod:
        level = base - scale(cholmod)
        out.append(line(x, level, x + width, level,
                        'stroke="#000" stroke-width="1.7" stroke-dasharray="7 4"'))
    return out


def swatch(x, y, label, colours):
    """An entry of the legend: dark, light, words."""
    out = [box(x + 15 * i, y - 11, 14, 12, colour) for i, colour in enumerate(colours)]
    return out + [text(x + 15 * len(colours) + 5, y, label, 12, "start")]


def legend(rows):
    """Only what is drawn."""
    out, x, y = [], LEFT, 58
    drawn = [bar_of(r) for r in rows if r.ok and r.method in METHODS]
    for method, (label, *_) in METHODS.items():
        bars = [b for b in drawn if b.method == method]
        if not bars:
            continue
        colours = list(dict.fromkeys(c for b in bars for _, c in b.parts if c != OTHER))
        split = {"tree": " (subtrees, top)"}.get(method[:4], " (domains, interface)")
        label += split if len(colours) > 1 else ""
        out += swatch(x, y, label, colours)
        x += 15 * len(colours) + 5 + 5.85 * len(label) + 18
    if any(c == OTHER for b in drawn for _, c in b.parts):
        out += swatch(x, y, "other", [OTHER])
        x += 70
    out.append(line(x, y - 5, x + 32, y - 5,
                    'stroke="#000" stroke-width="1.7" stroke-dasharray="7 4"'))
    return out + [text(x + 38, y, "CHOLMOD, 1 thread", 12, "start")]


def notes(columns, log):
    """How to read the bars."""
    words = ["CHOLMOD: median of its times beside all rows"]
    if log:
        words.append("logarithmic axis: read boundaries, not lengths")
    marks = {b.mark for of_size in columns.values() for bars in bars_of(of_size).values()
             for b in bars}
    words += [m for m in ("† disturbed", "× no valid result") if m[0] in marks]
    return "; ".join(words)


def cholmod_ms(rows):
    """CHOLMOD's solve: the median of what every row of the size saw beside itself, for one row of
    its own may have had a bad moment. None without a baseline."""
    beside = [r.counters["base_ms"] for r in rows if r.ok and r.solves and "base_ms" in r.counters]
    return statistics.median(beside) if beside else None


def panels(columns, threads, log):
    """Sizes side by side, thread counts below each other."""
    width = (WIDTH - LEFT - RIGHT - GAP_X * (len(columns) - 1)) / len(columns)
    high = (HEIGHT - TOP - BOTTOM - GAP_Y * (len(threads) - 1)) / len(threads)
    out = []
    for i, rows in enumerate(columns.values()):
        cholmod = cholmod_ms(rows)
        scale = scale_of(rows, cholmod, high - TITLE, log)
        for k, count in enumerate(threads):
            out += draw_panel(rows, count, cholmod, LEFT + i * (width + GAP_X),
                              TOP + TITLE + k * (high + GAP_Y), width, scale)
    return out


def figure(rows, context):
    """The SVG document."""
    rows = [r for r in rows if not r.family.endswith("_stretch_only")]
    threads = shown_threads(rows)
    with_bars = {r.n for r in rows if r.ok and r.method in METHODS}
    columns = groups([r for r in rows if r.n in with_bars], lambda r: r.n)
    log = is_log(columns)
    middle = (TOP + HEIGHT - BOTTOM) / 2
    out = [text(WIDTH - RIGHT, 30, origin(context), 11, "end", ' fill="#555"'),
           text(LEFT, 30, "One global solve with three right-hand sides", 18, "start",
                ' font-weight="bold"')]
    if columns:
        out += legend(rows) + panels(columns, threads, log)
    else:
        out.append(text(WIDTH / 2, HEIGHT / 2, "no valid row", 16))
    out += [text(22, middle, "time per solve, ms", 14, "middle",
                 f' transform="rotate(-90 22 {middle:.1f})"'),
            text(WIDTH / 2, HEIGHT - 28, "number of domains D", 14),
            text(WIDTH - RIGHT, HEIGHT - 8, notes(columns, log), 11, "end", ' fill="#555"')]
    return document(WIDTH, HEIGHT, out)
