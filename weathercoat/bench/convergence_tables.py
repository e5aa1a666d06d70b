"""The results of the convergence benchmark as tables, rows of a CSV, and a chart."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, BinaryIO

from weathercoat.bench.accuracy_chart import STYLES, make_figure
from weathercoat.bench.files import rows_as_csv
from weathercoat.bench.tables import Table, as_lines, describe_lines, digits


def run_table(results: dict[str, Any]) -> Table:
    """What each run cost, and the worst that was found."""
    table = [["", "CPU s", "iterations a step", "largest gap", "largest strain", "film left at the end"]]
    steps = results["plate"]["steps"]
    for run in results["runs"]:
        table.append(
            [
                run["solver"],
                digits(run["cpu_seconds"]),
                digits(run["iterations"] / steps),
                f"{run['largest_gap']:.2g}",
                f"{run['largest_strain']:.2g}",
                f"{100 * run['looks'][-1]['alive']:.1f} %",
            ]
        )
    return table


def sheet_table(results: dict[str, Any]) -> Table:
    """How near to their answers the sheets came that were followed, and what that cost."""
    table = [["", "steps", "CPU s", "iterations a step", "position", "angle", "length", "gap"]]
    for sheet in results["sheets"]:
        errors = [f"{sheet[name]:.1e}" for name in ("position", "angle", "length", "gap")]
        table.append(
            [
                f"{sheet['sheet']}, {sheet['solver']}",
                f"{sheet['steps']}",
                digits(sheet["cpu_seconds"]),
                digits(sheet["iterations"] / sheet["steps"]),
                *errors,
            ]
        )
    return table


def as_text(results: dict[str, Any]) -> Iterator[str]:
    """The results for the terminal, line by line."""
    yield from describe_lines(results["machine"])
    plate = results["plate"]
    yield f"plate of {plate['faces']:,} faces, {plate['steps']:,} steps"
    yield from as_lines(run_table(results))
    if results["sheets"]:
        yield from as_lines(sheet_table(results))


def as_csv(results: dict[str, Any]) -> str:
    """A row for each look."""
    return rows_as_csv(
        [{"solver": run["solver"], **look} for run in results["runs"] for look in run["looks"]]
    )


def draw_convergence(results: dict[str, Any], stream: BinaryIO) -> None:
    """Write gap and strain over the age as PNG. Raises ImportError without matplotlib."""
    figure = make_figure(9.5, 3.6)
    panels = figure.subplots(1, 2)
    titles = {"gap": "energy above the minimum / minimum", "strain": "largest strain of an unbroken edge"}
    for axes, (key, title) in zip(panels, titles.items(), strict=True):
        for run in results["runs"]:
            color, mark = STYLES.get(run["solver"], STYLES["sweeps, dihedral"])
            looks = [look for look in run["looks"] if look[key] > 0.0]
            label = f"{run['solver']}, {digits(run['cpu_seconds'])} s"
            axes.plot(
                [look["age"] for look in looks],
                [look[key] for look in looks],
                mark + "-",
                color=color,
                label=label,
                markersize=4,
            )
        axes.axhline(1e-2, color="#888888", linewidth=0.8, linestyle=":")
        axes.set(yscale="log", xlabel="age")
        axes.set_title(title, fontsize=9.5, loc="left")
        axes.grid(True, which="major", color="#dddddd")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8.5)
    figure.savefig(stream, format="png", dpi=110)
