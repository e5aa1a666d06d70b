"""Every generated surface is what it says: oriented, watertight where closed, without degenerate faces."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from weathercoat.errors import LimitError, UsageError
from weathercoat.mesh import shapes
from weathercoat.mesh.surface import Surface

OPEN = {"plate", "curved-plate", "sheet"}
GENUS = {
    "sphere": 0, "torus": 1, "pipe": 1, "barrel": 0, "box": 0, "sign": 4, "bracket": 4, "gear": 1,
    "corrugated": 0,
}  # fmt: skip


def directed_edges(surface: Surface) -> np.ndarray:
    return np.stack([surface.faces, np.roll(surface.faces, -1, axis=1)], axis=2).reshape(-1, 2)


def euler_number(surface: Surface) -> int:
    edges = np.unique(np.sort(directed_edges(surface), axis=1), axis=0)
    return len(surface.vertices) - len(edges) + len(surface.faces)


def volume(surface: Surface) -> float:
    return float(np.linalg.det(surface.vertices[surface.faces]).sum() / 6)


@pytest.mark.parametrize("name", shapes.SHAPES)
def test_manifold_and_oriented_without_slivers(name: str) -> None:
    surface = shapes.SHAPES[name]()
    edges = directed_edges(surface)
    assert len(np.unique(edges, axis=0)) == len(edges), "an edge runs the same way in two faces"
    assert set(np.unique(surface.faces)) == set(range(len(surface.vertices)))
    assert len(np.unique(surface.vertices, axis=0)) == len(surface.vertices), "two vertices in one place"
    areas = surface.face_areas()
    assert areas.min() > 0.05 * areas.mean()
    assert surface.name == name and surface.groups == (name,)


@pytest.mark.parametrize("name", GENUS)
def test_closed_shapes_are_watertight_and_outward(name: str) -> None:
    surface = shapes.SHAPES[name]()
    edges = {tuple(edge) for edge in directed_edges(surface)}
    assert all((b, a) in edges for a, b in edges)
    assert euler_number(surface) == 2 - 2 * GENUS[name]
    assert volume(surface) > 0


@pytest.mark.parametrize("name", sorted(OPEN))
def test_sheets_are_discs_that_face_forwards(name: str) -> None:
    surface = shapes.SHAPES[name]()
    assert euler_number(surface) == 1
    a, b, c = (surface.vertices[surface.faces[:, i]] for i in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_every_shape_is_open_or_closed() -> None:
    assert set(shapes.SHAPES) == OPEN | set(GENUS)


def test_volumes_against_formulas() -> None:
    """Inscribed polygons fall short of their circles by the factor sin(x)/x, x the angle of a segment."""
    assert volume(shapes.make_box(2, 3, 5)) == pytest.approx(30, rel=1e-12)
    ring = math.sin(2 * math.pi / 64) / (2 * math.pi / 64)
    pipe = shapes.make_pipe(2, 0.5, 3, segments=64)
    assert volume(pipe) == pytest.approx(ring * math.pi * (2**2 - 1.5**2) * 3, rel=1e-12)
    sphere = shapes.make_sphere(1, 5)
    assert volume(sphere) == pytest.approx(4 / 3 * math.pi, rel=2e-3)
    assert np.linalg.norm(sphere.vertices, axis=1) == pytest.approx(1, rel=1e-14)
    bent = volume(shapes.make_bracket(hole=1e-3, edge_length=0.02))
    assert bent == pytest.approx(0.4 * 0.03 * (0.54 + 0.44 + 0.06 * math.pi / 2), rel=2e-3)


def test_plate_grid_has_its_counts_and_area() -> None:
    plate = shapes.make_plate(2.0, 3.0, 4, 5)
    assert (len(plate.vertices), len(plate.faces)) == (5 * 6, 2 * 4 * 5)
    assert plate.area() == pytest.approx(6, rel=1e-14)


@settings(max_examples=25, deadline=None)
@given(st.integers(8, 600), st.integers(0, 2**32), st.floats(0.5, 2))
def test_random_sheet_meets_its_face_count_and_area(faces: int, seed: int, width: float) -> None:
    sheet = shapes.make_random_sheet(max(faces, 30), width, 1.0, seed)
    assert len(sheet.faces) == max(faces, 30)
    assert sheet.area() == pytest.approx(width, rel=1e-12)
    assert euler_number(sheet) == 1


def test_random_sheet_repeats_and_varies() -> None:
    first, again, other = (shapes.make_random_sheet(500, seed=seed) for seed in (7, 7, 8))
    assert first.vertices.tobytes() == again.vertices.tobytes()
    assert first.faces.tobytes() == again.faces.tobytes()
    assert first.vertices.tobytes() != other.vertices.tobytes()


def test_random_sheet_is_homogeneous_and_shows_no_direction() -> None:
    """The bars that remeshing has to meet, but for 0.15 on the lengths: points on the rim do not move."""
    sheet = shapes.make_random_sheet(4000)
    edges = np.unique(np.sort(directed_edges(sheet), axis=1), axis=0)
    run = sheet.vertices[edges[:, 1]] - sheet.vertices[edges[:, 0]]
    length = np.linalg.norm(run, axis=1)
    assert length.std() / length.mean() < 0.15
    angle = np.arctan2(run[:, 1], run[:, 0])
    for order in (2, 4, 6):
        assert abs(np.exp(1j * order * angle).mean()) < 0.06


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("plate", {"width": 0.0}),
        ("plate", {"columns": 0}),
        ("plate", {"height": math.nan}),
        ("curved-plate", {"angle": 360.0}),
        ("torus", {"tube": 0.5}),
        ("pipe", {"wall": 0.2}),
        ("barrel", {"height": 0.5}),
        ("sign", {"hole": 0.07}),
        ("bracket", {"thickness": 0.2}),
        ("gear", {"bore": 0.39}),
        ("sheet", {"width": 1e-3, "faces": 100}),
    ],
)
def test_impossible_shapes_are_refused(name: str, arguments: dict[str, float]) -> None:
    with pytest.raises(UsageError):
        shapes.SHAPES[name](**arguments)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("plate", {"columns": 10**6, "rows": 10**6}),
        ("curved-plate", {"columns": 10**6, "rows": 10**6}),
        ("sphere", {"subdivisions": 10**9}),
        ("torus", {"segments": 10**9}),
        ("pipe", {"rows": 10**9}),
        ("barrel", {"height": 1e300}),
        ("box", {"cells": 10**6}),
        ("sign", {"edge_length": 1e-9}),
        ("bracket", {"edge_length": 1e-9}),
        ("gear", {"teeth": 10**9}),
        ("sheet", {"faces": 10**9}),
    ],
)
def test_shapes_that_would_fill_the_memory_are_refused_at_once(
    name: str, arguments: dict[str, float]
) -> None:
    with pytest.raises(LimitError):
        shapes.SHAPES[name](**arguments)
