"""Small charts of figures over age, as SVG for a page that gives their classes colours."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

Line = Sequence[tuple[float, float]]
"""Points (age, value) in the order of their ages."""

WIDTH, HEIGHT = 260, 132
_MOST_BAND = 1.4  # of the largest value
_LEFT, _RIGHT, _TOP, _BOTTOM = 40, 8, 8, 20


def draw_chart(
    label: str, a: Sequence[Line], b: Sequence[Line], band: Sequence[tuple[float, float, float]]
) -> str:
    """A chart of the runs of both sides, thin where a side has several, with their means, and of a band.

    a, b: a line a run, of the same ages on each side; band: (age, lowest, highest) of what is allowed.
    """
    points = [point for line in (*a, *b) for point in line]
    ages = [age for age, _ in points] or [0.0]
    values = [value for _, value in points] or [0.0]
    first, last = min(ages), max(ages)
    # A band may reach below zero, where no figure of this kind can be.
    low = min(0.0, *values)
    # A band that is far wider than what was found would make lines of it flat.
    widest = max((top for *_, top in band), default=0.0)
    high = max(max(values), min(widest, _MOST_BAND * max(values)), low + 1e-12)

    def x(age: float) -> float:
        share = 0.5 if last == first else (age - first) / (last - first)
        return _LEFT + share * (WIDTH - _LEFT - _RIGHT)

    def y(value: float) -> float:
        share = (min(max(value, low), high) - low) / (high - low)
        return HEIGHT - _BOTTOM - share * (HEIGHT - _TOP - _BOTTOM)

    def path(line: Line) -> str:
        return " ".join(f"{x(age):.1f},{y(value):.1f}" for age, value in line)

    parts = [
        f'<svg class="chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(label)} over age">'
    ]
    for value in (low, (low + high) / 2.0, high):
        at = f"{y(value):.1f}"
        parts.append(f'<line class="grid" x1="{_LEFT}" x2="{WIDTH - _RIGHT}" y1="{at}" y2="{at}"/>')
        parts.append(_tick(_LEFT - 5, y(value) + 3.0, "end", short(value)))
    for age, anchor in ((first, "start"), (last, "end")):
        parts.append(_tick(x(age), HEIGHT - 5, anchor, f"{age:.3g}"))
    if band:
        edges = [(age, top) for age, _, top in band] + [(age, bottom) for age, bottom, _ in reversed(band)]
        parts.append(f'<polygon class="band" points="{path(edges)}"/>')
    for side, lines in (("a", a), ("b", b)):
        if len(lines) > 1:
            parts += [f'<polyline class="run {side}" points="{path(line)}"/>' for line in lines]
        mean = mean_line(lines)
        parts.append(f'<polyline class="mean {side}" points="{path(mean)}"/>')
        parts += [
            f'<circle class="{side}" cx="{x(age):.1f}" cy="{y(value):.1f}" r="2.4">'
            f"<title>{side.upper()} at age {age:.3g}: {value:.4g}</title></circle>"
            for age, value in mean
        ]
    return "".join([*parts, "</svg>"])


def _tick(x: float, y: float, anchor: str, text: str) -> str:
    return f'<text class="tick" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{text}</text>'


def mean_line(lines: Sequence[Line]) -> list[tuple[float, float]]:
    """The mean of lines at the ages that all of them have, place by place."""
    return [
        (points[0][0], sum(value for _, value in points) / len(points))
        for points in zip(*lines, strict=False)
    ]


def short(value: float) -> str:
    """A number in few signs."""
    if value != 0.0 and abs(value) < 0.001:
        return f"{value:.0e}".replace("e-0", "e-")
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
