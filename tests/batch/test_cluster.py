"""A Dask cluster of a real scheduler and real worker processes on loopback, some of which are killed."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from threading import Thread, Timer

import pytest

import weathercoat
from tests.batch.jobs import make_broken_job, make_job, make_task, result_bytes
from weathercoat.batch.cluster import DaskExecutor
from weathercoat.batch.job import Job, Outcome, Task
from weathercoat.batch.processes import InlineExecutor
from weathercoat.errors import ClusterError, UsageError
from weathercoat.output.folder import CHECKPOINT_STATE, RunFolder

Client = pytest.importorskip("distributed").Client

pytestmark = pytest.mark.skipif(os.name == "nt", reason="workers are killed by signals")


class Cluster:
    """A scheduler with its file in a folder, and worker processes that a test starts and ends."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.file = folder / "scheduler.json"
        self.processes: list[subprocess.Popen[bytes]] = []
        self.scheduler = self._start("dask_scheduler", "--host", "127.0.0.1", "--port", "0")
        while not self.file.exists():
            assert self.scheduler.poll() is None
            time.sleep(0.05)
        while True:
            with contextlib.suppress(ValueError):
                self.address = json.loads(self.file.read_text())["address"]
                break

    def start_worker(
        self, *, threads: int = 1, memory: str = "2GB", program: tuple[str, ...] = ()
    ) -> subprocess.Popen[bytes]:
        return self._start(
            "dask_worker",
            *("--nthreads", str(threads), "--memory-limit", memory, "--no-nanny"),
            *("--host", "127.0.0.1", "--local-directory", str(self.folder)),
            program=program,
        )

    def _start(self, name: str, *options: str, program: tuple[str, ...] = ()) -> subprocess.Popen[bytes]:
        start = program or ("-m", f"distributed.cli.{name}")
        command = [sys.executable, *start, "--scheduler-file", str(self.file), "--no-dashboard", *options]
        with (self.folder / "log").open("ab") as log:
            process = subprocess.Popen(command, stdout=log, stderr=log)
        self.processes.append(process)
        return process

    def wait_for_workers(self, count: int) -> None:
        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(count, timeout=60)

    def end(self) -> None:
        for process in self.processes:
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    folder = tmp_path / "cluster"
    folder.mkdir()
    cluster = Cluster(folder)
    yield cluster
    cluster.end()


def slow_job(folder: Path, name: str, *overrides: str) -> Job:
    """A job of a second or more, with a checkpoint every 50 steps."""
    return make_job(folder, name, "ageing.steps=2000", "checkpoint.steps=50", *overrides, faces=2000)


def outcomes_of(tasks: list[Task], cluster: Cluster) -> dict[str, Outcome]:
    events = DaskExecutor(cluster.address).run(tasks)
    return {event.name: event for event in events if isinstance(event, Outcome)}


def expected_bytes(task: Task, folder: Path) -> dict[str, bytes]:
    """The result of a task in this process."""
    (outcome,) = InlineExecutor().run([replace(task, target=str(folder / task.job.name))])
    assert outcome.status == "done"
    return result_bytes(folder / task.job.name)


def test_a_worker_is_killed_and_the_bytes_are_those_of_this_process(cluster: Cluster, tmp_path: Path) -> None:
    workers = [cluster.start_worker(), cluster.start_worker()]
    cluster.wait_for_workers(2)
    jobs = [slow_job(tmp_path, name, f"seed={seed}") for seed, name in enumerate("abc")]
    tasks = [make_task(job, tmp_path / "out") for job in (*jobs, make_broken_job(tmp_path, "none"))]
    on_the_way: set[str] = set()
    outcomes = {}
    for event in DaskExecutor(cluster.address).run(tasks):
        if isinstance(event, Outcome):
            outcomes[event.name] = event
            on_the_way.discard(event.name)
        elif event.done > 100:
            assert (tmp_path / "out" / f"{event.name}.partial" / CHECKPOINT_STATE).exists()
            on_the_way.add(event.name)
            if len(on_the_way) == 2 and workers[0].poll() is None:
                workers[0].kill()
                workers[0].wait()
    assert workers[0].returncode == -signal.SIGKILL
    assert sorted(outcomes) == ["a", "b", "c", "none"]
    assert [outcomes[name].status for name in "abc"] == ["done"] * 3
    assert sorted(outcomes[name].attempts for name in "abc") == [1, 1, 2]
    assert outcomes["none"].error is not None and outcomes["none"].error["code"] == "E-ACCESS"
    again = next(outcome for outcome in outcomes.values() if outcome.attempts == 2)
    assert any("going on from step" in line for line in again.messages)
    for task in tasks[:3]:
        assert result_bytes(Path(task.target)) == expected_bytes(task, tmp_path / "here")


