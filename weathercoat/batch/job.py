"""What a batch is made of: jobs, the tasks that executors get, and the events that come back.

All of it is plain data that can be pickled, so that a task runs the same in this process, in another, or on
another machine.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

from weathercoat.config.load import LoadedConfig

Status = Literal["done", "unchanged", "failed", "dropped"]


@dataclass(frozen=True)
class Job:
    """One run of a batch.

    name: where its folder lies below that of the batch, `chair` or `chairs/oak/v0002`: safe file names with
    slashes between them, different from those of all other jobs. asset: path or URL of the model. format:
    overrules its content and extension.
    """

    name: str
    asset: str
    loaded: LoadedConfig
    format: str | None = None


@dataclass(frozen=True)
class Task:
    """A job with what an executor needs to run it.

    target: path or URL of the folder of its results. memory, seconds: what it is expected to take, in bytes
    at the peak and on one core. threads: how many share a step's work. check: whether the result is verified.
    max_memory: bytes beyond which the job is refused; None for what its process may use.
    """

    job: Job
    target: str
    memory: float
    seconds: float
    threads: int = 1
    check: bool = True
    max_memory: int | None = None


@dataclass(frozen=True)
class Progress:
    """So many steps of a job are done; `name` is the job's."""

    name: str
    done: int
    total: int


@dataclass(frozen=True)
class Outcome:
    """How a job ended.

    status: `done`; `unchanged`, where its result was there already; `failed`; or `dropped`, where the batch
    ended before it. seconds: of work on it, 0 where there was none. figures: of its last snapshot, as in
    `run.json`. error: as `WeathercoatError.as_dict` gives it. messages: what it said, a line each. attempts:
    how often it was begun, more than once where a worker was lost.
    """

    name: str
    status: Status
    seconds: float = 0.0
    figures: Mapping[str, Any] | None = None
    error: Mapping[str, Any] | None = None
    messages: tuple[str, ...] = field(default=())
    attempts: int = 1


class Executor(Protocol):
    """Runs tasks."""

    def run(self, tasks: Sequence[Task]) -> Iterator[Progress | Outcome]:
        """Run all tasks, in their order as far as memory allows, and yield what happens as it happens: one
        outcome a task, in whatever order they end.

        A task that fails is an outcome, no exception. To close the iterator stops what runs; work that can be
        gone on from is kept where the tasks have their targets.
        """
        ...
