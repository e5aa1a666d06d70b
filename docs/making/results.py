"""Figures of benchmarks in the pages: the results lie beside the pages, and what is made from them stands
between two marks.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from making.places import DOCS, IMAGES

_END = "<!-- end of results -->\n"


def fill_page(page: Path, command: str, results: str) -> str:
    """The page with the results between its marks; command: what makes them."""
    return fill_text(page.read_text(encoding="utf-8"), command, results)


def fill_text(text: str, command: str, results: str) -> str:
    """The same of a text, since a page may hold the results of several commands."""
    begin = f"<!-- results: made by `{command}` -->\n"
    before, _, rest = text.partition(begin)
    _, _, after = rest.partition(_END)
    return before + begin + results + _END + after


def keep_results(folder: Path, name: str, *, table: bool = False) -> None:
    """Keep beside the pages what `weathercoat bench NAME -o FOLDER` wrote: the figures and the charts, and
    the table where it is wanted.
    """
    shutil.copy(folder / f"{name}.json", DOCS)
    if table:
        shutil.copy(folder / f"{name}.csv", DOCS)
    for chart in sorted(folder.glob("*.png")):
        shutil.copy(chart, IMAGES)
