"""Odd files end as stated; what leads out of the folder is not followed; worst cases take linear time."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import NoReturn

import pytest

from tests.fuzz.files import flaw_of_surface
from tests.mesh.odd_files import OddFile, cube, gltf_cube, odd_files
from weathercoat.errors import AccessError, MissingFileError, SecurityError, WeathercoatError
from weathercoat.mesh.formats import obj
from weathercoat.mesh.read import read_surface

CASES = odd_files()
ORDINARY = {"W-POLYGONS", "W-BOUNDARY", "W-COMPONENTS"}


def test_there_are_many_and_no_name_is_twice() -> None:
    assert len({case.name for case in CASES}) == len(CASES) > 200


@pytest.mark.parametrize("case", CASES, ids=lambda case: ascii(case.name)[1:40])
def test_file_ends_as_stated(tmp_path: Path, case: OddFile) -> None:
    path = tmp_path / case.name
    path.write_bytes(case.data)
    if case.code is not None:
        with pytest.raises(WeathercoatError) as caught:
            read_surface(path)
        line = caught.value.line()
        assert caught.value.code == case.code, line
        assert case.says in line
        assert line.isprintable()
        assert len(line) < 1000
        return
    surface = read_surface(path)
    assert flaw_of_surface(surface) is None
    assert {note.code for note in surface.notes} - ORDINARY == set(case.notes)
    if case.faces is not None:
        assert len(surface.faces) == case.faces
    if case.area is not None:
        assert surface.area() == pytest.approx(case.area, rel=1e-5)


def test_no_device_pipe_or_link_to_them_is_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.obj")
    (tmp_path / "zero.obj").symlink_to("/dev/zero")
    (tmp_path / "to_pipe.obj").symlink_to(tmp_path / "pipe.obj")
    (tmp_path / "nowhere.obj").symlink_to(tmp_path / "missing.obj")
    (tmp_path / "folder.obj").mkdir()
    for name in ("pipe.obj", "zero.obj", "to_pipe.obj", "nowhere.obj", "folder.obj", "pipe.obj/x.obj"):
        with pytest.raises(AccessError):
            read_surface(tmp_path / name)


@pytest.mark.parametrize("kind", ["pipe", "folder", "link out", "link to a folder out", "link within"])
def test_buffers_are_regular_files_within_the_folder(tmp_path: Path, kind: str) -> None:
    inside, outside = tmp_path / "model", tmp_path / "other"
    inside.mkdir()
    outside.mkdir()
    for folder in (inside, outside):
        (folder / "data.bin").write_bytes(bytes(168))
    uri = "part/data.bin" if "folder out" in kind else "x.bin"
    match kind:
        case "pipe":
            os.mkfifo(inside / "x.bin")
        case "folder":
            (inside / "x.bin").mkdir()
        case "link out":
            (inside / "x.bin").symlink_to(outside / "data.bin")
        case "link to a folder out":
            (inside / "part").symlink_to(outside)
        case _:
            (inside / "x.bin").symlink_to("data.bin")
    (inside / "a.gltf").write_text(json.dumps(gltf_cube(buffers=[{"byteLength": 168, "uri": uri}])))
    with pytest.raises(WeathercoatError) as caught:
        read_surface(inside / "a.gltf")
    if kind == "link within":
        assert caught.value.code == "E-NOAREA"  # all positions are zero
    else:
        assert isinstance(caught.value, SecurityError if "out" in kind else MissingFileError)


def test_a_material_library_out_of_the_folder_is_not_even_looked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.obj").write_text(f"mtllib ../x.mtl\nmtllib {tmp_path}/y.mtl\nmtllib z.mtl\n" + cube())
    looked_at = []

    def look(path: Path, folder: Path) -> NoReturn:
        looked_at.append(path.name)
        raise FileNotFoundError

    monkeypatch.setattr(obj, "read_library", look)
    assert {note.code: note.count for note in read_surface(tmp_path / "a.obj").notes}["W-MATERIAL"] == 3
    assert looked_at == ["z.mtl"]