def test_the_command_takes_relative_paths(cluster: Cluster, tmp_path: Path) -> None:
    """Workers have other working directories."""
    cluster.start_worker()
    task = make_task(make_job(tmp_path, "sheet_100"), tmp_path / "out")
    config = tmp_path / "small.yaml"
    config.write_text(
        "remesh: off\nsnapshots: {count: 2}\noutput: {preview: false}\nageing: {steps: 30}\n",
        encoding="utf-8",
    )
    command = ["batch", "sheet_100.obj", "-c", config.name, "-o", "out", "--executor", "dask"]
    done = subprocess.run(
        [sys.executable, "-m", "weathercoat", *command, "--scheduler", "cluster/scheduler.json"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path(weathercoat.__file__).parents[1])},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert result_bytes(Path(task.target)) == expected_bytes(task, tmp_path / "here")


def test_two_tasks_at_once_in_one_process_give_the_same_bytes(cluster: Cluster, tmp_path: Path) -> None:
    cluster.start_worker(threads=2)
    pictures = (
        "output.preview=true",
        "output.picture_width=64",
        "output.picture_height=48",
        "remesh=on",
        "remesh.faces=300",
    )
    tasks = [
        make_task(make_job(tmp_path, f"{name}{seed}", f"seed={seed}", *settings, faces=300), tmp_path / "out")
        for seed in range(3)
        for name, settings in (("pictures", pictures), ("newton", ("deformation.solver=newton",)))
    ]
    outcomes = outcomes_of(tasks, cluster)
    assert [outcome.error for outcome in outcomes.values()] == [None] * 6
    for task in tasks:
        assert result_bytes(Path(task.target)) == expected_bytes(task, tmp_path / "here")


def test_a_task_that_kills_its_workers_fails_and_others_do_not(cluster: Cluster, tmp_path: Path) -> None:
    """Workers with two threads each: whatever runs beside the killer is begun again, the last time alone."""
    deadly = tmp_path / "deadly.py"
    deadly.write_text(
        "import os, signal, sys\n"
        "from weathercoat.batch import work\n"
        "run_asset = work.run_asset\n"
        "def kill(loaded, model, *rest, **more):\n"
        "    if 'sheet_101' in str(model):\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "    return run_asset(loaded, model, *rest, **more)\n"
        "work.run_asset = kill\n"
        "from distributed.cli.dask_worker import main\n"
        "main()\n"
    )
    for _ in range(4):
        cluster.start_worker(threads=2, program=(str(deadly),))
    jobs = [make_job(tmp_path, "deadly", faces=101), *(make_job(tmp_path, name) for name in "abcd")]
    outcomes = outcomes_of([make_task(job, tmp_path / "out") for job in jobs], cluster)
    assert {name: outcomes[name].status for name in "abcd"} == dict.fromkeys("abcd", "done")
    error = outcomes["deadly"].error
    assert outcomes["deadly"].attempts == 3
    assert error is not None and error["code"] == "E-WORKER" and "3 times" in error["message"]


def test_memory_of_workers_is_not_overrun(cluster: Cluster, tmp_path: Path) -> None:
    """What does not fit together runs one after the other; what fits on no worker fails, and what is behind
    it does not wait.
    """
    cluster.start_worker(threads=4, memory="1GB")
    tasks = [make_task(make_job(tmp_path, name), tmp_path / "out", memory=5e8) for name in "abc"]
    tasks.insert(1, make_task(make_job(tmp_path, "large"), tmp_path / "out", memory=2e9))
    running: set[str] = set()
    outcomes = {}
    for event in DaskExecutor(cluster.address).run(tasks):
        if isinstance(event, Outcome):
            running.discard(event.name)
            outcomes[event.name] = event
        else:
            running.add(event.name)
            assert len(running) == 1
    assert {name: outcomes[name].status for name in "abc"} == dict.fromkeys("abc", "done")
    error = outcomes["large"].error
    assert error is not None and error["code"] == "E-LIMIT" and "900 MB" in error["message"]


