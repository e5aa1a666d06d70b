"""The results of the benchmark of independence as tables: for the terminal, for Markdown, and as a CSV."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from weathercoat.bench.files import rows_as_csv
from weathercoat.bench.tables import Table, as_lines, describe_lines, digits

_HEADING = ["crack spacing", "flake area", "flakes", "curl radius", "separated", "lost"]


def faces_table(results: dict[str, Any], rules: str) -> Table:
    """The mean figures by the number of faces, under the rules of a shipped config."""
    rows = [row for row in results["means"] if row["kind"] == "faces" and row["rules"] == rules]
    return [["faces", *_HEADING], *([f"{row['faces']:,}", *_cells(row)] for row in rows)]


def shear_lag_table(results: dict[str, Any]) -> Table:
    """The mean figures by the shear lag, with the slope of the spacing below."""
    rows = [row for row in results["means"] if row["kind"] == "shear_lag"]
    table = [["shear lag", *_HEADING], *([digits(row["shear_lag"]), *_cells(row)] for row in rows)]
    if results["slope"] is not None:
        table.append(["log-log slope", f"{results['slope']:.2f}", *[""] * (len(_HEADING) - 1)])
    return table


def _cells(row: dict[str, Any]) -> list[str]:
    spread = [f"{digits(row[n])} ± {digits(row[f'{n}_deviation'])}" for n in ("spacing", "flake_area")]
    shares = [f"{row[name]:.1%}" for name in ("separated_share", "lost_share")]
    return [*spread, f"{row['flakes']:,.0f}", digits(row["curl_radius"]), *shares]


def as_text(results: dict[str, Any]) -> Iterator[str]:
    """All tables for a terminal, line by line."""
    yield from describe_lines(results["machine"])
    for rules in dict.fromkeys(row["rules"] for row in results["means"]):
        yield from ("", f"{rules}, by the number of faces")
        yield from as_lines(faces_table(results, rules))
    yield from ("", "standard, by the shear lag")
    yield from as_lines(shear_lag_table(results))


def as_csv(results: dict[str, Any]) -> str:
    """Every run on a line."""
    return rows_as_csv(results["runs"])
