"""`weathercoat compare`: whether two runs, or groups of runs, differ by more than chance."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from weathercoat.cli import options

if TYPE_CHECKING:
    from weathercoat.comparison.compare import Comparison, Group, Pair, Side

_MOST_ROWS = 12  # figures of each group, beyond those that differ by more than is allowed
_MOST_FINDINGS = 20


@click.command()
@click.argument("a", type=click.Path(path_type=Path))
@click.argument("b", type=click.Path(path_type=Path))
@click.option(
    "--tolerance", "tolerance_file", type=click.Path(path_type=Path), metavar="FILE",
    help="A YAML file of what may differ, and by how much.",
)  # fmt: skip
@options.output("Folder of a report: compare.html, with pictures and charts, and compare.json.")
@options.overwrite
@options.quiet
@options.as_json
@options.debug
@click.pass_context
def command(
    context: click.Context,
    a: Path,
    b: Path,
    tolerance_file: Path | None,
    output: Path | None,
    overwrite: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Compare A and B, each the folder of a finished run, a folder of several such as that of a batch, or a
    baseline.

    They are the same, or within the noise between seeds, and then the exit code is 0; or they are different,
    or one is corrupt, and then it is 1.

    \b
    weathercoat compare before after -o report
    weathercoat compare batch-before batch-after --tolerance tolerance.yaml
    """
    from contextlib import ExitStack

    from weathercoat.comparison.compare import compare
    from weathercoat.comparison.page import PAGE, RECORD, write_report
    from weathercoat.comparison.record import make_record
    from weathercoat.comparison.tolerance import Tolerance, read_tolerance
    from weathercoat.output.folder import RunFolder
    from weathercoat.output.report import format_json

    tolerance = Tolerance() if tolerance_file is None else read_tolerance(tolerance_file)
    with ExitStack() as stack:
        folder = None
        if output is not None:
            folder = stack.enter_context(RunFolder(output, overwrite=overwrite, marker=RECORD))
        comparison = compare(a, b, tolerance)
        if folder is not None:
            write_report(folder, comparison)
    if as_json:
        click.echo(format_json(make_record(comparison)), nl=False)
    elif not quiet:
        click.echo("\n".join(_lines(comparison)))
        if output is not None:
            click.echo(f"written to {output / PAGE}")
    if not comparison.passes:
        context.exit(1)


def _lines(comparison: Comparison) -> Iterator[str]:
    """What a person reads: the verdict, and what differs most first."""
    yield f"{comparison.verdict}: {comparison.method}"
    for side in (comparison.a, comparison.b):
        yield from _findings(side)
    for group in comparison.groups:
        if len(comparison.groups) > 1:
            yield f"\n{group.title}: {group.judgement.verdict}"
        yield from _figures(group)
        for pair in group.pairs:
            yield from _pair(pair, f"{pair.a.name}: " if len(group.pairs) > 1 else "")
    keys = list(comparison.configs)
    if keys:
        shown = ", ".join(keys[:6]) + (f" and {len(keys) - 6} more" if len(keys) > 6 else "")
        yield f"configs differ in {shown}, which has no say"


def _findings(side: Side) -> Iterator[str]:
    lines = [
        f"{side.path}/{prefix}{finding}"
        for prefix, findings in side.findings_by_prefix()
        for finding in findings
    ]
    yield from lines[:_MOST_FINDINGS]
    if len(lines) > _MOST_FINDINGS:
        yield f"and {len(lines) - _MOST_FINDINGS:,} more"


def _figures(group: Group) -> Iterator[str]:
    """A table of the largest difference of each figure."""
    from weathercoat.comparison.record import ranked

    rows = [found for found in ranked(group.judgement.differences) if found.difference != 0.0]
    if not rows:
        return
    beyond = sum(found.is_beyond for found in rows)
    width = max(len(found.figure) for found in rows)
    yield f"{'figure':{width}}  {'age':>6} {'A':>10} {'B':>10} {'B - A':>11} {'allowed':>10}"
    for found in rows[: max(beyond, _MOST_ROWS)]:
        yield (
            f"{found.figure:{width}}  {found.age:6.3g} {found.a:10.4g} {found.b:10.4g}"
            f" {found.difference:+11.3g} {found.allowed:10.3g}{'  beyond' if found.is_beyond else ''}"
        )
    if len(rows) > max(beyond, _MOST_ROWS):
        yield f"and {len(rows) - max(beyond, _MOST_ROWS):,} more figures that differ by less"


def _pair(pair: Pair, prefix: str) -> Iterator[str]:
    """A line each on geometry and pictures, at the age where they differ most."""
    if pair.geometry:
        from weathercoat.comparison.geometry import describe

        yield f"{prefix}geometry  {describe(max(pair.geometry, key=lambda found: found.largest))}"
    if pair.pictures:
        worst = max(pair.pictures, key=lambda found: found.flip)
        yield f"{prefix}pictures  age {worst.age:.3g}: mean FLIP {worst.flip:.4f} of 1"
    yield from (f"{prefix}not compared: {what}" for what in pair.missing)
