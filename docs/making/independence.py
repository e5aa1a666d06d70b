"""The figures of the benchmark of independence in its page."""

from __future__ import annotations

from pathlib import Path

from making.places import DOCS
from making.results import fill_page, keep_results
from weathercoat.bench.files import read_results
from weathercoat.bench.independence_tables import faces_table, shear_lag_table
from weathercoat.bench.tables import as_markdown, describe_lines

PAGE = DOCS / "independence.md"


def independence_page() -> str:
    """The page, with the tables of the results that are kept beside it."""
    return fill_page(PAGE, "make charts", _results())


def take_results(folder: Path) -> None:
    """Keep the results of `weathercoat bench independence -o FOLDER`, and write the page."""
    keep_results(folder, "independence", table=True)
    PAGE.write_text(independence_page(), encoding="utf-8")
    print(PAGE.name, flush=True)


def _results() -> str:
    """The chart and the tables."""
    results = read_results(DOCS, "independence")
    parts = [
        "; ".join(describe_lines(results["machine"])) + ".",
        f"Means over {results['seeds']} seeds, {results['steps']} steps; ± is the standard deviation between"
        " seeds.",
        "![Spacing of cracks, area of flakes and radius of curls over the number of faces, and spacing over"
        " the shear lag](images/independence.png)",
        "**By default**",
        as_markdown(faces_table(results, "standard")),
        "**By the literal rules**",
        as_markdown(faces_table(results, "literal")),
        "**By the shear lag**",
        as_markdown(shear_lag_table(results)),
    ]
    return "\n" + "\n\n".join(parts) + "\n\n"
