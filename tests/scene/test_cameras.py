"""Cameras of glTF files and what moves them, as a path."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.scene.documents import Document
from weathercoat.scene.graph import CameraPath
from weathercoat.scene.read import read_scene

WIDE = {"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1, "aspectRatio": 2.0}}
NARROW = {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}
FLAT = {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0.1, "zfar": 10}}
HALF = np.sqrt(0.5)


def read_path(document: Document, folder: Path, **more: Any) -> CameraPath:
    document.node(name="thing", mesh=document.mesh())
    camera = read_scene(document.write(folder / "a.glb", cameras=[WIDE, NARROW, FLAT], **more)).camera
    assert camera is not None
    return camera


def animate(document: Document, node: int, path: str, times: Any, values: Any, kind: str) -> dict[str, Any]:
    """An animation of one channel."""
    sampler = {
        "input": document.accessor(np.asarray(times, "<f4")),
        "output": document.accessor(np.asarray(values, "<f4")),
        "interpolation": kind,
    }
    return {"channels": [{"sampler": 0, "target": {"node": node, "path": path}}], "samplers": [sampler]}


def test_cameras_of_nodes_look_along_their_z_axis(tmp_path: Path) -> None:
    document = Document()
    document.node(camera=0, translation=[0, 2, 5], children=[1])
    document.node(camera=1, rotation=[0, HALF, 0, HALF], translation=[1, 0, 0])
    document.node(camera=2)
    path = read_path(document, tmp_path)
    assert np.allclose(path.positions, [[0, 2, 5], [1, 2, 5]])
    assert np.allclose(path.directions, [[0, 0, -1], [-1, 0, 0]])
    # the narrowest shows the most detail
    assert path.field_of_view == pytest.approx(np.degrees(0.5))
    assert path.aspect == pytest.approx(16 / 9)


def test_without_a_camera_there_is_no_path(tmp_path: Path) -> None:
    document = Document()
    document.node(mesh=document.mesh())
    assert read_scene(document.write(tmp_path / "a.glb")).camera is None


def test_a_camera_moves_evenly_between_keys(tmp_path: Path) -> None:
    document = Document()
    document.node(camera=0)
    animation = animate(document, 0, "translation", [1, 2, 4], [[0, 0, 0], [4, 0, 0], [4, 0, 8]], "LINEAR")
    positions = read_path(document, tmp_path, animations=[animation]).positions
    assert len(positions) > 50
    assert np.allclose(positions[0], 0) and np.allclose(positions[-1], [4, 0, 8])
    on_first, on_second = positions[:, 2] == 0, np.isclose(positions[:, 0], 4)
    assert (on_first | on_second).all()
    assert (on_first & on_second).any()  # the corner itself is on the path
    assert np.linalg.norm(np.diff(positions, axis=0), axis=1).max() < 0.2


def test_steps_do_not_pass_through_between(tmp_path: Path) -> None:
    document = Document()
    document.node(camera=0)
    animation = animate(document, 0, "translation", [0, 1], [[0, 0, 0], [4, 0, 0]], "STEP")
    assert set(read_path(document, tmp_path, animations=[animation]).positions[:, 0]) == {0.0, 4.0}


def test_splines_pass_keys_with_their_tangents(tmp_path: Path) -> None:
    document = Document()
    document.node(camera=0)
    # p(t) = t^2 along x on [0, 2]: value and slope at both ends give the parabola back
    values = [[0, 0, 0], [0, 0, 0], [0, 0, 0], [4, 0, 0], [4, 0, 0], [0, 0, 0]]
    animation = animate(document, 0, "translation", [0, 2], values, "CUBICSPLINE")
    positions = read_path(document, tmp_path, animations=[animation]).positions
    times = np.linspace(0, 2, len(positions))
    assert np.allclose(positions[:, 0], times**2, atol=1e-6)


def test_turns_of_a_parent_carry_the_camera_round(tmp_path: Path) -> None:
    document = Document()
    document.node(name="pivot", children=[1])
    document.node(camera=0, translation=[0, 0, 3])
    # from no turn to a half turn about y by way of a quarter, one key with its sign reversed
    values = [[0, 0, 0, 1], [0, -HALF, 0, -HALF], [0, 1, 0, 0]]
    animation = animate(document, 0, "rotation", [0, 1, 2], values, "LINEAR")
    path = read_path(document, tmp_path, animations=[animation])
    assert np.allclose(np.linalg.norm(path.positions, axis=1), 3)
    assert np.allclose(path.directions, -path.positions / 3, atol=1e-6)
    angle = np.unwrap(np.arctan2(path.positions[:, 0], path.positions[:, 2]))
    assert angle[-1] == pytest.approx(np.pi, abs=1e-5)
    assert (np.diff(angle) > 0).all()
