"""Meshes and pictures through pipes: what goes to standard output is what a file would hold."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from weathercoat.cli.handler import call
from weathercoat.cli.writing import MESH_FORMATS
from weathercoat.mesh.read import read_stream, read_surface
from weathercoat.output.meshes import WRITERS

SOURCES = Path(__file__).parents[2]
COMMAND = [sys.executable, "-m", "weathercoat"]
SMALL = [
    "--faces",
    "300",
    "--steps",
    "6",
    "--set",
    "output.picture_width=32",
    "--set",
    "output.picture_height=24",
]


@pytest.fixture
def sign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A model in the current folder, and an empty place for temporary files beside it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scratch").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "scratch"))
    assert call(["sample", "sign", "-o", "sign.obj"]) == 0
    return tmp_path / "sign.obj"


def output_of(arguments: list[str], capture: pytest.CaptureFixture[bytes], code: int = 0) -> bytes:
    capture.readouterr()
    assert call(arguments) == code
    return capture.readouterr().out


@pytest.mark.parametrize("kind", ["ply", "glb"])
def test_an_aged_mesh_is_that_of_the_last_snapshot(
    kind: str, sign: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    """Whatever the config says of snapshots; nothing else is written, and nothing is left."""
    assert call(["run", "standard", "sign.obj", "-o", "run", *SMALL]) == 0
    wanted = (Path("run") / "snapshots" / f"step_0006.{kind}").read_bytes()
    for more in (
        [],
        ["--set", "snapshots.count=2"],
        ["--set", "snapshots.steps=[1,3]", "--set", "snapshots.count=null"],
    ):
        arguments = ["run", "standard", "sign.obj", "-o", "-", "--to", kind, *SMALL, *more]
        assert output_of(arguments, capfdbinary) == wanted
    assert sorted(path.name for path in Path().iterdir()) == ["run", "scratch", "sign.obj"]
    assert not list(Path("scratch").iterdir())


def test_an_aged_mesh_as_obj_has_metal_and_paint(
    sign: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    """Up as OBJ has it, whatever the input's axes."""
    for name in ("sign.ply", "sign.obj"):
        assert call(["remesh", "sign.obj", "-o", name, "--faces", "300", "--overwrite"]) == 0
        text = output_of(["run", "standard", name, "-o", "-", "--to", "obj", *SMALL], capfdbinary)
        read = read_stream(BytesIO(text), format="obj")
        assert read.groups == ("metal", "paint")
        metal, sign_plate = read.select_faces(read.face_group == 0), read_surface("sign.obj")
        extents = [np.ptp(surface.vertices, axis=0) for surface in (metal, sign_plate)]
        assert extents[0] == pytest.approx(extents[1], rel=0.1)


def test_a_picture(sign: Path, capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    assert call(["run", "standard", "sign.obj", "-o", "run", *SMALL]) == 0
    assert call(["render", "run", "-o", "sheet.png", "--width", "32"]) == 0
    assert (
        output_of(["render", "run", "-o", "-", "--width", "32"], capfdbinary)
        == Path("sheet.png").read_bytes()
    )


@pytest.mark.parametrize("kind", MESH_FORMATS)
def test_the_format_of_standard_output(
    kind: str, sign: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    for command in (["remesh", "sign.obj", "--faces", "300"], ["sample", "bracket"]):
        assert call([*command, "-o", f"file.{kind}", "--overwrite"]) == 0
        wanted = Path(f"file.{kind}").read_bytes()
        assert output_of([*command, "-o", "-", "--to", kind], capfdbinary) == wanted
        assert call([*command, "-o", "other", "--to", kind, "--overwrite"]) == 0
        assert Path("other").read_bytes() == wanted


def test_every_format_can_be_asked_for() -> None:
    assert set(MESH_FORMATS) == set(WRITERS)


def test_a_config_from_standard_input(sign: Path) -> None:
    config = b"preset: [rusting]\nageing: {steps: 6}\nremesh: {faces: 300}\noutput: {preview: false}\n"
    environment = {**os.environ, "PYTHONPATH": str(SOURCES)}
    done = subprocess.run(
        [*COMMAND, "run", "-", "sign.obj", "-o", "piped", "-q"], input=config, env=environment, check=True
    )
    assert done.stdout is None
    Path("mine.yaml").write_bytes(config)
    assert call(["run", "mine.yaml", "sign.obj", "-o", "direct", "-q"]) == 0
    same = Path("piped/run.json").read_bytes() == Path("direct/run.json").read_bytes()
    assert same
    wrong = subprocess.run(
        [*COMMAND, "config", "check", "-"], input=b"curl: 3\n", env=environment, capture_output=True
    )
    assert wrong.returncode == 2
    assert b"-:1: E-CONFIG" in wrong.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "-", "-"], "config and model cannot both be standard input"),
        (["plan", "-", "-"], "config and model cannot both be standard input"),
        (["run", "standard", "sign.obj", "-o", "-", "--json"], "both write to standard output"),
        (["remesh", "sign.obj", "-o", "-", "--json"], "both write to standard output"),
        (["render", "run", "-o", "-", "--json"], "both write to standard output"),
        (["run", "standard", "sign.obj", "-o", "-", "--resume"], "keeps nothing"),
        (["run", "standard", "sign.obj", "-o", "-", "--overwrite"], "keeps nothing"),
        (["run", "standard", "sign.obj", "-o", "out", "--to", "ply"], "add -o -"),
        (["run", "standard", "sign.obj", "-o", "-", "--to", "stl"], "is not one of"),
    ],
)
def test_what_does_not_go_together(
    arguments: list[str], message: str, sign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(arguments) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "standard", "sign.obj", "-o", "-"],
        ["remesh", "sign.obj", "-o", "-", "--to", "ply"],
        ["sample", "sign", "-o", "-", "--to", "glb"],
        ["render", "run", "-o", "-"],
    ],
)
def test_a_terminal_is_spared(
    arguments: list[str], sign: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Refused at once, and not after the work."""
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert call(arguments) == 2
    assert "standard output is a terminal" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "standard", "sign.obj", "-o", "-", "-q", *SMALL],
        ["remesh", "sign.obj", "-o", "-", "--faces", "300"],
    ],
)
def test_a_reader_that_went_away_is_no_matter(arguments: list[str], sign: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(SOURCES), "TMPDIR": str(sign.parent / "scratch")}
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run([*COMMAND, *arguments], stdout=writing, stderr=subprocess.PIPE, env=environment)
    os.close(writing)
    assert (done.returncode, b"Error" in done.stderr) == (141, False)
    assert not list(Path("scratch").iterdir())


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is full")
def test_a_full_disk_behind_standard_output_is_told(sign: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(SOURCES)}
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [*COMMAND, "remesh", "sign.obj", "-o", "-", "--faces", "300"],
            stdout=full,
            stderr=subprocess.PIPE,
            env=environment,
        )
    assert done.returncode == 7
    assert b"standard output: E-OUTPUT: No space left on device" in done.stderr
