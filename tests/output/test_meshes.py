"""Surfaces in every format, read back by another reader and by our own."""

from __future__ import annotations

import dataclasses
import io
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tests.output.snapshots import make_grouped_surface, make_sheet
from weathercoat.errors import OutputExistsError, UsageError
from weathercoat.mesh.read import read_surface
from weathercoat.mesh.surface import make_surface
from weathercoat.output.meshes import WRITERS, mesh_format, write_mesh
from weathercoat.output.ply import read_ply_arrays


def sorted_triangles(corners: np.ndarray) -> np.ndarray:
    """Triangles (m, 3, 3) in an order of their own."""
    return corners[np.lexsort(corners.reshape(len(corners), -1).T)]


@pytest.mark.parametrize("suffix", WRITERS)
def test_every_format_reads_back_elsewhere(tmp_path: Path, suffix: str) -> None:
    surface = make_grouped_surface()
    write_mesh(tmp_path / f"a.{suffix}", surface)
    corners = trimesh.load_scene(tmp_path / f"a.{suffix}").to_geometry().triangles
    expected = surface.vertices[surface.faces]
    np.testing.assert_allclose(sorted_triangles(corners), sorted_triangles(expected), atol=1e-6)


@pytest.mark.parametrize("suffix", ["obj", "glb"])
def test_groups_and_colors_come_back(tmp_path: Path, suffix: str) -> None:
    surface = make_grouped_surface()
    write_mesh(tmp_path / f"a.{suffix}", surface)
    back = read_surface(tmp_path / f"a.{suffix}")
    assert [name.replace("_", " ") for name in back.groups] == list(surface.groups)
    assert back.colors is not None
    # The colours of the fixture are its positions, so that each corner shows whether it has its own.
    np.testing.assert_allclose(back.colors[:, :2], back.vertices[:, [0, 2]], atol=1e-6)
    np.testing.assert_allclose(back.colors[:, 2], 0.5, atol=1e-6)


def test_texture_coordinates_come_back_with_their_seam(tmp_path: Path) -> None:
    surface = make_grouped_surface()
    write_mesh(tmp_path / "a.obj", surface)
    back = read_surface(tmp_path / "a.obj")
    # Those of the fixture are its positions, moved by 1 in the second group.
    expected = back.vertices[back.faces][:, :, [0, 2]] + back.face_group[:, None, None]
    np.testing.assert_array_equal(back.uv, expected)
    assert len(back.vertices) == len(surface.vertices)


def test_ply_keeps_texture_coordinates_of_corners(tmp_path: Path) -> None:
    surface = make_grouped_surface()
    write_mesh(tmp_path / "a.ply", surface)
    back = read_surface(tmp_path / "a.ply")
    np.testing.assert_array_equal(back.vertices[back.faces], surface.vertices[surface.faces])
    np.testing.assert_allclose(back.uv, surface.uv, atol=1e-6)


def test_text_keeps_every_digit(tmp_path: Path) -> None:
    vertices = np.random.default_rng(1).normal(size=(30, 3)) * 10.0 ** np.arange(-15, 15)[:, None]
    faces = np.arange(30).reshape(-1, 3)
    for suffix in ("obj", "off", "ply"):
        write_mesh(tmp_path / f"a.{suffix}", make_surface(vertices, faces))
        mesh = trimesh.load(tmp_path / f"a.{suffix}", process=False)
        np.testing.assert_array_equal(mesh.vertices, vertices)


def test_ply_names_its_groups(tmp_path: Path) -> None:
    surface = make_grouped_surface()
    write_mesh(tmp_path / "a.ply", surface)
    ply = read_ply_arrays(tmp_path / "a.ply")
    assert ply.comments == ("group 0 body", "group 1 tyre left")
    np.testing.assert_array_equal(ply.face["group"], surface.face_group)


@pytest.mark.parametrize("suffix", WRITERS)
def test_a_stream_gets_the_bytes_of_the_file(tmp_path: Path, suffix: str) -> None:
    surface = dataclasses.replace(make_grouped_surface(), up=(0.0, 0.0, 1.0))
    stream = io.BytesIO()
    write_mesh(stream, surface, format=suffix)
    write_mesh(tmp_path / f"a.{suffix.upper()}", surface)
    assert stream.getvalue() == (tmp_path / f"a.{suffix.upper()}").read_bytes()


def test_what_cannot_be_written_is_refused(tmp_path: Path) -> None:
    surface = make_surface(*make_sheet())
    for name in ("a.fbx", "a"):
        with pytest.raises(UsageError, match="not written"):
            write_mesh(tmp_path / name, surface)
        with pytest.raises(UsageError, match="not written"):
            mesh_format(tmp_path / name)
    with pytest.raises(UsageError, match="stream"):
        write_mesh(io.BytesIO(), surface)
    assert list(tmp_path.iterdir()) == []
    write_mesh(tmp_path / "a.obj", surface)
    with pytest.raises(OutputExistsError):
        write_mesh(tmp_path / "a.obj", surface)
