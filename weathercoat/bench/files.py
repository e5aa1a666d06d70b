"""The folder of a benchmark's results: NAME.json, NAME.csv and its charts as PNG."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any, BinaryIO

from weathercoat.output.report import write_json

Draw = Callable[[dict[str, Any], BinaryIO], None]  # the results as PNG; ImportError without matplotlib


def write_results(
    folder: Path, name: str, results: dict[str, Any], table: str, charts: Mapping[str, Draw]
) -> str | None:
    """Write results as JSON, a table in CSV, and charts by their stems into a folder; returns why there are
    no charts, if there are none.
    """
    write_json(folder / f"{name}.json", results)
    (folder / f"{name}.csv").write_text(table, encoding="utf-8")
    for stem, draw in charts.items():
        path = folder / f"{stem}.png"
        try:
            with path.open("wb") as stream:
                draw(results, stream)
        except ImportError:
            path.unlink()
            return "no chart: matplotlib is not installed (`pip install 'weathercoat[charts]'`)"
    return None


def read_results(folder: Path, name: str) -> dict[str, Any]:
    """The results in a folder that `write_results` has filled."""
    results: dict[str, Any] = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    return results


def rows_as_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows with the same keys as CSV, below a line of these keys."""
    out = StringIO()
    writer = csv.DictWriter(out, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()
