"""One asset from file to folder: what carries paint, what passes through, and what is said on the way."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from weathercoat.config.load import load_config
from weathercoat.errors import LimitError, NoFacesError, Note, StrictError
from weathercoat.mesh.read import read_surface
from weathercoat.run import name_errors, report_notes, run_asset, split_paint

TWO_MATERIALS = """\
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 1 0 1
v 2 0 1
v 2 1 1
v 1 1 1
usemtl glass pane
f 1 2 3
f 1 3 4
usemtl metal
f 5 6 7
f 5 7 8
"""


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "window.obj"
    path.write_text(TWO_MATERIALS)
    return path


@pytest.mark.parametrize("choice", ["paint.only=[metal]", "paint.except=['glass*']"])
def test_paint_is_split_by_names_and_globs(model: Path, choice: str) -> None:
    painted, untouched = split_paint(read_surface(model), load_config("standard", [choice]).config)
    assert untouched is not None
    assert painted.vertices[:, 2].tolist() == [1.0] * 4
    assert untouched.vertices[:, 2].tolist() == [0.0] * 4


def test_all_is_painted_by_default_and_nothing_is_an_error(model: Path) -> None:
    surface = read_surface(model)
    assert split_paint(surface, load_config("standard").config) == (surface, None)
    with pytest.raises(NoFacesError, match="no face carries paint") as caught:
        split_paint(surface, load_config("standard", ["paint.only=[wood]"]).config)
    assert "glass pane, metal" in caught.value.line()


def test_untouched_parts_are_in_the_folder_as_they_were(model: Path, tmp_path: Path) -> None:
    overrides = ["paint.only=[metal]", "remesh=off", "ageing.steps=2", "snapshots.count=1"]
    said: list[str] = []
    loaded = load_config("standard", [*overrides, "output.preview=false"])
    report = run_asset(loaded, model, tmp_path / "out", log=said.append)
    untouched = read_surface(tmp_path / "out" / "untouched.ply")
    np.testing.assert_array_equal(
        np.sort(untouched.vertices, axis=0), np.sort(read_surface(model).vertices[:4], axis=0)
    )
    assert b'"glass pane"' in (tmp_path / "out" / "snapshots" / "step_0002.glb").read_bytes()
    assert (report["meshes"]["input"]["faces"], report["meshes"]["film"]["faces"]) == (4, 2)
    assert [line for line in said if "W-" in line] == [
        f"window.obj: {note['code']}({note['count']}): {note['message']}" for note in report["notes"]
    ]


def test_strict_says_all_notes_and_raises_the_first() -> None:
    said: list[str] = []
    notes = [Note("W-WELDED", 2, "merged"), Note("W-BOUNDARY", 4, "open")]
    report_notes(notes, "a.obj", said.append)
    with pytest.raises(StrictError, match=r"W-WELDED\(2\): merged"):
        report_notes(notes, "a.obj", said.append, strict=True)
    assert said == ["a.obj: W-WELDED(2): merged", "a.obj: W-BOUNDARY(4): open"] * 2
    report_notes([], "a.obj", said.append, strict=True)


def test_errors_get_the_name_of_the_model_once() -> None:
    for file, expected in ((None, "a.obj"), ("b.mtl", "b.mtl")):
        with pytest.raises(LimitError) as caught, name_errors("a.obj"):
            raise LimitError("too many faces", file=file)
        assert caught.value.file == expected


def test_names_from_a_model_bring_no_escapes_to_the_terminal() -> None:
    said: list[str] = []
    report_notes([Note("W-GROUP", 1, "no \x1b[2Jgroup\nhere")], "a\x1b.obj", said.append)
    assert said == ["a\\x1b.obj: W-GROUP(1): no \\x1b[2Jgroup here"]
