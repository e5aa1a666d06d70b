"""Models and results at URLs: the bytes are those of paths, and whatever goes wrong is one line."""

from __future__ import annotations

import json
import shutil
import sys
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from tests.batch.jobs import make_job, make_task, result_bytes
from weathercoat.batch.batch import run_batch
from weathercoat.batch.job import Outcome, Task
from weathercoat.batch.processes import InlineExecutor
from weathercoat.batch.storage import fetch, is_url, join, publish, read_report
from weathercoat.batch.work import do_task
from weathercoat.errors import AccessError, OutputError
from weathercoat.mesh.read import read_surface

fsspec = pytest.importorskip("fsspec")


@pytest.fixture
def bucket() -> Iterator[str]:
    """The URL of a folder in memory, empty before and after."""
    files = fsspec.filesystem("memory")
    yield "memory://bucket"
    files.store.clear()
    files.pseudo_dirs[:] = [""]


def put(path: Path, url: str) -> None:
    with fsspec.open(url, "wb") as stream:
        stream.write(path.read_bytes())


def content_at(url: str, folder: Path) -> dict[str, bytes]:
    """All files at a URL but the timing."""
    shutil.rmtree(folder, ignore_errors=True)
    files, place = fsspec.url_to_fs(url)
    files.get(place, str(folder), recursive=True)
    return result_bytes(folder)


def done(task: Task) -> Outcome:
    outcome = do_task(task)
    assert outcome.error is None
    return outcome


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("s3://bucket/chair.obj", True),
        ("file:///tmp/chair.obj", True),
        ("https://host/chair.obj?x=1", True),
        ("simplecache::s3://bucket/chair.obj", True),
        ("chair.obj", False),
        ("C:/models/chair.obj", False),
        ("C:\\models\\chair.obj", False),
        ("models//chair.obj", False),
        ("a b://chair.obj", False),
        ("-", False),
    ],
)
def test_what_is_a_url(text: str, expected: bool) -> None:
    assert is_url(text) is expected


def test_names_are_joined_to_paths_and_urls() -> None:
    assert join("s3://bucket/out/", "chairs/oak") == "s3://bucket/out/chairs/oak"
    assert join("memory://bucket", "a") == "memory://bucket/a"
    assert join("out", "chairs/oak") == str(Path("out/chairs/oak"))


def test_results_at_urls_are_the_bytes_of_paths(bucket: str, tmp_path: Path) -> None:
    job = make_job(tmp_path, "a")
    done(make_task(job, tmp_path / "out"))
    put(Path(job.asset), f"{bucket}/models/{Path(job.asset).name}")
    away = replace(job, asset=f"{bucket}/models/{Path(job.asset).name}")
    for asset, target in (
        (away, str(tmp_path / "from_url")),
        (job, f"{bucket}/out/a"),
        (away, f"{bucket}/out/b"),
        (away, f"file://{tmp_path}/by_file_url"),
    ):
        done(Task(asset, target, 1e6, 1.0))
        there = content_at(target, tmp_path / "got") if is_url(target) else result_bytes(Path(target))
        assert there == result_bytes(tmp_path / "out" / "a")
    assert read_report(f"{bucket}/out/a") == read_report(str(tmp_path / "out" / "a"))


