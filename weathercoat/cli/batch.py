"""`weathercoat batch`: age many models."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from weathercoat.cli import options
from weathercoat.errors import BatchError, UsageError

if TYPE_CHECKING:
    from weathercoat.batch.job import Executor, Job, Outcome, Progress, Task
    from weathercoat.memory import MemoryLimit

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
    from weathercoat.cli.messages import Messages
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
        _say_price(found, output, size, limit, as_json=as_json)
        return
    if limit is not None and kind == "processes":
        max_memory = round(limit.bytes)  # of all workers, which do not ask again while others are at work
    with Messages(quiet=quiet or as_json, log_file=log_file) as messages:
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


def pool_size(kind: str, workers: int | None) -> int:
    from weathercoat.deform.team import usable_cores

    return 1 if kind == "in-process" else workers or usable_cores()


def make_executor(kind: str, size: int, scheduler: str | None, limit: MemoryLimit | None) -> Executor:
    from weathercoat.batch.processes import InlineExecutor, ProcessExecutor

    if kind == "in-process":
        from weathercoat.cli.signals import Patience

        return InlineExecutor(Patience)
    if kind == "dask":
        from weathercoat.batch.cluster import DaskExecutor

        assert scheduler is not None
        return DaskExecutor(scheduler)
    return ProcessExecutor(size, float("inf") if limit is None else limit.bytes)


class Teller:
    """Tells of each event: a line for each job that has ended, and a bar over all work in between."""

    def __init__(self, messages: Any, *, as_json: bool) -> None:
        self._messages = messages
        self._as_json = as_json
        self._expected: dict[str, float] = {}
        self._shares: dict[str, float] = {}
        self._ended = 0

    def begin(self, tasks: Sequence[Task]) -> None:
        """Learn what there is to do."""
        self._expected = {task.job.name: max(task.seconds, 0.1) for task in tasks}

    def __call__(self, event: Progress | Outcome) -> None:
        """Tell of an event."""
        from weathercoat.batch.job import Outcome

        if isinstance(event, Outcome):
            self._shares[event.name] = 1.0
            self._ended += event.name in self._expected
            self._tell_end(event)
        else:
            self._shares[event.name] = event.done / event.total
        if self._expected:
            known = (self._expected.get(name, 0.0) * share for name, share in self._shares.items())
            self._messages.share(
                sum(known) / sum(self._expected.values()), f"{self._ended} of {len(self._expected)} jobs"
            )

    def _tell_end(self, outcome: Outcome) -> None:
        if self._as_json:
            click.echo(json.dumps({"event": "job", **_as_dict(outcome)}, ensure_ascii=False))
            return
        for line in outcome.messages:
            self._messages.log(f"{outcome.name}: {line}")
        if outcome.status != "unchanged":
            self._messages.log(_line(outcome))


def _as_dict(outcome: Outcome) -> dict[str, Any]:
    from dataclasses import asdict

    return {**asdict(outcome), "seconds": round(outcome.seconds, 3)}


def _line(outcome: Outcome) -> str:
    if outcome.error is not None:
        error = outcome.error
        where = f"{error['file']}: " if error["file"] else ""
        return f"{outcome.name}: failed: {where}{error['code']}: {error['message']}; {error['remedy']}"
    return f"{outcome.name}: {outcome.status} in {outcome.seconds:.1f} s" + "".join(
        f", {text}" for text in _figures(outcome.figures)
    )


def _figures(figures: Any) -> Iterator[str]:
    if figures:
        yield f"{figures['separated_share']:.0%} separated"
        yield f"{figures['lost_share']:.0%} lost"


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


def _say_price(
    jobs: Sequence[Job], output: str, workers: int, limit: MemoryLimit | None, *, as_json: bool
) -> None:
    """What a batch would do and take, without running it."""
    from weathercoat.batch.batch import sort_out
    from weathercoat.batch.price import price_job, seconds_together, total_price
    from weathercoat.cost import in_megabytes

    unchanged, left = sort_out(jobs, output)
    prices = {job.name: price_job(job) for job in left}
    total = total_price(prices)
    seconds = seconds_together(list(prices.values()), workers)
    too_large = [name for name, price in prices.items() if limit and price.memory > limit.bytes]
    if as_json:
        content = {
            "jobs": [
                {"name": name, **{key: round(value, 1) for key, value in price._asdict().items()}}
                for name, price in prices.items()
            ],
            "unchanged": len(unchanged),
            "workers": workers,
            "seconds": round(seconds, 1),
            "seconds_of_work": round(total.seconds, 1),
            "largest_memory": round(total.memory),
            "disk": round(total.disk),
            "too_large": too_large,
        }
        click.echo(json.dumps(content, indent=2, ensure_ascii=False))
        return
    shown = sorted(prices.items(), key=lambda item: -item[1].seconds)[:_MOST_ROWS]
    width = max((len(name) for name, _ in shown), default=4)
    if shown:
        click.echo(f"{'job':{width}} {'seconds':>8} {'memory':>10} {'disk':>10}")
    for name, price in shown:
        memory, disk = in_megabytes(price.memory), in_megabytes(price.disk)
        click.echo(f"{name:{width}} {price.seconds:8.1f} {memory:>10} {disk:>10}")
    if len(prices) > len(shown):
        click.echo(f"... and {len(prices) - len(shown)} that take less")
    click.echo(
        f"{len(left)} of {len(jobs)} jobs to do: about {_duration(seconds)} with {workers} workers, "
        f"{in_megabytes(total.disk)} on disk, {in_megabytes(total.memory)} of memory for the largest"
    )
    for name in too_large:
        click.echo(f"{name} needs more memory than there is")


def _duration(seconds: float) -> str:
    """A time for people."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
