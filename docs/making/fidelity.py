"""The figures of whole runs and of scenes in the page on fidelity, and the front in the package."""

from __future__ import annotations

import shutil
from pathlib import Path

from making.places import DOCS
from making.results import fill_page, keep_results
from weathercoat.bench.fidelity_tables import ways_table
from weathercoat.bench.files import read_results
from weathercoat.bench.scenes import scenes_table
from weathercoat.bench.tables import as_markdown, describe_lines
from weathercoat.config.quality import FRONT

PAGE = DOCS / "fidelity.md"


def fidelity_page() -> str:
    """The page, with the tables of the results that are kept beside it."""
    whole, scenes = read_results(DOCS, "fidelity"), read_results(DOCS, "scenes")
    parts = [
        f"{'; '.join(describe_lines(whole['machine']))}. Seeds {_listed(whole['seeds'])}.",
        as_markdown(ways_table(whole)),
        "![Seconds against the errors of whole runs](images/fidelity.png)",
        f"**Scenes**, measured {scenes['machine']['date']}. Seeds {_listed(scenes['seeds'])}.",
        as_markdown(scenes_table(scenes)),
    ]
    return fill_page(PAGE, "make charts", "\n" + "\n\n".join(parts) + "\n\n")


def _listed(seeds: list[int]) -> str:
    return ", ".join(map(str, seeds))


def take_fidelity(folder: Path) -> None:
    """Keep the results of `weathercoat bench fidelity -o FOLDER` and its front, and write the page."""
    shutil.copy(folder / FRONT.name, FRONT)
    keep_results(folder, "fidelity", table=True)
    _write()


def take_scenes(folder: Path) -> None:
    """Keep the results of `weathercoat bench scenes -o FOLDER`, and write the page."""
    keep_results(folder, "scenes", table=True)
    _write()


def _write() -> None:
    PAGE.write_text(fidelity_page(), encoding="utf-8")
    print(PAGE.name, flush=True)
