"""The chart of the fidelity benchmark: seconds against the errors of what a viewer sees."""

from __future__ import annotations

from typing import Any, BinaryIO

from weathercoat.bench.fidelity import heights_of, limits_of, measures
from weathercoat.plan import MOST_IMAGE

_COLORS = {
    "newton": "#2f6f7e",
    "descent": "#8a8f3c",
    "sweeps": "#b5482a",
    "momentum": "#d98f2b",
    "none": "#7a5195",
}
_NOISE, _FRONT = "#888888", "#222222"


def draw_chart(results: dict[str, Any], stream: BinaryIO) -> None:
    """Write the chart as PNG. Raises ImportError without matplotlib (the extra `charts`)."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    heights = heights_of(results)
    noise, limits = results["noise"], limits_of(results)
    panels = {
        f"image {heights[0]}": (f"picture {heights[0]} pixels high", 1.0, MOST_IMAGE),
        f"image {heights[-2]}": (f"picture {heights[-2]} pixels high", 1.0, MOST_IMAGE),
        "areas": ("separated, lost and rusted area, the worst", noise["areas"], limits["areas"]),
        "spacing": ("length of cracks", noise["spacing"], limits["spacing"]),
        "distance": ("distance of the film [sizes]", noise["distance"], None),
        "outline": ("outline of the film in view", noise["outline"], None),
    }
    figure = Figure(figsize=(12.5, 7.6), layout="constrained")
    reference, *rows = results["ways"]
    for axes, name in zip(figure.subplots(2, 3).ravel(), panels, strict=True):
        title, floor, limit = panels[name]
        places = {row["label"]: (row["seconds"]["total"], measures(row)[name]) for row in rows}
        for row in rows:
            axes.plot(
                *places[row["label"]],
                "s" if row["threads"] > 1 else "o",
                color=_COLORS[row["solver"]],
                markersize=_marker_size(row["faces"]),
                alpha=0.75,
                markeredgewidth=0,
            )
            if row["levels"]:
                axes.annotate(
                    ", ".join(row["levels"]),
                    places[row["label"]],
                    (4, 4),
                    textcoords="offset points",
                    fontsize=8,
                )
        front = sorted(places[row["label"]] for row in rows if name in row["best_in"])
        axes.step(*zip(*front, strict=True), where="post", color=_FRONT, linewidth=1.0)
        axes.axhline(floor, color=_NOISE, linestyle="--", linewidth=1.0)
        if limit is not None:
            axes.axhline(limit, color=_NOISE, linestyle=":", linewidth=1.0)
        axes.axvline(reference["seconds"]["total"], color=_COLORS[reference["solver"]], linewidth=0.8)
        largest = max(floor, *(error for _, error in places.values()))
        axes.set(xscale="log", title=title, ylim=(0, 1.08 * largest))
        axes.title.set_fontsize(9)
        axes.grid(True, which="major", color="#e4e4e4")
        axes.set_xlabel("seconds", fontsize=8)
        axes.tick_params(labelsize=8)
    figure.axes[0].set_ylabel("difference, relative to two seeds", fontsize=8)
    figure.axes[3].set_ylabel("relative error", fontsize=8)
    used = {row["solver"] for row in results["ways"]}
    colors = {solver: color for solver, color in _COLORS.items() if solver in used}
    signs = [Line2D([], [], marker="o", linestyle="", color=color) for color in colors.values()]
    faces = sorted({row["faces"] for row in results["ways"]})
    for count in (faces[0], faces[-1]):
        size = _marker_size(count)
        signs.append(Line2D([], [], marker="o", linestyle="", color="#aaaaaa", markersize=size))
    lines = [
        Line2D([], [], marker="s", linestyle="", color=_COLORS["sweeps"]),
        Line2D([], [], color=_FRONT),
        Line2D([], [], color=_NOISE, linestyle="--"),
        Line2D([], [], color=_NOISE, linestyle=":"),
        Line2D([], [], color=_COLORS[reference["solver"]]),
    ]
    words = [
        *colors,
        *(f"{count:,} faces" for count in (faces[0], faces[-1])),
        "several threads",
        "front",
        "two seeds at the reference",
        "good enough for auto",
        "cost of the reference",
    ]
    figure.legend([*signs, *lines], words, loc="outside lower center", ncols=6, fontsize=8)
    figure.savefig(stream, format="png", dpi=110)


def _marker_size(faces: int) -> float:
    return 2.2 * (faces / 1000.0) ** 0.36
