"""The executor of a Dask cluster: tasks on whatever workers its scheduler has, some of which are lost.

Each task is one future, bound to a worker that has a thread and memory to spare for it; nothing is queued
in the cluster, so that whatever a worker had when it was lost is what it had begun. A lost task is begun
again on another worker, and the last time alone, so that it is not charged with what runs beside it.

A worker that is lost to the scheduler may go on unseen. It stops at the end of a step once it learns of it.
Who gets its task meanwhile waits for the lock of the working folder, and then goes on from the checkpoint
in it, or finds the result there. Either way the bytes are those of a run at once.
"""

from __future__ import annotations

import json
import logging
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, NoReturn
from uuid import uuid4

from weathercoat.batch.job import Outcome, Progress, Task
from weathercoat.batch.storage import is_url
from weathercoat.batch.work import SparingProgress, do_task
from weathercoat.cost import in_megabytes
from weathercoat.errors import (
    ClusterError,
    LimitError,
    UsageError,
    WorkerError,
    internal_error,
)

if TYPE_CHECKING:
    from distributed import Client, Future
    from distributed import Worker as DaskWorker

MOST_ATTEMPTS = 3
SECONDS_TO_CONNECT = 10.0
SECONDS_WITHOUT_WORKERS = 60.0
_SECONDS_BETWEEN_LOOKS = 1.0
_SECONDS_OF_A_CALL = 10.0
_SECONDS_BETWEEN_TRIES = 0.2
_PROCESSOR = "processor"
_SHARE_OF_MEMORY = 0.9  # a nanny ends its worker at 0.95


class DaskExecutor:
    """Runs tasks on the workers of a Dask cluster, as many at a time as they have threads and memory for.

    scheduler: its address, `tcp://10.0.0.1:8786`, or the path of the `.json` that it was told to write.
    Workers that join are used; those with another version of weathercoat or its libraries are not.
    seconds_without_workers: how long workers are waited for where there are none.
    """

    def __init__(self, scheduler: str, *, seconds_without_workers: float = SECONDS_WITHOUT_WORKERS) -> None:
        self._scheduler = scheduler
        self._seconds_without_workers = seconds_without_workers

    def run(self, tasks: Sequence[Task]) -> Iterator[Progress | Outcome]:
        """See `batch.job.Executor`.

        Raises UsageError where Dask is not installed or the scheduler's address is none, and ClusterError
        where it cannot be reached or is lost, and where there are no workers that can run tasks.
        """
        if not tasks:
            return
        with _connected(self._scheduler) as client:
            here = [_from_anywhere(task) for task in tasks]
            yield from _Dispatch(client, self._scheduler, here, self._seconds_without_workers).events()


@dataclass
class _Attempt:
    """A task, how often it was begun, and where it runs."""

    task: Task
    number: int = 0
    future: Future | None = None

    @property
    def is_last(self) -> bool:
        return self.number >= MOST_ATTEMPTS - 1


@dataclass
class _Worker:
    """A process of the cluster. is_fit: whether it can run tasks, None as long as it has not answered;
    remark: how it differs; is_open: whether it takes tasks now.
    """

    address: str
    process: str
    threads: int
    memory: float
    is_fit: bool | None = None
    remark: str = ""
    is_open: bool = True
    running: dict[str, _Attempt] = field(default_factory=dict)

    @property
    def free_threads(self) -> int:
        taken = sum(min(attempt.task.threads, self.threads) for attempt in self.running.values())
        return self.threads - taken if self.is_fit and self.is_open else 0

    @property
    def free_memory(self) -> float:
        return self.memory - sum(attempt.task.memory for attempt in self.running.values())

    def has_room(self, attempt: _Attempt) -> bool:
        """Whether a task can be begun beside what runs."""
        is_kept_alone = any(other.number >= MOST_ATTEMPTS for other in self.running.values())
        if self.running and (attempt.is_last or is_kept_alone):
            return False
        threads = min(attempt.task.threads, self.threads)
        return 0 < threads <= self.free_threads and attempt.task.memory <= self.free_memory


