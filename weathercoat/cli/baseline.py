"""`weathercoat baseline`: keep golden results, and judge later ones against them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from weathercoat.cli import options

if TYPE_CHECKING:
    from weathercoat.batch.job import Executor
    from weathercoat.comparison.golden import Check

_MOST_ROWS = 10  # differences of a model that are shown
_MOST_FILES = 5


@click.group()
def command() -> None:
    """Keep golden results, and judge later ones against them by the noise between seeds."""


@command.command("record")
@click.argument("out", type=click.Path(path_type=Path))
@click.argument("models", metavar="MODEL...", nargs=-1, required=True, type=click.Path(path_type=str))
@click.option(
    "-c", "--config", default="standard", show_default=True, metavar="CONFIG",
    help="A YAML file, which is copied into the baseline, or the name of a shipped config.",
)  # fmt: skip
@click.option(
    "--seeds", type=click.IntRange(min=1), default=5, show_default=True, metavar="N",
    help="How many seeds to run, from the config's own on: the more, the smaller a change that is found.",
)  # fmt: skip
@options.assignments
@options.quality
@options.seed
@options.steps
@options.faces
@options.workers
@click.option("--snapshots", "keep_snapshots", is_flag=True, help="Keep the last snapshot of each run too.")
@options.overwrite
@options.quiet
@options.as_json
@options.debug
def record(
    out: Path,
    models: tuple[str, ...],
    config: str,
    seeds: int,
    assignments: tuple[str, ...],
    quality: str | None,
    seed: int | None,
    steps: int | None,
    faces: int | None,
    workers: int | None,
    keep_snapshots: bool,
    overwrite: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Age each MODEL with several seeds, and keep what the runs came to in the folder OUT.

    It holds figures by age and seed, hashes of files, and a small picture of each model, but no meshes, so
    that it can be committed to a repository.

    \b
    weathercoat baseline record golden plate.obj chair.glb -c paint.yaml --faces 3000
    weathercoat baseline check golden
    """
    from weathercoat.cli.messages import Messages
    from weathercoat.comparison.baseline import BASELINE
    from weathercoat.comparison.golden import record_baseline

    shortcuts = options.shortcuts(quality=quality, seed=seed, steps=steps, faces=faces)
    with Messages(quiet=quiet or as_json) as messages:
        teller, executor = _teller_and_executor(messages, workers)
        record_baseline(
            out,
            models,
            executor,
            config=config,
            assignments=[*assignments, *(f"{item.key}={item.value}" for item in shortcuts)],
            seeds=seeds,
            keep_snapshots=keep_snapshots,
            overwrite=overwrite,
            begin=teller.begin,
            listen=teller,
        )
    if as_json:
        click.echo(json.dumps({"written": str(out / BASELINE)}, ensure_ascii=False))
    elif not quiet:
        size = sum(file.stat().st_size for file in out.rglob("*") if file.is_file())
        click.echo(f"{len(models)} models with {seeds} seeds each: {size / 1000:,.0f} kB")
        click.echo(f"written to {out / BASELINE}")


@command.command("check")
@click.argument("baseline", type=click.Path(path_type=Path))
@click.option(
    "--seeds", type=click.IntRange(min=1), metavar="N",
    help="How many seeds to run; all that were recorded, by default. One is quick, and finds large changes.",
)  # fmt: skip
@click.option("--exact", is_flag=True, help="Judge by the bytes of the files, not by figures and noise.")
@click.option(
    "--tolerance", "tolerance_file", type=click.Path(path_type=Path), metavar="FILE",
    help="A YAML file of what may differ, and by how much.",
)  # fmt: skip
@options.assignments
@options.workers
@options.quiet
@options.as_json
@options.debug
@click.pass_context
def check(
    context: click.Context,
    baseline: Path,
    seeds: int | None,
    exact: bool,
    tolerance_file: Path | None,
    assignments: tuple[str, ...],
    workers: int | None,
    quiet: bool,
    as_json: bool,
) -> None:
    """Run the models of the folder BASELINE again, and judge whether they still come to the same.

    Results of other bytes pass where their figures lie within the noise between seeds, unless --exact is
    given. The exit code is 0 where all models pass, and 1 where one does not.
    """
    from weathercoat.cli.messages import Messages
    from weathercoat.comparison.baseline import read_baseline
    from weathercoat.comparison.golden import check_baseline
    from weathercoat.comparison.tolerance import Tolerance, read_tolerance

    golden = read_baseline(baseline)
    tolerance = Tolerance() if tolerance_file is None else read_tolerance(tolerance_file)
    with Messages(quiet=quiet or as_json) as messages:
        teller, executor = _teller_and_executor(messages, workers)
        checks = check_baseline(
            golden,
            baseline,
            executor,
            seeds=seeds,
            exact=exact,
            tolerance=tolerance,
            assignments=assignments,
            begin=teller.begin,
            listen=teller,
        )
    is_passed = all(found.is_passed for found in checks)
    if as_json:
        content = {"passed": is_passed, "models": [_as_dict(found) for found in checks]}
        click.echo(json.dumps(content, indent=2, ensure_ascii=False))
    elif not quiet:
        for found in checks:
            click.echo("\n".join(_lines(found)))
    if not is_passed:
        context.exit(1)


def _teller_and_executor(messages: Any, workers: int | None) -> tuple[Any, Executor]:
    from weathercoat.cli.executing import Teller, make_executor, pool_size
    from weathercoat.memory import memory_limit

    size = pool_size("processes", workers)
    return Teller(messages, as_json=False), make_executor("processes", size, None, memory_limit(None))


def _lines(check: Check) -> Iterator[str]:
    """What a person reads about one model."""
    state = "passes" if check.is_passed else "fails"
    yield f"{check.name}: {state}: {check.judgement.verdict}: {check.judgement.method}"
    yield from (f"  {note}" for note in check.notes)
    for run, files in check.differing.items():
        more = f" and {len(files) - _MOST_FILES} more" if len(files) > _MOST_FILES else ""
        yield f"  {run}: other bytes in {', '.join(files[:_MOST_FILES])}{more}"
    beyond = [row for row in check.judgement.differences if row.is_beyond]
    if beyond:
        yield f"  {'figure':20} {'age':>5} {'baseline':>10} {'now':>10} {'difference':>10} {'allowed':>10}"
    for row in sorted(beyond, key=lambda row: -abs(row.difference) / row.allowed)[:_MOST_ROWS]:
        numbers = " ".join(f"{value:10.4g}" for value in (row.a, row.b, row.difference, row.allowed))
        yield f"  {row.figure:20} {row.age:5.2f} {numbers}"
    if len(beyond) > _MOST_ROWS:
        yield f"  and {len(beyond) - _MOST_ROWS} more"


def _as_dict(check: Check) -> dict[str, Any]:
    return {
        "name": check.name,
        "passed": check.is_passed,
        "verdict": check.judgement.verdict,
        "method": check.judgement.method,
        "notes": list(check.notes),
        "other_bytes": {run: list(files) for run, files in check.differing.items()},
        "differences": [vars(row) for row in check.judgement.differences],
    }
