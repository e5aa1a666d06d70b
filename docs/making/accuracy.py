"""The figures of the accuracy benchmark in its page."""

from __future__ import annotations

from pathlib import Path

from making.convergence import with_convergence
from making.places import DOCS
from making.results import fill_page, keep_results
from weathercoat.bench.accuracy_tables import case_table, least_table, reach_table, setting_table
from weathercoat.bench.files import read_results
from weathercoat.bench.tables import as_markdown, describe_lines

PAGE = DOCS / "accuracy.md"


def accuracy_page() -> str:
    """The page, with the tables of all results that are kept beside it."""
    return with_convergence(fill_page(PAGE, "make charts", _results()))


def take_results(folder: Path) -> None:
    """Keep the results of `weathercoat bench accuracy -o FOLDER`, and write the page."""
    keep_results(folder, "accuracy", table=True)
    PAGE.write_text(accuracy_page(), encoding="utf-8")
    print(PAGE.name, flush=True)


def _results() -> str:
    """The chart of all cases, the tables, and the chart of each case."""
    results = read_results(DOCS, "accuracy")
    parts = [
        "; ".join(describe_lines(results["machine"])) + ".",
        "![Angle error over CPU time, every case and method](images/accuracy.png)",
    ]
    tables = {
        "The cases": case_table(results),
        "CPU milliseconds to an angle error of a tenth of the targets": reach_table(results, "angle", 0.1),
        "CPU milliseconds to a hundredth": reach_table(results, "angle", 0.01),
        "CPU milliseconds to an energy within a hundredth of flat film's above the minimum": reach_table(
            results, "gap", 0.01
        ),
        "The least angle error, and when; in brackets where it was still falling": least_table(
            results, "angle"
        ),
        "The setting with which each came to that": setting_table(results, "angle"),
        "The least energy above the minimum, over that of flat film": least_table(results, "gap"),
        "The largest distance from the answer over the length, likewise": least_table(results, "position"),
    }
    for title, table in tables.items():
        parts += [f"**{title}**", as_markdown(table)]
    for case in results["cases"]:
        parts.append(f"![{case['about']}](images/accuracy-{case['name']}.png)")
    return "\n" + "\n\n".join(parts) + "\n\n"
