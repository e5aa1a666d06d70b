"""The results of the stability benchmark as a table and as rows of a CSV."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from weathercoat.bench.files import rows_as_csv
from weathercoat.bench.tables import Table, as_lines


def count_table(results: dict[str, Any]) -> Table:
    """How many cells of each map fall into each class, by method."""
    table = [["", "map", *results["classes"]]]
    for made in results["maps"]:
        for method in made["methods"]:
            cells = [cell for row in method["cells"] for cell in row]
            counts = [str(cells.count(name) or "") for name in results["classes"]]
            table.append([method["method"], made["name"], *counts])
    return table


def as_text(results: dict[str, Any]) -> Iterator[str]:
    """The counts for a terminal, line by line."""
    yield from as_lines(count_table(results))


def as_csv(results: dict[str, Any]) -> str:
    """A line for each cell."""
    return rows_as_csv(
        [
            {"map": made["name"], "method": method["method"], "x": x, "y": y, "class": name}
            for made in results["maps"]
            for method in made["methods"]
            for y, row in zip(made["y"], method["cells"], strict=True)
            for x, name in zip(made["x"], row, strict=True)
        ]
    )
