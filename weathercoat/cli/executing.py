"""Running jobs from the command line: what runs them, and what is told while they run."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from weathercoat.cli.signals import Patience, Stopped

if TYPE_CHECKING:
    from weathercoat.batch.job import Executor, Outcome, Progress, Task
    from weathercoat.cli.messages import Messages
    from weathercoat.memory import MemoryLimit


def pool_size(kind: str, workers: int | None) -> int:
    """How many jobs run at once at most."""
    from weathercoat.deform.team import usable_cores

    return 1 if kind == "in-process" else workers or usable_cores()


def make_executor(kind: str, size: int, scheduler: str | None, limit: MemoryLimit | None) -> Executor:
    """The executor of a kind of `weathercoat batch --executor`; limit: memory of all workers together."""
    from weathercoat.batch.processes import InlineExecutor, ProcessExecutor

    if kind == "in-process":
        return InlineExecutor(Patience)
    if kind == "dask":
        from weathercoat.batch.cluster import DaskExecutor

        assert scheduler is not None
        return DaskExecutor(scheduler)
    return ProcessExecutor(size, float("inf") if limit is None else limit.bytes)


@contextmanager
def say_how_to_go_on(folder: str) -> Iterator[None]:
    """Note on a signal that ends the block that what is done stays, and how to go on."""
    try:
        yield
    except Stopped as stopped:
        stopped.add_note(f"what is done is kept in {folder}; give the same command again to go on")
        raise


class Teller:
    """Tells of each event: a line for each job that has ended, and a bar over all work in between."""

    def __init__(self, messages: Messages, *, as_json: bool) -> None:
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
            click.echo(json.dumps(_event(outcome), ensure_ascii=False))
            return
        for line in outcome.messages:
            self._messages.log(f"{outcome.name}: {line}")
        if outcome.status != "unchanged":
            self._messages.log(_line(outcome))


def _event(outcome: Outcome) -> dict[str, Any]:
    return {"event": "job", **asdict(outcome), "seconds": round(outcome.seconds, 3)}


def _line(outcome: Outcome) -> str:
    if outcome.error is not None:
        error = outcome.error
        where = f"{error['file']}: " if error["file"] else ""
        return f"{outcome.name}: failed: {where}{error['code']}: {error['message']}; {error['remedy']}"
    return f"{outcome.name}: {outcome.status} in {outcome.seconds:.1f} s" + "".join(
        f", {text}" for text in _figures(outcome.figures)
    )


def _figures(figures: Mapping[str, Any] | None) -> Iterator[str]:
    if figures:
        yield f"{figures['separated_share']:.0%} separated"
        yield f"{figures['lost_share']:.0%} lost"
