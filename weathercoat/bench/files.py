"""The folder of a benchmark's results."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from weathercoat.bench.chart import draw_chart
from weathercoat.bench.tables import as_csv
from weathercoat.output.report import write_json

RESULTS, TABLE, CHART = "speed.json", "speed.csv", "speed.png"


def write_results(folder: Path, results: dict[str, Any]) -> str | None:
    """Write results as JSON, CSV and PNG into a folder; returns why there is no chart, if there is none."""
    write_json(folder / RESULTS, results)
    (folder / TABLE).write_text(as_csv(results), encoding="utf-8")
    try:
        with (folder / CHART).open("wb") as stream:
            draw_chart(results, stream)
    except ImportError:
        (folder / CHART).unlink()
        return "no chart: matplotlib is not installed (`pip install 'weathercoat[charts]'`)"
    return None


def read_results(folder: Path) -> dict[str, Any]:
    """The results in a folder that `write_results` has filled."""
    results: dict[str, Any] = json.loads((folder / RESULTS).read_text(encoding="utf-8"))
    return results
