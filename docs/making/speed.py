"""The figures of the benchmark in the page on performance."""

from __future__ import annotations

from pathlib import Path

from making.places import DOCS
from making.results import fill_page, keep_results
from weathercoat.bench.files import read_results
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


def performance_page() -> str:
    """The page, with the tables of the results that are kept beside it."""
    return fill_page(PAGE, "make bench", _results())


def take_results(folder: Path) -> None:
    """Keep the results of `weathercoat bench speed -o FOLDER`, and write the page."""
    keep_results(folder, "speed")
    PAGE.write_text(performance_page(), encoding="utf-8")
    print(PAGE.name, flush=True)


def _results() -> str:
    """All tables and the chart."""
    results = read_results(DOCS, "speed")
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
        "![Seconds for 1,000 steps over the number of faces, and speed over the age](images/speed.png)"
    )
    return "\n" + "\n\n".join(parts) + "\n\n"
