"""Batches: what runs, what is skipped, what fails, and what is told of it."""

from __future__ import annotations

import json
import shutil
import struct
from dataclasses import replace
from pathlib import Path

import pytest

from tests.batch.jobs import make_broken_job, make_job, result_bytes
from weathercoat.batch.batch import run_batch, sort_out
from weathercoat.batch.job import Outcome
from weathercoat.batch.processes import InlineExecutor
from weathercoat.errors import OutputError
from weathercoat.lock import FolderLock
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.output.meshes import write_mesh


def statuses(record: dict) -> dict[str, str]:
    return {row["name"]: row["status"] for row in record["jobs"]}


def test_a_failing_job_stops_no_other(tmp_path: Path) -> None:
    jobs = [make_job(tmp_path, "a"), make_broken_job(tmp_path, "b"), make_job(tmp_path, "c/d")]
    record = run_batch(jobs, tmp_path / "out", InlineExecutor())
    assert statuses(record) == {"a": "done", "b": "failed", "c/d": "done"}
    assert record == json.loads((tmp_path / "out" / "batch.json").read_text())
    failed = record["jobs"][1]
    assert failed["error"]["code"] == "E-ACCESS"
    assert not (tmp_path / "out" / "b").exists()
    assert (tmp_path / "out" / "c" / "d" / "run.json").is_file()
    assert record["state"] == "finished"


def test_the_first_failure_ends_a_batch_that_fails_fast(tmp_path: Path) -> None:
    jobs = [
        make_job(tmp_path, "short"),
        make_job(tmp_path, "failing", "ageing.steps=40", "paint.only=[wood]"),
        make_job(tmp_path, "long", "ageing.steps=50"),
    ]
    record = run_batch(jobs, tmp_path / "out", InlineExecutor(), fail_fast=True)
    assert record["state"] == "stopped"
    assert statuses(record) == {"long": "done", "failing": "failed", "short": "dropped"}


def test_what_is_done_and_unchanged_is_not_done_again(tmp_path: Path) -> None:
    out = tmp_path / "out"
    jobs = [make_job(tmp_path, "a"), make_job(tmp_path, "b", "seed=2")]
    run_batch(jobs, out, InlineExecutor())
    times = {path: path.stat().st_mtime_ns for path in out.rglob("*.ply")}
    record = run_batch(jobs, out, InlineExecutor())
    assert statuses(record) == {"a": "unchanged", "b": "unchanged"}
    assert record["jobs"][0]["figures"]["step"] == 30
    assert times == {path: path.stat().st_mtime_ns for path in out.rglob("*.ply")}


