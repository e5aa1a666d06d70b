"""The worker process of a batch: takes tasks from standard input and tells what happens on standard output.

It is no command for people; `weathercoat.batch.processes` starts it.
"""

from __future__ import annotations

import os
import pickle
import sys
import time
from queue import SimpleQueue
from threading import Lock, Thread
from typing import TYPE_CHECKING, BinaryIO, NoReturn

from weathercoat.cli import prepare_process
from weathercoat.cli.signals import Patience, Stopped
from weathercoat.unfinished import clear_all

if TYPE_CHECKING:
    from weathercoat.batch.job import Outcome, Progress, Task

_SECONDS_BETWEEN_PROGRESS = 0.2


def serve() -> NoReturn:
    """Do tasks until standard input ends, then end the process, clearing away what is half-written."""
    tasks_in = os.fdopen(os.dup(0), "rb")
    events_out = os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "rb") as nothing:  # noqa: PTH123
        os.dup2(nothing.fileno(), 0)
    os.dup2(2, 1)  # what a library prints is no event
    prepare_process()
    tasks: SimpleQueue[Task] = SimpleQueue()
    Thread(target=_receive, args=(tasks_in, tasks), daemon=True).start()
    try:
        from weathercoat.batch.work import do_task

        say = _Teller(events_out)
        while True:
            task = tasks.get()
            say(do_task(task, say.progress_of(task.job.name), Patience()))
    except (Stopped, BrokenPipeError) as stopped:
        sys.stderr = None  # type: ignore[assignment]  # who asked has no need of words
        code = stopped.exit_code if isinstance(stopped, Stopped) else 1
    os._exit(code)


class _Teller:
    """Writes events, progress not too often."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._lock = Lock()

    def __call__(self, event: Progress | Outcome) -> None:
        with self._lock:
            pickle.dump(event, self._stream)
            self._stream.flush()

    def progress_of(self, name: str) -> _ProgressOf:
        """What to call with the steps done of a job and their number."""
        return _ProgressOf(self, name)


class _ProgressOf:
    def __init__(self, say: _Teller, name: str) -> None:
        self._say, self._name = say, name
        self._next = 0.0

    def __call__(self, done: int, total: int) -> None:
        from weathercoat.batch.job import Progress

        now = time.monotonic()
        if now >= self._next:
            self._next = now + _SECONDS_BETWEEN_PROGRESS
            self._say(Progress(self._name, done, total))


def _receive(stream: BinaryIO, tasks: SimpleQueue[Task]) -> None:
    try:
        while True:
            tasks.put(pickle.load(stream))
    except Exception:  # however the input ends, nobody waits for results
        clear_all()
        os._exit(0)
