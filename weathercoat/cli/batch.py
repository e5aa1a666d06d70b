"""`weathercoat batch`: age many models."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from weathercoat.cli import options
from weathercoat.errors import BatchError, UsageError

_MOST_ROWS = 50  # of the table at the end; batch.json has all
_MOST_NAMES = 5  # of the message about what failed


@click.command()
@click.argument("jobs", nargs=-1, required=True)
@click.option(
    "-c", "--config", default="standard", show_default=True, metavar="CONFIG",
    help="A YAML file or the name of a shipped config.",
)  # fmt: skip
@click.option(
    "-o", "--output", type=click.Path(path_type=str), default="batch", show_default=True, metavar="PATH",
    help="Folder of the results: one for each job, and batch.json.",
)  # fmt: skip
@options.workers
@options.assignments
@options.quality
@options.seed
@options.steps
@options.faces
@click.option(
    "--matrix", multiple=True, metavar="KEY=V1,V2,...",
    help="Run each model with each of these values of a key, or of `config`; several make every combination.",
)  # fmt: skip
@click.option(
    "--vary", multiple=True, metavar="KEY=DISTRIBUTION",
    help="Draw a key for each variant: uniform(a,b), log(a,b), normal(m,s), integer(a,b) or choice(x,y).",
)  # fmt: skip
@click.option("--variants", type=click.IntRange(min=1), metavar="N", help="Variants of each model.")
@click.option(
    "--names", type=click.Choice(["stem", "path"]), default="stem", show_default=True,
    help="What files that are given by themselves name their results by.",
)  # fmt: skip
@click.option(
    "-0", "--null", "null_separated", is_flag=True,
    help="The list on standard input has NUL between its lines.",
)  # fmt: skip
@click.option(
    "--executor", "kind", type=click.Choice(["processes", "in-process", "dask"]), default="processes",
    show_default=True, help="What runs the jobs.",
)  # fmt: skip
@click.option("--scheduler", metavar="ADDRESS", help="Address of the Dask scheduler, with --executor dask.")
@click.option(
    "--dry-run", is_flag=True, help="Say what would be run and what it would cost, and run nothing."
)
@click.option("--fail-fast", is_flag=True, help="End the batch at the first job that fails.")
@options.portable
@options.max_memory
@options.no_check
@options.quiet
@options.as_json
@options.log_file
@options.debug
def command(
    jobs: tuple[str, ...],
    config: str,
    output: str,
    workers: int | None,
    assignments: tuple[str, ...],
    quality: str | None,
    seed: int | None,
    steps: int | None,
    faces: int | None,
    matrix: tuple[str, ...],
    vary: tuple[str, ...],
    variants: int | None,
    names: str,
    null_separated: bool,
    kind: str,
    scheduler: str | None,
    dry_run: bool,
    fail_fast: bool,
    max_memory: int | None,
    check: bool,
    quiet: bool,
    as_json: bool,
    log_file: Path | None,
) -> None:
    """Age many models: JOBS are model files, directories, globs in quotes, URLs, manifests (YAML or CSV), or
    - for a list on standard input.

    Each job gets a folder of its name in the folder of the batch. A job that fails is reported, and the
    others go on; the exit code is 8 then. What is done already, with the same input, config and version, is
    not done again.

    \b
    weathercoat batch models/ -c rusting -o aged
    weathercoat batch chair.obj -o study --matrix curl.radius=0.02,0.05,0.1
    weathercoat batch 'parts/*.ply' -o data --variants 20 --vary 'lift.coefficient=uniform(0.2,0.4)'
    """
    from weathercoat.batch.batch import run_batch
    from weathercoat.batch.sources import collect_jobs
    from weathercoat.cli.executing import Teller, make_executor, pool_size, say_how_to_go_on
    from weathercoat.cli.messages import Messages
    from weathercoat.cli.pricing import price_lines, price_of
    from weathercoat.memory import memory_limit

    if (kind == "dask") != (scheduler is not None):
        raise UsageError(
            "--executor dask and --scheduler go together", remedy="name the address of the scheduler"
        )
    shortcuts = options.shortcuts(quality=quality, seed=seed, steps=steps, faces=faces)
    found = collect_jobs(
        jobs,
        config=config,
        overrides=[*assignments, *shortcuts],
        matrix=matrix,
        vary=vary,
        variants=variants,
        names=names,
        null_separated=null_separated,
        stdin=sys.stdin.buffer,
        out=Path(output),
    )
    size = pool_size(kind, workers)
    limit = memory_limit(max_memory)
    if dry_run:
        price = price_of(found, output, size, limit)
        click.echo(
            json.dumps(price, indent=2, ensure_ascii=False) if as_json else "\n".join(price_lines(price))
        )
        return
    if limit is not None and kind == "processes":
        max_memory = round(limit.bytes)  # of all workers, which do not ask again while others are at work
    with Messages(quiet=quiet or as_json, log_file=log_file) as messages, say_how_to_go_on(output):
        teller = Teller(messages, as_json=as_json)
        record = run_batch(
            found,
            output,
            make_executor(kind, size, scheduler, limit),
            workers=size,
            threads=options.threads_beside(size),
            check=check,
            max_memory=max_memory,
            fail_fast=fail_fast,
            begin=teller.begin,
            listen=teller,
        )
    if as_json:
        ending = {key: record[key] for key in ("state", "seconds", "counts")}
        click.echo(json.dumps({"event": "end", **ending}, ensure_ascii=False))
    elif not quiet:
        click.echo("\n".join([*_table(record), f"written to {output}"]))
    failed = [row["name"] for row in record["jobs"] if row["status"] == "failed"]
    if failed:
        listed = ", ".join(failed[:_MOST_NAMES]) + ", ..." * (len(failed) > _MOST_NAMES)
        raise BatchError(f"{len(failed)} of {len(found)} jobs failed: {listed}", file=output)


def _table(record: dict[str, Any]) -> Iterator[str]:
    """What became of the jobs, one line each where there are not too many, and how many of each kind."""
    rows = record["jobs"]
    if len(rows) > _MOST_ROWS:
        rows = [row for row in rows if row["status"] == "failed"][:_MOST_ROWS]
    width = max((len(row["name"]) for row in rows), default=4)
    if rows:
        head = f"{'job':{width}} {'status':>9} {'seconds':>8}"
        yield f"{head} {'separated':>10} {'lost':>7} {'flakes':>7} {'rust':>6}"
    for row in rows:
        line = f"{row['name']:{width}} {row['status']:>9} {row['seconds']:8.1f}"
        if row["figures"]:
            figures = row["figures"]
            line += f" {figures['separated_share']:10.1%} {figures['lost_share']:7.1%}"
            line += f" {figures['flakes']['count']:7d} {figures['substrate_rust']:6.2f}"
        elif row["error"]:
            line += f"  {row['error']['code']}"
        yield line
    counts = ", ".join(f"{count} {status}" for status, count in record["counts"].items() if count)
    yield f"{len(record['jobs'])} jobs: {counts}; {record['seconds']:.1f} s"
