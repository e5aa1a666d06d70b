"""Every file of the index files beside the real meshes through the whole command."""

from __future__ import annotations

import csv
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.mesh.odd_files import OddFile, odd_files
from weathercoat.cli.handler import call
from weathercoat.mesh.read import read_surface
from weathercoat.verification.run import verify_run

pytestmark = pytest.mark.long

LONGEST = 60.0
"""Seconds that any file may take."""
SHORT = ["--steps", "3", "--set", "snapshots.count=1", "--set", "output.preview=false"]
MOST_FACES = 12_000
"""Faces up to which a model is also run on its own triangles."""
MADE = ("directory.obj", "symlink_loop.obj", "pipe.obj")
LYING = {
    "ply_header_1e12_ascii.ply": 2.0, "off_header_1e12.off": 2.0, "stl_count_too_big.stl": 2.0,
    "zip_bomb_240MB.zip": 5.0,
}  # fmt: skip
"""Files that announce far more than they hold, and the seconds in which they are refused."""


def make_what_is_no_file(folder: Path) -> None:
    """A directory, a link to itself and a pipe."""
    (folder / "directory.obj").mkdir()
    (folder / "symlink_loop.obj").symlink_to(folder / "symlink_loop.obj")
    os.mkfifo(folder / "pipe.obj")


def rows(folder: Path) -> list[tuple[Path, set[int]]]:
    """The files of an index and the exit codes that it allows."""
    with (folder / "index.tsv").open(newline="", encoding="utf-8") as stream:
        entries = list(csv.DictReader(stream, delimiter="\t"))
    return [
        (folder / entry["file"], {int(code) for code in re.findall(r"exit (\d+)", entry["expected"])})
        for entry in entries
        if entry["file"] not in MADE
    ]


def check_run(
    model: Path, folder: Path, allowed: set[int], capsys: pytest.CaptureFixture[str], *more: str
) -> None:
    """Run a model: an allowed exit code in time; one line, or a folder that is proved whole."""
    out = folder / "out"
    start = time.monotonic()
    code = call(["run", *SHORT, *more, "-o", str(out), "--", "standard", str(model)])
    assert time.monotonic() - start < LONGEST
    said = capsys.readouterr().err.splitlines()
    assert code in allowed, said
    assert "Traceback" not in "".join(said)
    if code:
        errors = [line for line in said if re.search(r": E-[A-Z]+: ", line)]
        assert len(errors) == 1
        assert errors[0].startswith("weathercoat: ")
        assert _shown(model.name) in _shown(errors[0])
        assert list(folder.iterdir()) == []
        return
    assert verify_run(out).is_whole
    assert [path.name for path in folder.iterdir()] == ["out"]


def _shown(text: str) -> str:
    """What of a text is the same in a line, where blanks are one and controls are spelt out."""
    return (
        "".join(c for c in text if c.isprintable() and c != " ").replace(r"\x1b", "").replace(r"\u202e", "")
    )


@pytest.mark.parametrize("index", [".", "synth"])
def test_every_file_of_the_index_runs_or_is_refused(
    meshes_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], index: str
) -> None:
    for number, (model, allowed) in enumerate(rows(meshes_folder / index)):
        folder = tmp_path / str(number)
        folder.mkdir()
        check_run(model, folder, allowed, capsys, "--faces", "2000")


def test_models_run_on_their_own_triangles(
    meshes_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tried = 0
    for number, (model, allowed) in enumerate([*rows(meshes_folder), *rows(meshes_folder / "synth")]):
        if allowed == {0} and len(read_surface(model).faces) <= MOST_FACES:
            folder = tmp_path / str(number)
            folder.mkdir()
            check_run(model, folder, {0}, capsys, "--set", "remesh=off")
            tried += 1
    assert tried > 40


def test_what_is_no_file_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    models, folder = tmp_path / "models", tmp_path / "folder"
    models.mkdir()
    folder.mkdir()
    make_what_is_no_file(models)
    for name in MADE:
        check_run(models / name, folder, {3}, capsys)


def test_odd_files_run_or_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number, case in enumerate(odd_files()):
        models, folder = tmp_path / f"{number}-models", tmp_path / f"{number}"
        models.mkdir()
        folder.mkdir()
        (models / case.name).write_bytes(case.data)
        # A model that comes in may still be too thin or too scattered for its own remeshing.
        allowed = {0, 4, 5} if case.code is None else {_exit_code(case)}
        check_run(models / case.name, folder, allowed, capsys, "--faces", "500")


def _exit_code(case: OddFile) -> int:
    return {"E-LIMIT": 5}.get(case.code or "", 4 if case.code in _NO_SURFACE else 3)


_NO_SURFACE = ("E-NOFACES", "E-NOAREA", "E-NONFINITE", "E-PRECISION", "E-SCALE")


@pytest.mark.parametrize("name", LYING)
def test_lying_headers_cost_little(meshes_folder: Path, tmp_path: Path, name: str) -> None:
    """In a process of their own, whose start counts as well."""
    path = meshes_folder / "synth" / name
    command = [sys.executable, "-m", "weathercoat", "run", "standard", str(path), "-o", str(tmp_path / "out")]
    subprocess.run([*command, "--json"], capture_output=True, check=False)  # keeps what is compiled
    start = time.monotonic()
    process = subprocess.Popen([*command, "--json"], stderr=subprocess.PIPE)
    _, status, used = os.wait4(process.pid, 0)
    seconds = time.monotonic() - start
    assert process.stderr is not None
    error = json.loads(process.stderr.read())["error"]
    process.stderr.close()
    assert os.waitstatus_to_exitcode(status) == error["exit_code"] in (3, 5)
    assert seconds < LYING[name]
    assert used.ru_maxrss < 500 << 10  # kilobytes
    assert list(tmp_path.iterdir()) == []