class _Dispatch:
    """Hands tasks out to workers and takes in what becomes of them."""

    def __init__(
        self, client: Client, scheduler: str, tasks: Sequence[Task], seconds_without_workers: float
    ) -> None:
        self._client = client
        self._scheduler = scheduler
        self._waiting = deque(_Attempt(task) for task in tasks)
        self._workers: dict[str, _Worker] = {}
        self._asked: dict[str, tuple[_Worker, Future]] = {}
        self._signals: SimpleQueue[tuple[str, tuple[int, int] | None]] = SimpleQueue()
        self._topic = _new_key("progress")
        self._remarks: list[str] = []
        self._seconds_without_workers = seconds_without_workers
        self._workers_seen = time.monotonic()

    def events(self) -> Iterator[Progress | Outcome]:
        """What happens, until all tasks have ended."""
        self._client.subscribe_topic(self._topic, self._hear)
        next_look = 0.0
        while self._waiting or any(worker.running for worker in self._workers.values()):
            if time.monotonic() >= next_look:
                yield from self._look()
                next_look = time.monotonic() + _SECONDS_BETWEEN_LOOKS
            yield from self._hand_out()
            try:
                key, steps = self._signals.get(timeout=max(next_look - time.monotonic(), 0.01))
            except Empty:
                continue
            if key in self._asked:
                self._note_versions(*self._asked.pop(key))
            else:
                yield from self._take(key, steps)

    def _hear(self, event: tuple[float, dict[str, Any]]) -> None:
        """Pass on the progress of a worker."""
        message = event[1]
        self._signals.put((message["key"], (message["done"], message["total"])))

    def _submit(self, key: str, worker: _Worker, function: Callable[..., Any], *arguments: Any) -> Future:
        future = self._client.submit(
            function, *arguments, key=key, workers=[worker.address], allow_other_workers=False, pure=False
        )
        future.add_done_callback(lambda done: self._signals.put((key, None)))
        return future

    def _look(self) -> Iterator[Outcome]:
        """See which workers there are; takes tasks from those that are lost."""
        if self._client.status not in ("running", "connecting"):
            raise ClusterError("the connection to the scheduler is lost", file=self._scheduler)
        try:
            identity = self._client.sync(
                self._client.scheduler.identity, n_workers=-1, callback_timeout=_SECONDS_OF_A_CALL
            )
        except OSError:  # the client is trying to connect again, and closes where it cannot
            return
        found = identity["workers"]
        for worker in list(self._workers.values()):
            if found.get(worker.address, {}).get("local_directory") != worker.process:
                del self._workers[worker.address]
                for attempt in worker.running.values():
                    yield from self._lose(attempt)
        for address, about in found.items():
            if address not in self._workers:
                self._meet(address, about)
            self._workers[address].is_open = about["status"] == "running"
        self._require_workers()

    def _meet(self, address: str, about: dict[str, Any]) -> None:
        """Take in a new worker, and ask it for its versions."""
        limit = about["memory_limit"]  # 0 or None for no limit
        memory = _SHARE_OF_MEMORY * limit if limit else float("inf")
        worker = _Worker(address, about["local_directory"], about["nthreads"], memory)
        self._workers[address] = worker
        key = _new_key("versions")
        self._asked[key] = worker, self._submit(key, worker, _make_question())

    def _note_versions(self, worker: _Worker, answer: Future) -> None:
        """Learn whether a worker can run tasks; how it differs is told with the next outcome."""
        if answer.status not in ("finished", "error"):  # it was lost before it answered
            return
        here = _make_question()()
        try:
            there = answer.result(timeout=_SECONDS_OF_A_CALL)
        except Exception as error:
            worker.is_fit = False
            self._remark(worker, f"lacks weathercoat: {type(error).__name__}: {error}")
            return
        names = [name for name in sorted(here.keys() | there) if there.get(name) != here.get(name)]
        worker.is_fit = names in ([], [_PROCESSOR])
        if names:
            apart = ", ".join(f"{name} {there.get(name)}, here {here.get(name)}" for name in names)
            but = "; without --portable its results may differ in last bits" if worker.is_fit else ""
            self._remark(worker, f"differs: {apart}{but}")

    def _remark(self, worker: _Worker, what: str) -> None:
        worker.remark = f"worker {worker.address} {what}"
        self._remarks.append(worker.remark)

    def _require_workers(self) -> None:
        """Raise ClusterError where no worker can run tasks, or none has been there for too long."""
        workers = list(self._workers.values())
        if workers and all(worker.is_fit is False for worker in workers):
            raise ClusterError(
                f"no worker can run the jobs: {workers[0].remark}",
                file=self._scheduler,
                remedy="install the same versions there, and start the workers in the same environment",
            )
        if workers:
            self._workers_seen = time.monotonic()
        elif time.monotonic() > self._workers_seen + self._seconds_without_workers:
            raise ClusterError(
                f"the scheduler has had no workers for {self._seconds_without_workers:g} s",
                file=self._scheduler,
                remedy="start some with `dask worker` and its address, and run the batch again",
            )

    def _hand_out(self) -> Iterator[Outcome]:
        """Begin the first tasks that fit on a worker. One that fits nowhere now keeps a worker for itself,
        which gets nothing else until it does.
        """
        able = [worker for worker in self._workers.values() if worker.is_fit is not False]
        open_ones = able.copy()
        kept: list[_Attempt] = []
        while self._waiting and any(worker.free_threads for worker in open_ones):
            attempt = self._waiting.popleft()
            large = [worker for worker in able if worker.memory >= attempt.task.memory]
            if not large:
                yield self._too_large(attempt, max(worker.memory for worker in able))
                continue
            roomy = [worker for worker in open_ones if worker.has_room(attempt)]
            if roomy:
                self._begin(attempt, max(roomy, key=lambda worker: worker.free_threads))
                continue
            if not kept:
                held = max(large, key=lambda worker: worker.free_memory)
                open_ones.remove(held)
            kept.append(attempt)
        self._waiting.extendleft(reversed(kept))

    def _begin(self, attempt: _Attempt, worker: _Worker) -> None:
        key = _new_key("task")
        attempt.number += 1
        worker.running[key] = attempt
        attempt.future = self._submit(key, worker, work, attempt.task, self._topic)

    def _take(self, key: str, steps: tuple[int, int] | None) -> Iterator[Progress | Outcome]:
        """Take in that a task has made steps or ended; what is heard of a lost attempt does not count."""
        worker = next((worker for worker in self._workers.values() if key in worker.running), None)
        if worker is None:
            return
        attempt = worker.running[key]
        if steps is not None:
            yield Progress(attempt.task.job.name, *steps)
            return
        assert attempt.future is not None
        try:
            outcome = attempt.future.result(timeout=_SECONDS_OF_A_CALL)
        except TimeoutError:  # it has ended, and its worker with it: the next look tells
            self._signals.put((key, None))
            return
        except BaseException as error:
            outcome = self._ended_otherwise(attempt, error)
        del worker.running[key]
        if outcome is None or outcome.status == "dropped":
            yield from self._lose(attempt)
        else:
            if attempt.number > 1 and outcome.status == "unchanged":  # by an attempt that was taken for lost
                outcome = replace(outcome, status="done")
            yield self._with_remarks(replace(outcome, attempts=attempt.number))

    def _ended_otherwise(self, attempt: _Attempt, error: BaseException) -> Outcome | None:
        """The outcome of a task that raised an error; None where it was not the task that did."""
        from asyncio import CancelledError as AsyncCancelledError
        from concurrent.futures import CancelledError

        from distributed import KilledWorker

        if isinstance(error, (CancelledError, AsyncCancelledError, KilledWorker)):
            return None
        if not isinstance(error, Exception):
            raise error
        return Outcome(attempt.task.job.name, "failed", error=internal_error(error).as_dict())

    def _lose(self, attempt: _Attempt) -> Iterator[Outcome]:
        """Let a task that was lost with its worker begin again soon, or fail."""
        if attempt.future is not None:
            attempt.future.release()
        if attempt.number < MOST_ATTEMPTS:
            self._waiting.appendleft(attempt)
            return
        name = attempt.task.job.name
        error = WorkerError(f"the workers that ran it were lost, {attempt.number} times", file=name)
        yield self._with_remarks(Outcome(name, "failed", error=error.as_dict(), attempts=attempt.number))

    def _too_large(self, attempt: _Attempt, largest: float) -> Outcome:
        name = attempt.task.job.name
        error = LimitError(
            f"it needs about {in_megabytes(attempt.task.memory)} of memory, and the largest worker has "
            f"{in_megabytes(largest)}",
            file=name,
            remedy="start workers with a larger --memory-limit, or ask for fewer faces",
        )
        return self._with_remarks(Outcome(name, "failed", error=error.as_dict(), attempts=attempt.number))

    def _with_remarks(self, outcome: Outcome) -> Outcome:
        remarks, self._remarks = self._remarks, []
        return replace(outcome, messages=(*outcome.messages, *remarks))


