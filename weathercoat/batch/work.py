"""What a worker does with a task, in whatever process it is: one asset from file to finished folder."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from weathercoat.batch.job import Outcome, Task
from weathercoat.errors import CorruptError, ResumeError, WeathercoatError, internal_error
from weathercoat.run import run_asset
from weathercoat.sim.recorders import Patience


def do_task(
    task: Task, progress: Callable[[int, int], None] | None = None, patience: Patience | None = None
) -> Outcome:
    """Run a task and return how it ended; only what stops the whole process is raised.

    What an interrupted run of the same job has left is gone on from; the result of another one, such as with
    a config that has changed since, is replaced once the new one is whole.
    """
    messages: list[str] = []
    started = time.perf_counter()

    def run(*, resume: bool) -> Outcome:
        report = run_asset(
            task.job.loaded,
            task.job.asset,
            Path(task.target),
            format=task.job.format,
            resume=resume,
            overwrite=not resume,
            check=task.check,
            threads=task.threads,
            max_memory=task.max_memory,
            progress=progress,
            log=messages.append,
            patience=patience,
        )
        figures = report["snapshots"][-1] if report["snapshots"] else None
        return Outcome(task.job.name, "done", time.perf_counter() - started, figures, None, tuple(messages))

    try:
        Path(task.target).parent.mkdir(parents=True, exist_ok=True)
        try:
            return run(resume=True)
        except (ResumeError, CorruptError) as found:
            if not _is_within(found.file, task.target):
                raise
            return run(resume=False)
    except Exception as raised:
        error = raised if isinstance(raised, WeathercoatError) else internal_error(raised)
        seconds = time.perf_counter() - started
        return Outcome(task.job.name, "failed", seconds, None, error.as_dict(), tuple(messages))


def _is_within(file: str | None, target: str) -> bool:
    """Whether an error is about what an earlier run has left, in its folder or its working folder."""
    return file is not None and str(Path(file).absolute()).startswith(str(Path(target).resolve()))
