"""`weathercoat batch` as it is typed: what it prints, its exit codes, and what is left after a kill."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.batch.jobs import result_bytes
from tests.batch.test_processes import children, is_running, needs_proc
from weathercoat.cli.handler import call
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.output.meshes import write_mesh

SMALL = [
    "--set",
    "remesh=off",
    "--set",
    "output.preview=false",
    "--steps",
    "30",
    "--set",
    "snapshots.count=2",
]
INLINE = ["--executor", "in-process"]


@pytest.fixture
def models(tmp_path: Path) -> Path:
    """A folder of three models."""
    folder = tmp_path / "models"
    folder.mkdir()
    for name, faces in (("a", 60), ("b", 80), ("c", 100)):
        write_mesh(folder / f"{name}.obj", make_random_sheet(faces))
    return folder


def test_a_folder_of_models(models: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert call(["batch", str(models), "-o", str(out), *SMALL, *INLINE]) == 0
    printed = capsys.readouterr()
    assert "3 jobs: 3 done" in printed.out
    assert printed.out.splitlines()[1].split()[:2] == ["a", "done"]
    assert "b: done in" in printed.err
    assert call(["batch", str(models), "-o", str(out), *SMALL, *INLINE]) == 0
    assert "3 jobs: 3 unchanged" in capsys.readouterr().out


def test_a_failure_is_told_and_ends_with_8(
    models: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (models / "b.obj").write_text("v 0 0 0\nf 1 2 3\n")
    out = tmp_path / "out"
    assert call(["batch", str(models), "-o", str(out), *SMALL, *INLINE]) == 8
    printed = capsys.readouterr()
    assert "3 jobs: 2 done, 1 failed" in printed.out
    assert "E-BATCH: 1 of 3 jobs failed: b;" in printed.err
    assert "b: failed: " in printed.err
    assert "E-CORRUPT" in printed.err
    assert (out / "a" / "run.json").is_file()
    write_mesh(models / "b.obj", make_random_sheet(50), overwrite=True)
    assert call(["batch", str(models), "-o", str(out), *SMALL, *INLINE]) == 0
    assert "1 done, 2 unchanged" in capsys.readouterr().out


def test_json_lines(models: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (models / "c.obj").write_text("")
    assert call(["batch", str(models), "-o", str(tmp_path / "out"), *SMALL, *INLINE, "--json"]) == 8
    printed = capsys.readouterr()
    *jobs, end = [json.loads(line) for line in printed.out.splitlines()]
    assert {(job["name"], job["status"]) for job in jobs} == {("a", "done"), ("b", "done"), ("c", "failed")}
    assert end["event"] == "end"
    assert end["counts"]["failed"] == 1
    assert json.loads(printed.err)["error"]["exit_code"] == 8


def test_a_dry_run_runs_nothing(models: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert call(["batch", str(models), "-o", str(out), *SMALL, "--dry-run", "-j", "2"]) == 0
    printed = capsys.readouterr().out
    assert "3 of 3 jobs to do" in printed
    assert not out.exists()
    assert call(["batch", str(models), "-o", str(out), *SMALL, "--dry-run", "--json"]) == 0
    price = json.loads(capsys.readouterr().out)
    assert [job["name"] for job in price["jobs"]] == ["a", "b", "c"]
    assert price["seconds"] > 0
    assert price["disk"] > 0


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--executor", "dask"], "--scheduler"),
        (["--scheduler", "tcp://127.0.0.1:1"], "--executor dask"),
        (["--set", "curl.radios=1"], "curl.radios"),
        (["--variants", "0"], "variants"),
    ],
)
def test_what_is_refused(
    more: list[str], words: str, models: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(["batch", str(models), "-o", str(tmp_path / "out"), *more]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def start(models: Path, out: Path, *more: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "weathercoat", "batch", str(models), "-o", str(out), "-j", "2", *more]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@needs_proc
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_a_batch_that_was_stopped_goes_on(how: signal.Signals, models: Path, tmp_path: Path) -> None:
    more = [*SMALL, "--steps", "2000", "--set", "checkpoint.steps=500"]
    expected, out = tmp_path / "expected", tmp_path / "out"
    assert start(models, expected, *more).wait() == 0
    batch = start(models, out, *more)
    deadline = time.monotonic() + 120
    while not list(out.glob("[a-z]/run.json")):
        assert time.monotonic() < deadline
        assert batch.poll() is None
        time.sleep(0.01)
    workers = children(batch.pid)
    batch.send_signal(how)
    _, said = batch.communicate()
    codes = {signal.SIGKILL: -signal.SIGKILL, signal.SIGINT: 130, signal.SIGTERM: 143}
    assert batch.returncode == codes[how] or (
        batch.returncode == 0 and len(list(out.glob("[a-z]/run.json"))) == 3
    )
    if batch.returncode > 0:
        assert f"what is done is kept in {out}; give the same command again to go on" in said
    while any(is_running(worker) for worker in workers):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    finished = {path: path.stat().st_ino for path in out.glob("[a-z]/run.json")}
    assert start(models, out, *more).wait() == 0
    for name in "abc":
        assert result_bytes(out / name) == result_bytes(expected / name)
    assert {path: path.stat().st_ino for path in finished} == finished
    assert not list(out.glob("*.partial"))


@needs_proc
@pytest.mark.long
def test_kills_at_random_moments(models: Path, tmp_path: Path) -> None:
    for number in range(12):
        write_mesh(models / f"more_{number}.obj", make_random_sheet(100 + 10 * number))
    more = [*SMALL, "--steps", "500", "--set", "checkpoint.steps=100"]
    expected = tmp_path / "expected"
    began = time.monotonic()
    assert start(models, expected, *more).wait() == 0
    whole = time.monotonic() - began
    draw = random.Random(6)
    for number in range(8):
        out = tmp_path / f"out_{number}"
        batch = start(models, out, *more)
        time.sleep(draw.uniform(0, whole))
        os.kill(batch.pid, signal.SIGKILL)
        batch.communicate()
        finished = {path: path.stat().st_ino for path in out.glob("*[!l]/run.json")}
        assert start(models, out, *more).wait() == 0
        assert {path: path.stat().st_ino for path in finished} == finished
        for run in expected.glob("*[!l]/run.json"):
            assert result_bytes(out / run.parent.name) == result_bytes(run.parent)
