"""What a worker does with a task, in whatever process it is: one asset from file to finished folder."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from weathercoat.batch.job import Job, Outcome, Status, Task
from weathercoat.batch.storage import fetch, is_url, publish, read_report
from weathercoat.errors import CorruptError, OutputBusyError, ResumeError, WeathercoatError, internal_error
from weathercoat.resume import fingerprint
from weathercoat.run import hash_job, run_asset
from weathercoat.sim.recorders import Patience

SECONDS_TO_WAIT = 10.0
_SECONDS_BETWEEN_TRIES = 0.2
_SECONDS_BETWEEN_PROGRESS = 0.2


class SparingProgress:
    """Passes on the steps done of a task and their number, but not more often than people can see."""

    def __init__(self, tell: Callable[[int, int], object]) -> None:
        self._tell = tell
        self._next = 0.0

    def __call__(self, done: int, total: int) -> None:
        now = time.monotonic()
        if now >= self._next:
            self._next = now + _SECONDS_BETWEEN_PROGRESS
            self._tell(done, total)


def do_task(
    task: Task,
    progress: Callable[[int, int], None] | None = None,
    patience: Patience | None = None,
    *,
    seconds_to_wait: float = SECONDS_TO_WAIT,
) -> Outcome:
    """Run a task and return how it ended; only what stops the whole process is raised.

    Where another process is at its target, such as the worker of a batch that was killed a moment ago, it
    waits until that has ended, up to `seconds_to_wait`.

    What an interrupted run of the same job has left is gone on from; the result of another one, such as with
    a config that has changed since, is replaced once the new one is whole. Models and targets at URLs go
    through temporary folders, so that there nothing is left to go on from; there, what is finished and
    unchanged stays.
    """
    messages: list[str] = []
    started = time.perf_counter()

    def run(model: str, out: Path) -> dict[str, Any]:
        def attempt(*, resume: bool) -> dict[str, Any]:
            return run_asset(
                task.job.loaded,
                model,
                out,
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

        out.parent.mkdir(parents=True, exist_ok=True)
        try:
            report = _when_free(lambda: attempt(resume=True), seconds_to_wait, patience)
        except (ResumeError, CorruptError) as found:
            if not _is_within(found.file, str(out)):
                raise
            return attempt(resume=False)
        if _is_found(report) and not _is_current(report, task.job, model):  # another version made it
            return attempt(resume=False)
        return report

    try:
        with _model_here(task.job) as model:
            report = _run_for_url(task, model, run) if is_url(task.target) else run(model, Path(task.target))
        figures = report["snapshots"][-1] if report["snapshots"] else None
        seconds = time.perf_counter() - started
        status: Status = "unchanged" if _is_found(report) else "done"
        return Outcome(task.job.name, status, seconds, figures, None, tuple(messages))
    except Exception as raised:
        error = raised if isinstance(raised, WeathercoatError) else internal_error(raised)
        seconds = time.perf_counter() - started
        return Outcome(task.job.name, "failed", seconds, None, error.as_dict(), tuple(messages))


def _when_free(
    attempt: Callable[[], dict[str, Any]], seconds: float, patience: Patience | None
) -> dict[str, Any]:
    """What an attempt returns, once no other process is at its target."""
    waits_until = time.monotonic() + seconds
    while True:
        try:
            return attempt()
        except OutputBusyError:
            if time.monotonic() > waits_until:
                raise
        time.sleep(_SECONDS_BETWEEN_TRIES)
        if patience is not None and patience.is_asked:
            patience.stop()


@contextmanager
def _model_here(job: Job) -> Iterator[str]:
    """The path of a job's model; of one at a URL, that of a copy, in whose errors the URL stands."""
    if not is_url(job.asset):
        yield job.asset
        return
    with TemporaryDirectory(prefix="weathercoat-") as folder:
        model = str(fetch(job.asset, Path(folder), job.format))
        try:
            yield model
        except WeathercoatError as error:
            if error.file == model:
                error.file = job.asset
            raise


def _run_for_url(task: Task, model: str, run: Callable[[str, Path], dict[str, Any]]) -> dict[str, Any]:
    """The report of the finished run at a task's URL, which is there already or is made."""
    found = read_report(task.target)
    if found is not None and _is_current(found, task.job, model):
        return found
    with TemporaryDirectory(prefix="weathercoat-") as folder:
        out = Path(folder, "run")
        try:
            report = run(model, out)
        except BaseException as error:
            error.__notes__ = []  # of what is kept in the temporary folder, which goes
            raise
        published = read_report(task.target)
        # who was taken for lost may have published it meanwhile
        if published is None or published.get("fingerprint") != report["fingerprint"]:
            publish(out, task.target)
        return report


def _is_found(report: dict[str, Any]) -> bool:
    """Whether a report was there already: what is made has a timing."""
    return "timing" not in report


def _is_current(report: dict[str, Any], job: Job, model: str) -> bool:
    """Whether a report is that of a job with a model at a path, by this version."""
    return bool(report.get("fingerprint") == fingerprint(job.loaded, hash_job(job.loaded, Path(model))))


def _is_within(file: str | None, target: str) -> bool:
    """Whether an error is about what an earlier run has left, in its folder or its working folder."""
    return file is not None and str(Path(file).absolute()).startswith(str(Path(target).resolve()))
