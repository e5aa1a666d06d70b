"""The worker process of a batch: takes tasks from standard input and tells what happens on standard output.

It is no command for people; `weathercoat.batch.processes` starts it.
"""

from __future__ import annotations

import os
import pickle
import sys
from functools import partial
from queue import SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, BinaryIO, NoReturn

from weathercoat.cli import prepare_process
from weathercoat.cli.signals import Patience, Stopped
from weathercoat.unfinished import clear_all

if TYPE_CHECKING:
    from weathercoat.batch.job import Outcome, Progress, Task


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
        from weathercoat.batch.work import SparingProgress, do_task

        while True:
            task = tasks.get()
            progress = SparingProgress(partial(_tell_progress, events_out, task.job.name))
            _tell(events_out, do_task(task, progress, Patience()))
    except (Stopped, BrokenPipeError) as stopped:
        sys.stderr = None  # type: ignore[assignment]  # who asked has no need of words
        code = stopped.exit_code if isinstance(stopped, Stopped) else 1
    os._exit(code)


def _tell(stream: BinaryIO, event: Progress | Outcome) -> None:
    pickle.dump(event, stream)
    stream.flush()


def _tell_progress(stream: BinaryIO, name: str, done: int, total: int) -> None:
    from weathercoat.batch.job import Progress

    _tell(stream, Progress(name, done, total))


def _receive(stream: BinaryIO, tasks: SimpleQueue[Task]) -> None:
    try:
        while True:
            tasks.put(pickle.load(stream))
    except Exception:  # however the input ends, nobody waits for results
        clear_all()
        os._exit(0)