@pytest.mark.parametrize("change", ["config", "input", "file", "version"])
def test_what_has_changed_is_done_again(change: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "out"
    jobs = [make_job(tmp_path, "a"), make_job(tmp_path, "b", faces=50)]
    run_batch(jobs, out, InlineExecutor())
    match change:
        case "config":
            jobs[0] = make_job(tmp_path, "a", "lift.coefficient=0.5")
        case "input":
            shutil.copy(jobs[1].asset, jobs[0].asset)
        case "file":
            next((out / "a").rglob("*.ply")).unlink()
        case "version":
            monkeypatch.setattr("weathercoat.resume.versions", lambda: {"weathercoat": "another"})
    left = [job.name for job in sort_out(jobs, out)[1]]
    assert left == (["a", "b"] if change == "version" else ["a"])
    if change != "version":
        record = run_batch(jobs, out, InlineExecutor())
        assert statuses(record) == {"a": "done", "b": "unchanged"}
        fresh = run_batch(jobs, tmp_path / "fresh", InlineExecutor())
        assert statuses(fresh) == {"a": "done", "b": "done"}
        assert result_bytes(out / "a") == result_bytes(tmp_path / "fresh" / "a")


def test_a_batch_of_one_is_the_run(tmp_path: Path) -> None:
    from weathercoat.run import run_asset

    job = make_job(tmp_path, "a")
    run_batch([job], tmp_path / "out", InlineExecutor())
    run_asset(job.loaded, job.asset, tmp_path / "single")
    assert result_bytes(tmp_path / "out" / "a") == result_bytes(tmp_path / "single")


def test_the_longest_job_is_the_first(tmp_path: Path) -> None:
    jobs = [make_job(tmp_path, name, f"ageing.steps={n}") for name, n in (("a", 20), ("b", 60), ("c", 40))]
    told: list[str] = []
    run_batch(
        jobs,
        tmp_path / "out",
        InlineExecutor(),
        listen=lambda event: told.append(event.name) if isinstance(event, Outcome) else None,
    )
    assert told == ["b", "c", "a"]


def test_two_batches_do_not_share_a_folder(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    lock = FolderLock(out, ".batch.lock")
    assert lock.take()
    with pytest.raises(OutputError, match="another batch"):
        run_batch([make_job(tmp_path, "a")], out, InlineExecutor())
    lock.release(remove=True)


def test_a_batch_that_is_stopped_says_so(tmp_path: Path) -> None:
    def listen(event: object) -> None:
        raise KeyboardInterrupt

    jobs = [make_job(tmp_path, "a", "ageing.steps=40"), make_job(tmp_path, "b")]
    with pytest.raises(KeyboardInterrupt):
        run_batch(jobs, tmp_path / "out", InlineExecutor(), listen=listen)
    record = json.loads((tmp_path / "out" / "batch.json").read_text())
    assert record["state"] == "stopped"
    assert statuses(record) == {"a": "done", "b": "dropped"}
    record = run_batch(jobs, tmp_path / "out", InlineExecutor())
    assert statuses(record) == {"a": "unchanged", "b": "done"}


def test_an_interrupted_run_goes_on_and_a_broken_checkpoint_begins_again(tmp_path: Path) -> None:

    job = make_job(tmp_path, "a", "checkpoint.steps=10")
    out = tmp_path / "out"
    run_batch([job], out, InlineExecutor())
    expected = result_bytes(out / "a")
    (out / "a").rename(out / "a.partial")
    (out / "a.partial" / "lock").touch()
    (out / "a.partial" / "checkpoint" / "state.npz").write_bytes(b"no archive")
    record = run_batch([job], out, InlineExecutor())
    assert statuses(record) == {"a": "done"}
    assert result_bytes(out / "a") == expected


def test_a_job_named_as_one_of_the_files_fails_alone(tmp_path: Path) -> None:
    jobs = [replace(make_job(tmp_path, "x"), name="batch.json"), make_job(tmp_path, "b")]
    record = run_batch(jobs, tmp_path / "out", InlineExecutor())
    assert statuses(record) == {"batch.json": "failed", "b": "done"}


def test_the_buffers_of_a_gltf_are_part_of_the_input(tmp_path: Path) -> None:
    write_mesh(tmp_path / "a.glb", make_random_sheet(100))
    blob = (tmp_path / "a.glb").read_bytes()
    length = struct.unpack_from("<I", blob, 12)[0]
    content = json.loads(blob[20 : 20 + length])
    buffer = bytearray(blob[28 + length :])
    content["buffers"] = [{"uri": "a%20b.bin", "byteLength": len(buffer)}]
    (tmp_path / "a.gltf").write_text(json.dumps(content))
    (tmp_path / "a b.bin").write_bytes(buffer)
    jobs = [replace(make_job(tmp_path, "a"), asset=str(tmp_path / "a.gltf"))]
    run_batch(jobs, tmp_path / "out", InlineExecutor())
    report = json.loads((tmp_path / "out" / "a" / "run.json").read_text())
    assert sorted(report["inputs"]) == ["a b.bin", "a.gltf"]
    assert not sort_out(jobs, tmp_path / "out")[1]
    buffer[-1] ^= 1
    (tmp_path / "a b.bin").write_bytes(buffer)
    assert sort_out(jobs, tmp_path / "out")[1] == jobs
