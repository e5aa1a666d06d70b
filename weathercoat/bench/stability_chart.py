"""The chart of the stability benchmark: a panel for each map and method, its cells coloured by class."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, BinaryIO

from weathercoat.bench.accuracy_chart import make_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# A colour and a letter each; the colours keep their order in grey and for colour-blind eyes.
_STYLES = {
    "converged": ("#cfe8dc", ""),
    "slow": ("#f3dc8c", "s"),
    "oscillating": ("#e69f00", "o"),
    "flipped": ("#cc79a7", "f"),
    "differs": ("#56b4e9", "d"),
    "non-finite": ("#000000", "n"),
    "refused": ("#ffffff", "r"),
}


def map_charts(results: dict[str, Any]) -> dict[str, Callable[[dict[str, Any], BinaryIO], None]]:
    """What draws each chart as PNG, by its stem: `stability-NAME` of each map."""
    names = [made["name"] for made in results["maps"]]
    return {f"stability-{name}": partial(draw_map, number) for number, name in enumerate(names)}


def draw_map(number: int, results: dict[str, Any], stream: BinaryIO) -> None:
    """Write a map for all methods as PNG. Raises ImportError without matplotlib."""
    from matplotlib.patches import Patch

    made = results["maps"][number]
    columns, rows = len(made["x"]), len(made["y"])
    methods = made["methods"]
    across = min(len(methods), 3)
    down = -(-len(methods) // across)
    margin = 0.35 + 0.065 * max(map(len, made["y"]))
    figure = make_figure(across * (0.3 * columns + 0.3) + margin + 0.5, down * (0.24 * rows + 0.75) + 1.2)
    panels = figure.subplots(down, across, squeeze=False, sharex=True, sharey=True).ravel()
    for axes, method in zip(panels, methods, strict=False):
        _draw_cells(axes, method["cells"])
        axes.set_title(method["method"], fontsize=9, loc="left")
        axes.set_xticks(range(columns), made["x"], rotation=90, fontsize=7.5)
        axes.set_yticks(range(rows), made["y"], fontsize=7.5)
        axes.tick_params(length=0)
    for axes in panels[len(methods) :]:
        axes.set_visible(False)
    panels[across * (down - 1) + across // 2].set_xlabel(made["x_label"], fontsize=9)
    for row in range(down):
        panels[across * row].set_ylabel(made["y_label"], fontsize=9)
    figure.suptitle(made["about"], fontsize=10, x=0.01, ha="left")
    shown = {cell for method in methods for row in method["cells"] for cell in row}
    patches = [
        Patch(facecolor=color, edgecolor="#999999", label=f"{name} ({letter})" if letter else name)
        for name, (color, letter) in _STYLES.items()
        if name in shown
    ]
    figure.legend(
        handles=patches, loc="outside lower center", ncols=len(patches), fontsize=8.5, frameon=False
    )
    figure.savefig(stream, format="png", dpi=110)


def _draw_cells(axes: Axes, cells: list[list[str]]) -> None:
    from matplotlib.patches import Rectangle

    for y, row in enumerate(cells):
        for x, name in enumerate(row):
            color, letter = _STYLES[name]
            axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=color, edgecolor="white"))
            ink = "white" if name == "non-finite" else "#222222"
            axes.text(x, y, letter, ha="center", va="center", fontsize=7.5, color=ink)
    axes.set(xlim=(-0.5, len(cells[0]) - 0.5), ylim=(len(cells) - 0.5, -0.5))
    for side in axes.spines.values():
        side.set_color("#999999")
