"""`weathercoat scene` as it is typed: what it prints, what it writes, and its exit codes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from weathercoat.cli.handler import call
from weathercoat.mesh.shapes import make_box
from weathercoat.output.meshes import write_mesh

SMALL = ["--set", "remesh.faces=300", "--set", "ageing.steps=30", "--no-preview", "-j", "1"]
SCENE = """
ground: 0
objects:
  - {name: roof, model: box.obj, position: [0, 3, 0], scale: [6, 0.1, 6]}
  - {name: under, model: box.obj}
  - {name: open, model: box.obj, position: [9, 0, 0]}
"""


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A roof over one of two boxes."""
    monkeypatch.chdir(tmp_path)
    write_mesh(tmp_path / "box.obj", make_box(1.0, 1.0, 1.0, 2))
    path = tmp_path / "shed.yaml"
    path.write_text(SCENE)
    return path


def test_a_dry_run_writes_nothing(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(scene.parent.iterdir())
    assert call(["scene", "shed.yaml", "--dry-run"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[:4]] == ["object", "roof", "under", "open"]
    assert lines[4].startswith("objects: 3, weathered: 3; meshes: 1; results: 3, about")
    assert call(["scene", "shed.yaml", "--dry-run", "--json", "--variants", "each"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in report["variants"]] == ["roof", "under", "open"]
    assert sorted(scene.parent.iterdir()) == before


def test_a_scene_lands_in_a_folder_of_its_name(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["scene", "shed.yaml", *SMALL]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "written to shed-aged"
    names = {path.name for path in Path("shed-aged").iterdir()}
    assert names == {"scene.glb", "scene.json", "batch.json", "objects", "models"}


def test_events_for_machines(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["scene", "shed.yaml", *SMALL, "--json", "-o", "out"]) == 0
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [event["event"] for event in events] == ["job", "job", "job", "end"]
    assert events[-1] == {"event": "end", "folder": "out"}


def test_what_fails_is_named(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene.write_text(SCENE + "rules: [{match: roof, set: {remesh.faces: 20000000}}]\n")
    small = ["--set", "ageing.steps=30", "--no-preview", "-j", "1"]
    assert call(["scene", "shed.yaml", *small, "-o", "out", "--max-memory", "1G", "-c", "draft.yaml"]) == 2
    Path("draft.yaml").write_text("remesh: {faces: 300}\n")
    assert call(["scene", "shed.yaml", *small, "-o", "out", "--max-memory", "1G", "-c", "draft.yaml"]) == 8
    assert "1 of 3 results failed: box" in capsys.readouterr().err
    assert Path("out/scene.glb").is_file()


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["--variants", "0"], 2, "must be each, or a whole number"),
        (["--variants", "some"], 2, "must be each, or a whole number"),
        (["--quality", "auto"], 2, "auto needs"),
        (["--set", "curl.radios=1"], 2, "curl.radios"),
        (["--age", "-1"], 2, "--age"),
    ],
)
def test_what_makes_no_sense_is_refused(
    scene: Path, arguments: list[str], code: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(["scene", "shed.yaml", *arguments]) == code
    assert said in capsys.readouterr().err
    assert not Path("shed-aged").exists()


def test_a_mesh_is_no_scene(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["scene", "box.obj"]) == 3
    assert "is no scene" in capsys.readouterr().err
