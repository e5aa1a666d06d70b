"""`weathercoat verify`: prove finished runs whole."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from weathercoat.cli import options
from weathercoat.errors import CheckError

if TYPE_CHECKING:
    from weathercoat.verification.run import Verification

_MOST_LINES = 40  # of findings about one run


@click.command()
@click.argument("folders", metavar="FOLDER...", nargs=-1, required=True, type=click.Path(path_type=Path))
@options.quiet
@options.as_json
@options.debug
def command(folders: tuple[Path, ...], quiet: bool, as_json: bool) -> None:
    """Prove the finished run in each FOLDER whole: files, meshes, and figures, which are computed again.

    It prints a line for each thing that is wrong, and ends with 6 where there is any.
    """
    from weathercoat.verification.run import verify_run

    found = [verify_run(folder) for folder in folders]
    if as_json:
        whole = all(run.is_whole for run in found)
        content = {"whole": whole, "runs": [_as_dict(run) for run in found]}
        click.echo(json.dumps(content, indent=2, ensure_ascii=False))
    elif not quiet:
        for run in found:
            click.echo("\n".join(_lines(run, f"{run.folder}: " if len(found) > 1 else "")))
    broken = [run for run in found if not run.is_whole]
    if broken:
        count = sum(len(run.findings) for run in broken)
        raise CheckError(
            f"{count:,} findings" if count > 1 else f"1 finding: {broken[0].findings[0]}",
            file=", ".join(str(run.folder) for run in broken),
            remedy="run again",
        )


def _lines(run: Verification, prefix: str) -> Iterator[str]:
    """What a person reads: a line a finding, and one that closes."""
    for finding in run.findings[:_MOST_LINES]:
        yield f"{run.folder}/{finding}"
    if len(run.findings) > _MOST_LINES:
        yield f"{prefix}and {len(run.findings) - _MOST_LINES:,} more"
    yield from (f"{prefix}not proved: {what}" for what in run.unproved)
    state = "whole" if run.is_whole else "not whole"
    yield f"{prefix}{state}: {run.files:,} files, {run.snapshots:,} snapshots, {run.checks:,} checks"


def _as_dict(run: Verification) -> dict[str, Any]:
    return {
        "folder": str(run.folder),
        "whole": run.is_whole,
        "files": run.files,
        "snapshots": run.snapshots,
        "checks": run.checks,
        "findings": [vars(finding) for finding in run.findings],
        "unproved": list(run.unproved),
    }
