"""Counting the faces of a file without reading it as a model."""

from __future__ import annotations

from pathlib import Path

import pytest

from weathercoat.mesh.count import count_faces
from weathercoat.mesh.shapes import make_bracket
from weathercoat.output.meshes import write_mesh


@pytest.mark.parametrize("extension", ["obj", "ply", "stl", "off", "glb"])
def test_what_a_file_tells_is_what_it_holds(extension: str, tmp_path: Path) -> None:
    surface = make_bracket(edge_length=0.05)
    path = tmp_path / f"bracket.{extension}"
    write_mesh(path, surface)
    assert count_faces(path) == len(surface.faces)


def test_an_ascii_stl_is_counted_by_its_facets(tmp_path: Path) -> None:
    path = tmp_path / "part.stl"
    path.write_text("solid x\n" + " facet normal 0 0 1\n" * 7 + "endsolid x\n")
    assert count_faces(path) == 7


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"ply\n",
        b"glTF",
        b"glTF" + bytes(16) + b"{",
        b"OFF",
        b"\xff" * 300,
        b"ply\nelement face 99999999999",
    ],
)
@pytest.mark.parametrize("extension", ["obj", "ply", "stl", "off", "glb", "gltf", "xyz"])
def test_damaged_files_do_no_harm(content: bytes, extension: str, tmp_path: Path) -> None:
    path = tmp_path / f"broken.{extension}"
    path.write_bytes(content)
    assert 0 <= count_faces(path) <= max(len(content), 1)


def test_there_is_nothing_in_what_is_not_there(tmp_path: Path) -> None:
    assert count_faces(tmp_path / "missing.obj") == 0
    assert count_faces(tmp_path) == 0
