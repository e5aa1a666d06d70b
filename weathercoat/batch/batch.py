"""A batch: many jobs into one folder. What is done and unchanged stays; the others run, the longest first."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from weathercoat.batch.job import Executor, Job, Outcome, Progress, Task
from weathercoat.batch.price import price_job
from weathercoat.batch.record import RECORD, Record
from weathercoat.batch.storage import is_url, join, put_file, read_report
from weathercoat.errors import AccessError, ConfigError, OutputError
from weathercoat.lock import FolderLock
from weathercoat.masks.files import hash_masks
from weathercoat.output.folder import output_errors
from weathercoat.resume import fingerprint, missing_files
from weathercoat.run import hash_inputs

_LOCK = ".batch.lock"  # no job has a name like this

Listener = Callable[[Progress | Outcome], None]


def run_batch(
    jobs: Sequence[Job],
    out: str | Path,
    executor: Executor,
    *,
    workers: int = 1,
    threads: int = 1,
    check: bool = True,
    max_memory: int | None = None,
    fail_fast: bool = False,
    begin: Callable[[Sequence[Task]], None] | None = None,
    listen: Listener | None = None,
) -> dict[str, Any]:
    """Run jobs into folders of their names in `out`, and return the content of its `batch.json`.

    workers: how many run at once, for the record. threads: of each. check: whether results are verified.
    max_memory: bytes beyond which a job is refused. fail_fast: the first failure ends the batch, and what
    has not ended is dropped. begin: called with what is to be done, without what is unchanged. listen:
    called with each event. A job that fails is in the record, and raises nothing. Raises OutputError where
    `out` cannot be written, or another batch is at it. Where `out` is a URL, which cannot be locked,
    `batch.json` is written at the end.
    """
    listen = listen or (lambda event: None)
    with _folder_of_record(str(out)) as folder:
        unchanged, left = sort_out(jobs, out)
        prices = {job.name: price_job(job) for job in left}
        tasks = [
            Task(job, join(str(out), job.name), price.memory, price.seconds, threads, check, max_memory)
            for job, price in ((job, prices[job.name]) for job in left)
        ]
        tasks.sort(key=lambda task: -task.seconds)
        record = Record(folder, jobs, prices, workers)
        record.write()
        state = "stopped"
        try:
            for outcome in unchanged:
                record.note_outcome(outcome)
                listen(outcome)
            if begin:
                begin(tasks)
            if _run(tasks, executor, record, listen, fail_fast=fail_fast):
                state = "finished"
        finally:
            content = record.end(state)
        return content


def _run(
    tasks: Sequence[Task], executor: Executor, record: Record, listen: Listener, *, fail_fast: bool
) -> bool:
    """Whether all tasks have ended, and none of them early because another failed."""
    if not tasks:
        return True
    with contextlib.closing(executor.run(tasks)) as events:  # type: ignore[type-var]
        for event in events:
            if isinstance(event, Progress):
                record.note_progress(event.name, event.done, event.total)
            else:
                record.note_outcome(event)
            listen(event)
            if fail_fast and isinstance(event, Outcome) and event.status == "failed":
                return False
    return True


def sort_out(jobs: Sequence[Job], out: str | Path) -> tuple[list[Outcome], list[Job]]:
    """Outcomes of the jobs whose results are in `out` and unchanged, and the jobs that are left to do."""
    unchanged, left = [], []
    inputs: dict[str, dict[str, str]] = {}
    for job in jobs:
        figures = _finished_figures(join(str(out), job.name), job, inputs)
        if figures is None:
            left.append(job)
        else:
            unchanged.append(Outcome(job.name, "unchanged", figures=figures, attempts=0))
    return unchanged, left


def _finished_figures(target: str, job: Job, inputs: dict[str, dict[str, str]]) -> dict[str, Any] | None:
    """The last figures of the finished run at a target, where it is that of the job; else None, as for a
    model at a URL, which only whoever fetches it can tell.
    """
    if is_url(job.asset):
        return None
    report = read_report(target)
    if report is None:
        return None
    try:
        found, snapshots = report["fingerprint"], report["snapshots"]
        if job.asset not in inputs:
            inputs[job.asset] = hash_inputs(Path(job.asset))
        if found != fingerprint(job.loaded, {**inputs[job.asset], **hash_masks(job.loaded)}):
            return None
        if not is_url(target) and missing_files(Path(target), report):
            return None
        return dict(snapshots[-1])
    except (ValueError, KeyError, TypeError, IndexError, AccessError, ConfigError):
        return None


@contextlib.contextmanager
def _folder_of_record(out: str) -> Iterator[Path]:
    """The folder of a batch, for nobody else; for a URL one whose record goes there at the end."""
    if is_url(out):
        with TemporaryDirectory(prefix="weathercoat-") as aside:
            try:
                yield Path(aside)
            finally:
                if Path(aside, RECORD).is_file():
                    put_file(Path(aside, RECORD), join(out, RECORD))
        return
    folder = Path(out)
    with output_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    with _sole_use(folder):
        yield folder


@contextlib.contextmanager
def _sole_use(folder: Path) -> Iterator[None]:
    """Keep other batches out of a folder."""
    lock = FolderLock(folder, _LOCK)
    with output_errors(folder):
        is_mine = lock.take()
    if not is_mine:
        raise OutputError("another batch is writing it", file=str(folder))
    try:
        yield
    finally:
        lock.release(remove=True)
