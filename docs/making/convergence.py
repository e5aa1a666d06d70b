"""The figures of the convergence benchmark in their page."""

from __future__ import annotations

from pathlib import Path

from making.places import DOCS
from making.results import fill_text, keep_results
from weathercoat.bench.convergence_tables import run_table, sheet_table
from weathercoat.bench.files import read_results
from weathercoat.bench.tables import as_markdown, describe_lines

PAGE = DOCS / "accuracy.md"


def with_convergence(text: str) -> str:
    """The text of the page, with the table of the results that are kept beside it."""
    return fill_text(text, "weathercoat bench convergence", _results())


def take_results(folder: Path) -> None:
    """Keep the results of `weathercoat bench convergence -o FOLDER`, and write the page."""
    keep_results(folder, "convergence", table=True)
    PAGE.write_text(with_convergence(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    print(PAGE.name, flush=True)


def _results() -> str:
    results = read_results(DOCS, "convergence")
    plate = results["plate"]
    steps = max(sheet["steps"] for sheet in results["sheets"])
    return "\n\n".join(
        [
            "",
            "; ".join(describe_lines(results["machine"])) + ".",
            f"A plate of {plate['faces']:,} faces, {plate['steps']:,} steps, fracture and all.",
            as_markdown(run_table(results)),
            f"Sheets that the two converged solvers follow from flat to a tolerance of 1e-5, in {steps} "
            "steps in which the targets grow, or at once; the names are those of the "
            "[reference cases](#the-reference-cases). Position is the largest error over the length, angle "
            "and length are RMS, the gap is over the minimum (of the cylinder, over the energy at rest).",
            as_markdown(sheet_table(results)),
            "![Energy gap and largest strain over the age, every solver](images/convergence.png)",
            "",
        ]
    )
