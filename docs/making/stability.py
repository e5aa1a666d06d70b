"""The maps of the stability benchmark in its page."""

from __future__ import annotations

from pathlib import Path

from making.places import DOCS
from making.results import fill_page, keep_results
from weathercoat.bench.files import read_results
from weathercoat.bench.stability_tables import count_table
from weathercoat.bench.tables import as_markdown, describe_lines

PAGE = DOCS / "stability.md"


def stability_page() -> str:
    """The page, with the maps of the results that are kept beside it."""
    return fill_page(PAGE, "make charts", _results())


def take_results(folder: Path) -> None:
    """Keep the results of `weathercoat bench stability -o FOLDER`, and write the page."""
    keep_results(folder, "stability", table=True)
    PAGE.write_text(stability_page(), encoding="utf-8")
    print(PAGE.name, flush=True)


def _results() -> str:
    """The maps, and how many cells of each fall into which class."""
    results = read_results(DOCS, "stability")
    parts = ["; ".join(describe_lines(results["machine"])) + "."]
    for made in results["maps"]:
        parts.append(f"![{made['about']}](images/stability-{made['name']}.png)")
    parts += ["**Cells by class**", as_markdown(count_table(results))]
    return "\n" + "\n\n".join(parts) + "\n\n"