def test_what_is_finished_at_a_url_stays_and_what_has_changed_is_replaced(
    bucket: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = make_job(tmp_path, "a", "snapshots.count=3")
    task = Task(job, f"{bucket}/a", 1e6, 1.0)
    done(task)
    before = content_at(task.target, tmp_path / "got")
    with monkeypatch.context() as patched:
        patched.setattr("weathercoat.batch.work.run_asset", None)
        assert done(task).figures == json.loads(before["run.json"])["snapshots"][-1]
    other = replace(task, job=make_job(tmp_path, "a", "seed=9"))
    done(other)
    done(make_task(other.job, tmp_path / "out"))
    assert content_at(task.target, tmp_path / "got") == result_bytes(tmp_path / "out" / "a")


def test_a_folder_that_was_not_published_to_its_end_holds_no_report(
    bucket: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever file the end comes at; a rerun makes it whole."""
    job = make_job(tmp_path, "a")
    done(make_task(job, tmp_path / "out"))
    here = tmp_path / "out" / "a"
    count = sum(path.is_file() for path in here.rglob("*"))
    publish(here, f"{bucket}/a")
    memory = type(fsspec.filesystem("memory"))
    put_file = memory.put_file
    for last in range(count):
        left = [last]

        def put_some(self: object, *arguments: object, left: list[int] = left, **more: object) -> None:
            if not left[0]:
                raise OSError("the line is dead")
            left[0] -= 1
            put_file(self, *arguments, **more)

        with monkeypatch.context() as patched:
            patched.setattr(memory, "put_file", put_some)
            with pytest.raises(OutputError, match="cannot be written: the line is dead"):
                publish(here, f"{bucket}/a")
        assert read_report(f"{bucket}/a") is None
    done(Task(job, f"{bucket}/a", 1e6, 1.0))
    assert content_at(f"{bucket}/a", tmp_path / "got") == result_bytes(here)


def test_a_report_that_is_not_whole_is_none(bucket: str, tmp_path: Path) -> None:
    assert read_report(f"{bucket}/a") is None
    assert read_report(str(tmp_path)) is None
    for content in (b"", b'{"files": {', b"[]", b"\xff"):
        (tmp_path / "run.json").write_bytes(content)
        put(tmp_path / "run.json", f"{bucket}/a/run.json")
        assert read_report(f"{bucket}/a") is None
        assert read_report(str(tmp_path)) is None


def test_files_beside_a_model_are_fetched(bucket: str, tmp_path: Path) -> None:
    """With them there, the notes are those of the model at a path."""
    folder = tmp_path / "models"
    (folder / "data").mkdir(parents=True)
    (folder / "data" / "the points.bin").write_bytes(
        bytes.fromhex("000000000000000000000000 0000803f0000000000000000 000000000000803f00000000")
    )
    (folder / "paint.png").write_bytes(b"picture")
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"uri": "data/the%20points.bin", "byteLength": 36}],
        "images": [{"uri": "paint.png"}, {"uri": "missing.png"}, {"uri": "../secret.png"}],
    }
    (folder / "a.gltf").write_text(json.dumps(document))
    (folder / "b.obj").write_text("mtllib ./b.mtl\nmtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (folder / "b.mtl").write_text("newmtl paint\n")
    with zipfile.ZipFile(folder / "c.zip", "w") as archive:
        archive.write(folder / "b.obj", "b.obj")
    for path in folder.rglob("*"):
        if path.is_file():
            put(path, f"{bucket}/{path.relative_to(folder)}")
    put(folder / "paint.png", "memory://secret.png")
    for name in ("a.gltf", "b.obj", "c.zip"):
        here = tmp_path / name
        here.mkdir()
        got = read_surface(fetch(f"{bucket}/{name}", here))
        expected = read_surface(folder / name)
        assert got.notes == expected.notes
        assert got.vertices.tobytes() == expected.vertices.tobytes()
    assert sorted(path.name for path in (tmp_path / "a.gltf").rglob("*")) == [
        "a.gltf", "data", "paint.png", "the points.bin",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("memory://bucket/none.obj", "does not exist"),
        ("memory://", "names no file"),
        ("file:///nowhere/chair.obj", "does not exist"),
        ("quux://bucket/chair.obj", "Protocol not known: quux"),
    ],
)
def test_a_model_that_cannot_be_fetched_is_one_line(url: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(AccessError, match=says) as caught:
        fetch(url, tmp_path)
    assert caught.value.file == url and "\n" not in caught.value.line()
    job = replace(make_job(tmp_path, "a"), asset=url)
    outcome = do_task(make_task(job, tmp_path / "out"))
    assert outcome.error is not None and outcome.error["code"] == "E-ACCESS" and outcome.error["file"] == url


def test_errors_of_a_fetched_model_name_its_url(bucket: str, tmp_path: Path) -> None:
    (tmp_path / "bad.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 9\nend_header\n")
    put(tmp_path / "bad.ply", f"{bucket}/bad.ply")
    job = replace(make_job(tmp_path, "a"), asset=f"{bucket}/bad.ply")
    outcome = do_task(Task(job, f"{bucket}/out", 1e6, 1.0))
    assert outcome.error is not None and outcome.error["file"] == f"{bucket}/bad.ply"
    assert outcome.error["exit_code"] == 3
    assert read_report(f"{bucket}/out") is None


def test_what_has_to_be_installed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from fsspec.registry import known_implementations

    monkeypatch.setitem(known_implementations["s3"], "class", "no_such_package.S3")
    with pytest.raises(OutputError, match="another package: Install s3fs"):
        publish(tmp_path, "s3://bucket/out")
    for name in list(sys.modules):
        if name.partition(".")[0] == "fsspec":
            monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(AccessError) as caught:
        read_report("s3://bucket/out")
    assert "pip install 'weathercoat[urls]'" in caught.value.line()


def test_a_batch_goes_to_a_url_and_is_not_done_again(bucket: str, tmp_path: Path) -> None:
    jobs = [make_job(tmp_path, "a"), make_job(tmp_path, "b/c", "seed=2")]
    put(Path(jobs[0].asset), f"{bucket}/sheet_100.obj")
    jobs.append(replace(jobs[0], name="d", asset=f"{bucket}/sheet_100.obj"))
    run_batch(jobs, tmp_path / "out", InlineExecutor())
    for statuses in (["done"] * 3, ["unchanged"] * 3):
        record = run_batch(jobs, f"{bucket}/out", InlineExecutor())
        assert [row["status"] for row in record["jobs"]] == statuses
        with fsspec.open(f"{bucket}/out/batch.json") as stream:
            assert json.load(stream) == record
    for job in jobs:
        there = content_at(f"{bucket}/out/{job.name}", tmp_path / "got")
        assert there == result_bytes(tmp_path / "out" / job.name)


@pytest.mark.parametrize("is_away", [False, True])
def test_a_result_of_another_version_is_replaced(
    is_away: bool, bucket: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = make_job(tmp_path, "a")
    task = Task(job, f"{bucket}/a" if is_away else str(tmp_path / "out"), 1e6, 1.0)
    with monkeypatch.context() as patched:
        patched.setattr("weathercoat.resume.versions", lambda: {"weathercoat": "0.0.1"})
        before = done(task)
        old = read_report(task.target)
    after = done(task)
    new = read_report(task.target)
    assert before.status == after.status == "done" and done(task).status == "unchanged"
    assert old is not None and new is not None and old["fingerprint"] != new["fingerprint"]
