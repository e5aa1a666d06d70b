"""The figures of the benchmark of noise in the page on regression, and in the package for comparisons."""

from __future__ import annotations

import shutil
from pathlib import Path

from making.places import DOCS
from making.results import fill_page, keep_results
from weathercoat.bench.files import read_results
from weathercoat.bench.noise_tables import rates_table, spread_table
from weathercoat.bench.tables import as_markdown, describe_lines
from weathercoat.comparison.noise import SHIPPED

PAGE = DOCS / "regression.md"


def regression_page() -> str:
    """The page, with the tables of the results that are kept beside it."""
    results = read_results(DOCS, "noise")
    parts = [
        "; ".join(describe_lines(results["machine"])) + ".",
        f"**Spread**: {results['faces']:,} faces, {results['steps']:,} steps, {results['seeds']} seeds.",
        as_markdown(spread_table(results)),
        f"**Rates**: {results['trials']:,} judgements a row, of groups drawn from {results['judged']} seeds.",
        as_markdown(rates_table(results)),
    ]
    return fill_page(PAGE, "make charts", "\n" + "\n\n".join(parts) + "\n\n")


def take_results(folder: Path) -> None:
    """Keep the results of `weathercoat bench noise -o FOLDER`, and write the page."""
    shutil.copy(folder / "shipped.json", SHIPPED)
    keep_results(folder, "noise")
    PAGE.write_text(regression_page(), encoding="utf-8")
    print(PAGE.name, flush=True)