@contextmanager
def _connected(scheduler: str) -> Iterator[Client]:
    """A client of the cluster; what it has begun is cancelled at the end of the block."""
    try:
        from distributed import Client
        from distributed.comm import get_address_host_port
    except ImportError:
        raise UsageError("Dask is not installed", remedy="pip install 'weathercoat[dask]'") from None
    address = _read_address(scheduler)
    try:
        get_address_host_port(address)  # for the address of no known kind, a client waits without end
    except ValueError as error:
        raise UsageError(
            f"{scheduler!r} is no address of a scheduler: {error}",
            remedy="give one such as tcp://10.0.0.1:8786",
        ) from None
    logger = logging.getLogger("distributed.client")  # says on its own what is raised here
    was_disabled, logger.disabled = logger.disabled, True
    try:
        try:
            client = Client(address, timeout=SECONDS_TO_CONNECT, set_as_default=False, name="weathercoat")
        except OSError as error:
            reason = " ".join(str(error).split())
            raise ClusterError(f"the scheduler cannot be reached: {reason}", file=scheduler) from None
        try:
            yield client
        finally:
            client.close()
    finally:
        logger.disabled = was_disabled


def _read_address(scheduler: str) -> str:
    """The address of a scheduler, which may be given by the file that it writes when it starts."""
    if not scheduler.endswith(".json"):
        return scheduler
    until = time.monotonic() + SECONDS_TO_CONNECT
    while True:
        try:
            return str(json.loads(Path(scheduler).read_bytes())["address"])
        except (OSError, ValueError, KeyError, TypeError):
            if time.monotonic() > until:
                raise ClusterError("no scheduler has written this file", file=scheduler) from None
        time.sleep(_SECONDS_BETWEEN_TRIES)


