"""The charts of the accuracy benchmark: error over work, a chart a case, and one of all cases."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, BinaryIO, Literal

from weathercoat.bench.accuracy_summary import summarise

Place = Literal["outside upper left", "outside lower center"]

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Colours that people with any common colour blindness tell apart (Okabe and Ito, 2008), and marks besides.
STYLES = {
    "sweeps, dihedral": ("#0072b2", "o"),
    "sweeps, split": ("#56b4e9", "s"),
    "sweeps, arccos": ("#8c8c8c", "^"),
    "momentum": ("#cc79a7", "D"),
    "descent": ("#009e73", "v"),
    "newton": ("#d55e00", "*"),
}
TITLES = {
    "position": "largest distance / length",
    "angle": "RMS angle error / RMS target",
    "length": "RMS strain",
    "gap": "energy above the minimum / flat",
}
_LEAST = 1e-7  # below, errors are drawn here
_COLUMNS = 4


def case_charts(results: dict[str, Any]) -> dict[str, Callable[[dict[str, Any], BinaryIO], None]]:
    """What draws each chart as PNG, by its stem: `accuracy` of all cases, and `accuracy-NAME` of each."""
    names = [case["name"] for case in results["cases"]]
    return {
        "accuracy": draw_overview,
        **{f"accuracy-{name}": partial(draw_case, number) for number, name in enumerate(names)},
    }


def draw_overview(results: dict[str, Any], stream: BinaryIO) -> None:
    """Write the error over work of all cases as PNG: of angles where the answer is exact, of the energy where
    it is a minimum, of which there may be several. Raises ImportError without matplotlib.
    """
    cases = results["cases"]
    rows = -(-len(cases) // _COLUMNS)
    figure = make_figure(12.5, 0.8 + 2.9 * rows)
    panels = figure.subplots(rows, min(_COLUMNS, len(cases)), squeeze=False).ravel()
    for axes, case in zip(panels, cases, strict=False):
        error = "angle" if case["answer"] == "exact" else "gap"
        _draw_curves(axes, case, error)
        axes.set_ylabel(TITLES[error], fontsize=8)
        axes.set_title(_wrapped(case["about"], 42), fontsize=8.5, loc="left")
        axes.tick_params(labelsize=7.5)
    for axes in panels[len(cases) :]:
        axes.set_visible(False)
    for axes in panels[max(len(cases) - _COLUMNS, 0) : len(cases)]:
        axes.set_xlabel("CPU milliseconds", fontsize=8.5)
    _finish(figure, panels[0], "outside upper left", stream)


def draw_case(number: int, results: dict[str, Any], stream: BinaryIO) -> None:
    """Write the errors of a case over work as PNG. Raises ImportError without matplotlib."""
    case = results["cases"][number]
    figure = make_figure(3.3 * len(TITLES), 4.0)
    panels = figure.subplots(1, len(TITLES))
    for axes, error in zip(panels, TITLES, strict=True):
        _draw_curves(axes, case, error)
        axes.set_title(TITLES[error], fontsize=9.5, loc="left")
        axes.set_xlabel("CPU milliseconds", fontsize=9)
        axes.tick_params(labelsize=8)
    figure.suptitle(case["about"], fontsize=11, x=0.01, ha="left")
    _finish(figure, panels[0], "outside lower center", stream)


def make_figure(width: float, height: float) -> Figure:
    """A figure on white, sizes in inches, whose parts keep clear of each other."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained", facecolor="white")


def _draw_curves(axes: Axes, case: dict[str, Any], error: str) -> None:
    """All points faintly, the front of each method, and a ring with a dotted line where it stops."""
    axes.set(xscale="log", yscale="log")
    axes.yaxis.set_minor_formatter("")
    axes.grid(True, which="major", color="#e2e2e2", linewidth=0.8)
    axes.set_axisbelow(True)
    longest = max(
        (
            point["cpu_ms"]
            for curve in case["curves"]
            for ladder in curve["ladders"]
            for point in ladder["points"]
        ),
        default=1.0,
    )
    for curve in case["curves"]:
        color, mark = STYLES[curve["method"]]
        for ladder in curve["ladders"]:
            points = [(p["cpu_ms"], _shown(p[error])) for p in ladder["points"] if p[error] is not None]
            if points:
                axes.plot(*zip(*points, strict=True), mark, color=color, markersize=2.2, alpha=0.35)
        # film that does not move keeps its lengths, so these are shown where the angles are best
        summary = summarise(curve, "gap" if error == "gap" else "angle")
        if not summary["front"]:
            continue
        front = [(point["cpu_ms"], _shown(point[error])) for point in summary["front"]]
        axes.plot(
            *zip(*front, strict=True),
            "-",
            marker=mark,
            color=color,
            markersize=3.5,
            linewidth=1.5,
            label=curve["method"],
        )
        if summary["stops"]:
            work, least = front[-1]
            axes.plot([work, 2 * longest], [least, least], ":", color=color, linewidth=1.2)
            axes.plot([work], [least], "o", color=color, markersize=9, fillstyle="none", markeredgewidth=1.3)

    low, high = axes.get_ylim()
    axes.set_ylim(min(low, 0.02 * high), high)


def _shown(error: float) -> float:
    return max(error, _LEAST)


def _wrapped(text: str, width: int) -> str:
    import textwrap

    return "\n".join(textwrap.wrap(text, width))


def _finish(figure: Figure, axes: Axes, place: Place, stream: BinaryIO) -> None:
    """Add the legend and write the picture."""
    from matplotlib.lines import Line2D

    handles, labels = axes.get_legend_handles_labels()
    handles.append(Line2D([], [], color="#555555", linestyle=":", marker="o", fillstyle="none", markersize=9))
    labels.append("stops: more work gains nothing")
    figure.legend(handles, labels, loc=place, ncols=len(labels), fontsize=8.5, frameon=False)
    figure.savefig(stream, format="png", dpi=110)
