"""The figures of the benchmark in the page on performance."""

from __future__ import annotations

import shutil
from pathlib import Path

from making.places import DOCS, IMAGES
from weathercoat.bench.files import CHART, RESULTS, read_results
from weathercoat.bench.tables import (
    as_markdown,
    load_table,
    machine_lines,
    peer_table,
    stage_table,
    step_table,
    variant_table,
)

PAGE = DOCS / "performance.md"
_BEGIN, _END = "<!-- results: made by `make bench` -->\n", "<!-- end of results -->\n"


def performance_page() -> str:
    """The page, with the tables of the results that are kept beside it."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(_BEGIN)
    _, _, after = rest.partition(_END)
    return before + _BEGIN + _results() + _END + after


def take_results(folder: Path) -> None:
    """Keep the results of `weathercoat bench speed -o FOLDER`, and write the page."""
    shutil.copy(folder / RESULTS, DOCS / RESULTS)
    shutil.copy(folder / CHART, IMAGES / CHART)
    PAGE.write_text(performance_page(), encoding="utf-8")
    print(PAGE.name, flush=True)


def _results() -> str:
    """All tables and the chart."""
    results = read_results(DOCS)
    machine, versions, *abilities = machine_lines(results)
    paper = f"{results['paper_machine']}; its sweeps are not given"
    tables = {
        f"Seconds for 1,000 steps, beside the paper's ({paper})": stage_table,
        "Milliseconds per step, over the run and at its end, and per sweep at its end": step_table,
        "Milliseconds per sweep, and per iteration of pypbd over as many constraints": peer_table,
        "Variants: times faster than the base, and distance from where it ends, in mean edges": variant_table,
        "What the runs came to, and how much of them was timed": load_table,
    }
    parts = [f"{machine}; {versions}.", " ".join(abilities)]
    for title, make in tables.items():
        table = make(results)
        if len(table) > 1:
            parts += [f"**{title}**", as_markdown(table)]
    parts.append(
        f"![Seconds for 1,000 steps over the number of faces, and speed over the age](images/{CHART})"
    )
    return "\n" + "\n\n".join(parts) + "\n\n"