def _from_anywhere(task: Task) -> Task:
    """The task with whole paths: workers have working directories of their own."""
    job = task.job

    def whole(text: str) -> str:
        return text if is_url(text) else os.path.abspath(text)  # noqa: PTH100 (follows no links)

    return replace(task, job=replace(job, asset=whole(job.asset)), target=whole(task.target))


def _new_key(kind: str) -> str:
    return f"weathercoat_{kind}-{uuid4().hex}"


def _make_question() -> Callable[[], dict[str, str]]:
    """A function that tells what the bytes of a worker's results hang on; being local, it travels without
    this module, which the worker may lack.
    """

    def tell() -> dict[str, str]:
        from llvmlite.binding import get_host_cpu_name

        from weathercoat.output.report import versions

        found = versions()
        return {**found, "processor": found.get("target") or get_host_cpu_name()}

    return tell


class _Unwanted(BaseException):
    """The task has been cancelled, or its worker is going."""


class _Wanted:
    """Lets a task run, in a thread of a worker, for as long as that is wanted. See
    `sim.recorders.Patience`.
    """

    def __init__(self, worker: DaskWorker) -> None:
        self._worker = worker
        self._key = worker.get_current_task()

    @property
    def is_asked(self) -> bool:
        """Whether the task is to stop."""
        state = self._worker.state.tasks.get(self._key)
        is_running = self._worker.status.name in ("running", "paused", "closing_gracefully")
        return not is_running or state is None or state.state not in ("executing", "long-running")

    def stop(self) -> NoReturn:
        """End the task."""
        raise _Unwanted

    def __enter__(self) -> object:
        return self

    def __exit__(self, *error: Any) -> None:
        pass


def work(task: Task, topic: str) -> Outcome:
    """Do a task on a worker of the cluster, telling `topic` of its progress; `dropped` where it was
    cancelled.

    Where another process is at its target, such as one that was taken for lost, it waits until that has
    ended.
    """
    from distributed import get_worker

    worker = get_worker()
    wanted = _Wanted(worker)
    key = worker.get_current_task()

    def tell(done: int, total: int) -> None:
        worker.log_event(topic, {"key": key, "done": done, "total": total})

    try:
        return do_task(task, SparingProgress(tell), wanted, seconds_to_wait=60.0 + 10.0 * task.seconds)
    except _Unwanted:
        return Outcome(task.job.name, "dropped")
