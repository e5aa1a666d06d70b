"""Worker processes: the same bytes, memory that is shared out, and workers that are lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from threading import Timer

import pytest

from tests.batch.jobs import make_broken_job, make_job, make_task, result_bytes
from weathercoat.batch.job import Outcome, Progress
from weathercoat.batch.processes import InlineExecutor, ProcessExecutor
from weathercoat.batch.work import do_task
from weathercoat.lock import FolderLock

needs_proc = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds children in /proc")


def children(pid: int) -> list[int]:
    """The processes that a process has started."""
    tasks = Path(f"/proc/{pid}/task").iterdir()
    return [int(child) for task in tasks for child in (task / "children").read_text().split()]


def test_processes_give_the_bytes_of_this_process(tmp_path: Path) -> None:
    jobs = [make_job(tmp_path, "a"), make_job(tmp_path, "b", "seed=2"), make_broken_job(tmp_path, "c")]
    ends = {}
    for name, executor in (("inline", InlineExecutor()), ("processes", ProcessExecutor(2))):
        tasks = [make_task(job, tmp_path / name) for job in jobs]
        outcomes = [event for event in executor.run(tasks) if isinstance(event, Outcome)]
        ends[name] = {outcome.name: outcome.status for outcome in outcomes}
    assert ends["inline"] == ends["processes"] == {"a": "done", "b": "done", "c": "failed"}
    for name in ("a", "b"):
        assert result_bytes(tmp_path / "inline" / name) == result_bytes(tmp_path / "processes" / name)


def test_what_does_not_fit_together_runs_one_after_the_other(tmp_path: Path) -> None:
    tasks = [make_task(make_job(tmp_path, name), tmp_path / "out", memory=6e8) for name in "abcd"]
    running: set[str] = set()
    for event in ProcessExecutor(3, memory=1e9).run(tasks):
        if isinstance(event, Progress):
            running.add(event.name)
            assert len(running) == 1
        else:
            running.discard(event.name)
            assert event.status == "done"


def test_a_task_larger_than_memory_runs_by_itself(tmp_path: Path) -> None:
    tasks = [make_task(make_job(tmp_path, "a"), tmp_path / "out", memory=2e9)]
    (outcome,) = (event for event in ProcessExecutor(2, memory=1e9).run(tasks) if isinstance(event, Outcome))
    assert outcome.status == "done"


@needs_proc
@pytest.mark.parametrize("kills", [1, 2])
def test_a_worker_that_is_lost_is_replaced(kills: int, tmp_path: Path) -> None:
    job = make_job(tmp_path, "a", "ageing.steps=100000", faces=300)
    short = make_job(tmp_path, "b")
    outcomes = []
    before = set(children(os.getpid()))
    killed = 0
    for event in ProcessExecutor(1).run([make_task(job, tmp_path), make_task(short, tmp_path)]):
        if isinstance(event, Outcome):
            outcomes.append(event)
        elif event.name == "a" and killed < kills:
            (worker,) = set(children(os.getpid())) - before
            os.kill(worker, signal.SIGKILL)
            killed += 1
        elif event.name == "a":
            break  # it runs again; to wait for its end would take long
    if kills == 2:
        assert {outcome.name: outcome.status for outcome in outcomes} == {"a": "failed", "b": "done"}
        failed = next(outcome for outcome in outcomes if outcome.name == "a")
        assert failed.error is not None
        assert failed.error["code"] == "E-WORKER"
        assert "SIGKILL" in failed.error["message"]
        assert failed.attempts == 2
    else:
        assert [outcome.name for outcome in outcomes] == ["b"]  # the other comes first
    assert set(children(os.getpid())) == before


@needs_proc
def test_workers_end_with_the_process_that_is_killed(tmp_path: Path) -> None:
    make_job(tmp_path, "a", faces=300)
    program = f"""
from pathlib import Path
from tests.batch.jobs import make_job, make_task
from weathercoat.batch.processes import ProcessExecutor
here = Path({str(tmp_path)!r})
tasks = [make_task(make_job(here, name, "ageing.steps=100000", faces=300), here) for name in "ab"]
for event in ProcessExecutor(2).run(tasks):
    print(event.name, flush=True)
"""
    parent = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    assert parent.stdout.readline()
    workers = children(parent.pid)
    assert len(workers) == 2
    parent.kill()
    parent.wait()
    deadline = time.monotonic() + 60
    while any(is_running(worker) for worker in workers):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_a_task_waits_for_who_is_at_its_target(tmp_path: Path) -> None:
    job = make_job(tmp_path, "a")
    lock = FolderLock(tmp_path / "a.partial")
    (tmp_path / "a.partial").mkdir()
    assert lock.take()
    assert do_task(make_task(job, tmp_path), seconds_to_wait=0.0).error["code"] == "E-BUSY"
    timer = Timer(0.5, lambda: lock.release(remove=False))
    timer.start()
    assert do_task(make_task(job, tmp_path)).status == "done"
    timer.join()


def is_running(pid: int) -> bool:
    """Whether a process is there, and no zombie that nobody has asked about."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
