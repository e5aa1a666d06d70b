"""Executors of one machine: in this process, and in worker processes of their own.

A worker is started once and gets task after task, so that what a start costs is paid once a worker and not
once an asset. Tasks and events go through its standard input and output as pickles. It ends when its input
does: at the end, and when the process that started it is killed.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from queue import SimpleQueue
from threading import Thread

from weathercoat.batch.job import Outcome, Progress, Task
from weathercoat.batch.work import do_task
from weathercoat.errors import WorkerError
from weathercoat.sim.recorders import Patience

MOST_ATTEMPTS = 2
SECONDS_TO_STOP = 1.5  # a worker ends its step, keeps its state, and clears up
_WORKER = "weathercoat.cli.worker"


class InlineExecutor:
    """Runs tasks in this process, one after another. patience: makes, for each, what is entered while its
    steps are made.
    """

    def __init__(self, patience: Callable[[], Patience] | None = None) -> None:
        self._patience = patience

    def run(self, tasks: Sequence[Task]) -> Iterator[Outcome]:
        """See `batch.job.Executor`."""
        for task in tasks:
            yield do_task(task, patience=self._patience() if self._patience else None)


@dataclass
class _Attempt:
    task: Task
    number: int = 1

    @property
    def memory(self) -> float:
        """What it may need: a task that has lost a worker is tried again with all memory to itself."""
        return self.task.memory if self.number == 1 else float("inf")


@dataclass(frozen=True)
class _Gone:
    """A worker has ended."""


class _Worker:
    """A worker process; what it says goes to `events` as pairs of itself and an event."""

    def __init__(self, events: SimpleQueue[tuple[_Worker, Progress | Outcome | _Gone]]) -> None:
        self.attempt: _Attempt | None = None
        start = f"import sys; sys.path[:] = {sys.path!r}; from {_WORKER} import serve; serve()"
        self._process = subprocess.Popen(
            [sys.executable, "-c", start],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C in a terminal is for the process that tells the workers to stop
        )
        Thread(target=self._listen, args=(events,), daemon=True).start()

    def begin(self, attempt: _Attempt) -> None:
        """Hand out a task; where the worker has gone meanwhile, its end is an event to come."""
        self.attempt = attempt
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):
            pickle.dump(attempt.task, self._process.stdin)
            self._process.stdin.flush()

    def ask_to_stop(self) -> None:
        """Let it keep what it has and end."""
        assert self._process.stdin is not None
        if self.attempt is not None:
            self._process.terminate()
        else:
            self._close_input()

    def end(self) -> str:
        """Wait for its end, or make one; returns how it ended, in words."""
        try:
            self._process.wait(SECONDS_TO_STOP)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._close_input()
        code = self._process.returncode
        if code >= 0:
            return f"exit code {code}"
        return signal.Signals(-code).name if os.name == "posix" else f"code {code}"

    def _close_input(self) -> None:
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # what was to be flushed is for nobody
            self._process.stdin.close()

    def _listen(self, events: SimpleQueue[tuple[_Worker, Progress | Outcome | _Gone]]) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as stream:
            try:
                while True:
                    events.put((self, pickle.load(stream)))
            except (EOFError, OSError, pickle.UnpicklingError):
                events.put((self, _Gone()))


class ProcessExecutor:
    """Runs tasks in up to `workers` processes, as many at a time as fit into `memory` bytes together.

    A worker that is lost, such as to a lack of memory, is replaced, and its task tried again by itself.
    """

    def __init__(self, workers: int, memory: float = float("inf")) -> None:
        self._size = workers
        self._memory = memory

    def run(self, tasks: Sequence[Task]) -> Iterator[Progress | Outcome]:
        """See `batch.job.Executor`."""
        waiting = [_Attempt(task) for task in tasks]
        events: SimpleQueue[tuple[_Worker, Progress | Outcome | _Gone]] = SimpleQueue()
        workers: list[_Worker] = []
        try:
            while waiting or any(worker.attempt for worker in workers):
                self._hand_out(waiting, workers, events)
                worker, event = events.get()
                attempt = worker.attempt
                if isinstance(event, _Gone):
                    workers.remove(worker)
                    how = worker.end()
                    if attempt is None:
                        continue
                    if attempt.number < MOST_ATTEMPTS:
                        waiting.append(_Attempt(attempt.task, attempt.number + 1))
                    else:
                        yield _lost(attempt, how)
                elif isinstance(event, Outcome):
                    worker.attempt = None
                    yield replace(event, attempts=attempt.number if attempt else 1)
                else:
                    yield event
        finally:
            for worker in workers:
                worker.ask_to_stop()
            for worker in workers:
                worker.end()

    def _hand_out(
        self,
        waiting: list[_Attempt],
        workers: list[_Worker],
        events: SimpleQueue[tuple[_Worker, Progress | Outcome | _Gone]],
    ) -> None:
        """Give idle workers, and new ones, the first tasks that fit beside what runs."""
        while True:
            running = [worker.attempt for worker in workers if worker.attempt]
            idle = [worker for worker in workers if not worker.attempt]
            if not idle and len(workers) == self._size:
                return
            free = self._memory - sum(attempt.memory for attempt in running)
            fitting = (i for i, attempt in enumerate(waiting) if attempt.memory <= free or not running)
            place = next(fitting, None)
            if place is None:
                return
            if not idle:
                idle = [_Worker(events)]
                workers += idle
            idle[0].begin(waiting.pop(place))


def _lost(attempt: _Attempt, how: str) -> Outcome:
    error = WorkerError(
        f"its worker process ended with {how}, {attempt.number} times", file=attempt.task.job.name
    )
    return Outcome(attempt.task.job.name, "failed", error=error.as_dict(), attempts=attempt.number)
