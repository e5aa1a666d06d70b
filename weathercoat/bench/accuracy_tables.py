"""The results of the accuracy benchmark as tables: for the terminal, for Markdown, and as rows of a CSV."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from weathercoat.bench.accuracy_summary import DONE, summarise
from weathercoat.bench.files import rows_as_csv
from weathercoat.bench.tables import Table, as_lines, digits


def case_table(results: dict[str, Any]) -> Table:
    """What each case is, and how far flat film is from its answer."""
    table = [["", "film", "free vertices", "answer", "flat film: distance", "angle"]]
    for case in results["cases"]:
        start = case["start"]
        errors = [f"{start[name]:.2g}" for name in ("position", "angle")]
        table.append([case["name"], case["about"], f"{case['free_vertices']:,}", case["answer"], *errors])
    return table


def reach_table(results: dict[str, Any], error: str, wanted: float) -> Table:
    """CPU milliseconds in which each method comes within an error on each case; "-" where none of its points
    does.
    """
    return _by_method(results, lambda curve: _first_within(curve, error, wanted))


def least_table(results: dict[str, Any], error: str) -> Table:
    """The least error that each method comes to on each case, and the milliseconds of that; in brackets where
    it was still falling when the ladder ended.
    """
    return _by_method(results, lambda curve: _least(summarise(curve, error)))


def setting_table(results: dict[str, Any], error: str) -> Table:
    """The setting with which each method came to its least error on each case."""
    return _by_method(results, lambda curve: summarise(curve, error)["setting"] or "-")


def _by_method(results: dict[str, Any], cell: Any) -> Table:
    methods = [curve["method"] for curve in results["cases"][0]["curves"]]
    rows = [[case["name"], *(cell(curve) for curve in case["curves"])] for case in results["cases"]]
    return [["", *methods], *rows]


def _first_within(curve: dict[str, Any], error: str, wanted: float) -> str:
    front = summarise(curve, error)["front"]
    return next((digits(point["cpu_ms"]) for point in front if point[error] <= wanted), "-")


def _least(summary: dict[str, Any]) -> str:
    if summary["least"] is None:
        return "-"
    text = f"{summary['least']:.1e} in {digits(summary['front'][-1]['cpu_ms'])} ms"
    return text if summary["stops"] or summary["least"] <= DONE else f"({text})"


def as_text(results: dict[str, Any]) -> Iterator[str]:
    """What matters most for a terminal, line by line."""
    tables = {
        "CPU milliseconds to an angle error of a tenth of the targets": reach_table(results, "angle", 0.1),
        "CPU milliseconds to a hundredth": reach_table(results, "angle", 0.01),
        "Least angle error (in brackets: still falling)": least_table(results, "angle"),
    }
    for title, table in tables.items():
        yield from ("", title)
        yield from as_lines(table)


def as_csv(results: dict[str, Any]) -> str:
    """A line for each point: what was done, what it took, and how far it was from the answer."""
    return rows_as_csv(
        [
            {
                "case": case["name"],
                "faces": case["faces"],
                "method": curve["method"],
                "setting": ladder["setting"],
                **point,
            }
            for case in results["cases"]
            for curve in case["curves"]
            for ladder in curve["ladders"]
            for point in ladder["points"]
        ]
    )
