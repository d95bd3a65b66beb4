"""Pieces of self-contained SVG that the figures share."""
import math
from html import escape

from bench_json import plural


def text(x, y, words, size=12, anchor="middle", extra=""):
    return (f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}"{extra}>'
            f"{escape(words)}</text>")


def line(x1, y1, x2, y2, style):
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" {style}/>'


def box(x, y, width, height, colour):
    return (f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" '
            f'fill="{colour}"/>')


def document(width, height, parts):
    """The whole picture on white."""
    head = (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
            f'width="{width}" height="{height}" font-family="sans-serif" fill="#111">')
    return "\n".join([head, box(0, 0, width, height, "#FFF"), *parts]) + "\n</svg>\n"


def nice(value, up):
    """The next of 1, 2, 5 x a power of ten."""
    decade = 10.0 ** math.floor(math.log10(value))
    steps = [decade * s for s in (1, 2, 5, 10)]
    if up:
        return next(s for s in steps if s >= value * 0.9999)
    return [s for s in steps if s <= value * 1.0001][-1]


def origin(context):
    """The machine and what was measured on it."""
    words = [context.get("cpu_model", "unknown processor"),
             plural(int(context.get("num_cpus", 0)), "core"),
             f"revision {str(context.get('revision', 'unknown'))[:12]}"
             + (" + changes" if str(context.get("dirty")) == "true" else "")]
    if str(context.get("quick")) == "true":
        words.append("--quick: times mean nothing")
    return ", ".join(words)