def test_what_another_process_is_writing_is_waited_for(cluster: Cluster, tmp_path: Path) -> None:
    cluster.start_worker()
    task = make_task(make_job(tmp_path, "a"), tmp_path / "out")
    (tmp_path / "out").mkdir()
    ended: list[float] = []

    def write() -> None:
        with unseen:
            time.sleep(3.0)
            unseen.abandon()
            ended.append(time.monotonic())

    unseen = RunFolder(task.target, resume=True)
    writer = Thread(target=write)
    writer.start()
    outcomes = outcomes_of([task], cluster)
    assert ended and outcomes["a"].status == "done" and outcomes["a"].attempts == 1
    writer.join()
    assert result_bytes(Path(task.target)) == expected_bytes(task, tmp_path / "here")


def test_closing_the_events_stops_the_workers_and_keeps_their_work(cluster: Cluster, tmp_path: Path) -> None:
    cluster.start_worker()
    job = make_job(tmp_path, "a", "ageing.steps=20000", "checkpoint.minutes=0", faces=2000)
    task = make_task(job, tmp_path / "out")
    with contextlib.closing(DaskExecutor(cluster.address).run([task])) as events:
        assert next(event for event in events if event.done > 0)
    partial = tmp_path / "out" / "a.partial"
    deadline = time.monotonic() + 20.0
    while not (partial / CHECKPOINT_STATE).exists():
        assert time.monotonic() < deadline
        time.sleep(0.1)


def test_a_worker_of_another_version_is_not_used(cluster: Cluster, tmp_path: Path) -> None:
    other = tmp_path / "other.py"
    other.write_text(
        "from weathercoat.output import report\n"
        "from distributed.cli.dask_worker import main\n"
        "versions = report.versions\n"
        "report.versions = lambda: {**versions(), 'numpy': '1.0.0'}\n"
        "main()\n"
    )
    cluster.start_worker(program=(str(other),))
    task = make_task(make_job(tmp_path, "a"), tmp_path / "out")
    with pytest.raises(ClusterError, match=r"differs: numpy 1\.0\.0, here ") as caught:
        outcomes_of([task], cluster)
    assert caught.value.exit_code == 8
    cluster.start_worker()
    cluster.wait_for_workers(2)
    assert outcomes_of([task], cluster)["a"].status == "done"


@pytest.mark.parametrize(
    ("scheduler", "kind", "says"),
    [
        ("127.0.0.1:1", ClusterError, "cannot be reached"),
        ("nowhere", UsageError, "no address of a scheduler"),
        ("quux://127.0.0.1:1", UsageError, "unknown address scheme"),
    ],
)
def test_a_scheduler_that_is_not_there_is_one_line(
    scheduler: str, kind: type[Exception], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("weathercoat.batch.cluster.SECONDS_TO_CONNECT", 1.0)
    task = make_task(make_job(tmp_path, "a"), tmp_path / "out")
    with pytest.raises(kind, match=says) as caught:
        list(DaskExecutor(scheduler).run([task]))
    assert "\n" not in str(caught.value)


def test_a_cluster_without_workers_and_one_that_ends_are_one_line(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("weathercoat.batch.cluster.SECONDS_TO_CONNECT", 1.0)
    task = make_task(make_job(tmp_path, "a"), tmp_path / "out")
    executor = DaskExecutor(str(cluster.file), seconds_without_workers=0.5)
    with pytest.raises(ClusterError, match="no workers for"):
        list(executor.run([task]))
    Timer(1.0, cluster.scheduler.kill).start()
    with pytest.raises(ClusterError, match="lost"):
        list(DaskExecutor(str(cluster.file)).run([task]))


@pytest.mark.long
def test_a_worker_that_comes_back_does_no_harm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is stopped until the scheduler has given it up and its task to another, and then goes on."""
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL", "4s")
    folder = tmp_path / "cluster"
    folder.mkdir()
    cluster = Cluster(folder)
    try:
        workers = [cluster.start_worker(), cluster.start_worker()]
        cluster.wait_for_workers(2)
        tasks = [make_task(slow_job(tmp_path, name), tmp_path / "out") for name in "ab"]
        on_the_way: set[str] = set()
        outcomes = {}
        for event in DaskExecutor(cluster.address).run(tasks):
            if isinstance(event, Outcome):
                outcomes[event.name] = event
            elif len(on_the_way) < 2:
                on_the_way.add(event.name)
                if len(on_the_way) == 2:
                    workers[0].send_signal(signal.SIGSTOP)
                    Timer(12.0, workers[0].send_signal, [signal.SIGCONT]).start()
        assert sorted(outcome.attempts for outcome in outcomes.values()) == [1, 2]
        for task in tasks:
            assert result_bytes(Path(task.target)) == expected_bytes(task, tmp_path / "here")
        assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a", "b"]
    finally:
        cluster.end()
