"""`weathercoat severity`: what an inspector would write down of a finished run."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click

from weathercoat.cli import options
from weathercoat.errors import CorruptError, UsageError


@click.command()
@click.argument("run", type=click.Path(path_type=Path))
@click.option("--step", type=int, metavar="N", help="Of this snapshot alone.")
@click.option("--csv", "as_csv", is_flag=True, help="Print all figures as CSV, as severity.csv has them.")
@options.as_json
@options.debug
def command(run: Path, step: int | None, as_csv: bool, as_json: bool) -> None:
    """Tell how far the paint of RUN, the folder of a finished run, is gone: percent of the area, and the
    grades that they are equivalent to, of the whole and of each material group and named part.
    """
    from weathercoat.finished import open_run
    from weathercoat.output.folder import REPORT
    from weathercoat.output.severity import write_table

    if as_csv and as_json:
        raise UsageError("--csv and --json both write to standard output", remedy="give one of them")
    finished = open_run(run)
    rows = [row for row in finished.report["snapshots"] if step in (None, row["step"])]
    if not rows:
        steps = ", ".join(map(str, finished.steps))
        raise UsageError(
            f"the run has no snapshot of step {step}", file=str(run), remedy=f"there are {steps}"
        )
    if not all("severity" in row for row in rows):
        raise CorruptError("holds no severity", file=str(finished.path / REPORT), remedy="run again")
    if as_csv:
        click.echo(write_table(rows), nl=False)
    elif as_json:
        content = [{key: row[key] for key in ("step", "age", "severity")} for row in rows]
        click.echo(json.dumps(content, indent=2, ensure_ascii=False))
    else:
        click.echo("\n".join(_lines(rows)))


def _lines(rows: list[Mapping[str, Any]]) -> Iterator[str]:
    """A table for people; grades are equivalents computed from area."""
    from weathercoat.output.severity import entries

    names = {name for row in rows for _, name, _ in entries(row["severity"])}
    width = max(5, *(len(name) for name in names))
    yield (
        f"{'step':>8} {'of':{width}} {'flaked':>8} {'rusted':>8} {'lifted':>8} {'patches':>7}"
        f" {'ISO 4628-3':>10} {'ISO 4628-5':>10} {'D610':>5}"
    )
    for row in rows:
        for _, name, figures in entries(row["severity"]):
            grades = figures["grades"]
            size = "" if grades["iso_4628_5_size"] is None else f"(S{grades['iso_4628_5_size']})"
            kind = grades["astm_d610_distribution"]
            d610 = f"{grades['astm_d610']}" + (f"-{kind}" if kind else "")
            flaking = f"{grades['iso_4628_5']}{size}{grades['iso_4628_5_depth']}"
            yield (
                f"{row['step']:8d} {name or 'whole':{width}} {figures['flaked_percent']:7.3g}%"
                f" {figures['rusted_percent']:7.3g}% {figures['lifted_percent']:7.3g}%"
                f" {figures['patches']['count']:7d} {grades['iso_4628_3']:>10} {flaking:>10} {d610:>5}"
            )
    yield "grades are equivalents computed from area, no assessments by the standards"
