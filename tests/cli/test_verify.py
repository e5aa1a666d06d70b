"""`weathercoat verify` says what is wrong, a line each, and ends with the code for it."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from weathercoat.cli.handler import call

QUICK = [
    "--faces",
    "200",
    "--steps",
    "10",
    "--set",
    "snapshots.count=2",
    "--set",
    "output.formats=[ply]",
    "-q",
]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    assert call(["sample", "sign", "-o", str(folder / "sign.obj")]) == 0
    run = ["run", "crackle", str(folder / "sign.obj"), "-o", str(folder / "run")]
    assert call([*run, *QUICK, "--set", "output.preview=false"]) == 0
    return folder / "run"


@pytest.fixture
def run(finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of a run in the current folder."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(finished, "run")
    return Path("run")


def test_a_whole_run_ends_with_0(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["verify", "run"]) == 0
    open_question, closing = capsys.readouterr().out.splitlines()
    assert open_question == "not proved: that PLY and GLB agree: the run wrote no GLB"
    assert re.fullmatch(r"whole: \d files, 2 snapshots, \d+ checks", closing)
    assert call(["verify", "run", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_every_finding_is_a_line_and_the_end_is_6(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(run, "other")
    (run / "notes.txt").write_text("mine")
    (run / "snapshots" / "step_0005.ply").unlink()
    assert call(["verify", "run", "other"]) == 6
    captured = capsys.readouterr()
    assert captured.err == "weathercoat: run: E-CHECK: 2 findings; run again\n"
    lines = captured.out.splitlines()
    assert lines[:2] == [
        "run/snapshots/step_0005.ply: is listed in run.json, but missing",
        "run/notes.txt: is not listed in run.json",
    ]
    assert re.fullmatch(r"run: not whole: \d files, 2 snapshots, \d+ checks", lines[3])
    assert re.fullmatch(r"other: whole: \d files, 2 snapshots, \d+ checks", lines[5])
    assert call(["verify", "run", "--quiet"]) == 6
    assert capsys.readouterr() == ("", "weathercoat: run: E-CHECK: 2 findings; run again\n")


def test_a_flood_of_findings_is_cut_off(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number in range(100):
        (run / f"{number}.txt").write_text("")
    assert call(["verify", "run"]) == 6
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 43 and lines[40] == "and 60 more"


def test_findings_as_json(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["verify", "run", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["whole"]
    (run / "notes.txt").write_text("mine")
    assert call(["verify", "run", "--json"]) == 6
    captured = capsys.readouterr()
    (found,) = json.loads(captured.out)["runs"]
    assert found["folder"] == "run" and not found["whole"]
    assert found["findings"] == [
        {"check": "files-listed", "file": "notes.txt", "message": "is not listed in run.json"}
    ]
    error = json.loads(captured.err)["error"]
    assert (error["code"], error["message"]) == (
        "E-CHECK",
        "1 finding: notes.txt: is not listed in run.json",
    )


def test_where_there_is_no_run_it_ends_with_3(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["verify", "run", "missing"]) == 3
    assert "weathercoat: missing: E-ACCESS: there is no such folder" in capsys.readouterr().err
    (run / "run.json").unlink()
    assert call(["verify", "run"]) == 3
    assert "run.json: No such file" in capsys.readouterr().err


def test_a_run_may_go_unchecked(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert json.loads((run / "timing.json").read_text())["around"]["check"] > 0
    assert call(["sample", "sign", "-o", "sign.obj"]) == 0
    assert call(["run", "crackle", "sign.obj", "-o", "unchecked", "--no-check", *QUICK]) == 0
    assert json.loads(Path("unchecked/timing.json").read_text())["around"]["check"] == 0
    assert call(["verify", "unchecked", "-q"]) == 0
