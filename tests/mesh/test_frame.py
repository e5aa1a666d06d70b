"""The frame of a shape: moved, scaled and turned with the shape and gravity, and blind to numbering."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests import zoo
from tests.mesh.test_dihedral import random_rotation
from weathercoat.mesh import shapes
from weathercoat.mesh.frame import make_frame
from weathercoat.mesh.surface import Surface, Vectors, make_surface

BRACKET = shapes.make_bracket(edge_length=0.1)


def turned(surface: Surface, rotation: Vectors) -> Surface:
    """The surface and its up turned together."""
    up = rotation @ np.array(surface.up)
    return replace(surface, vertices=surface.vertices @ rotation.T, up=tuple(up))


def is_right_handed_basis(axes: Vectors) -> bool:
    """Orthonormal to a few roundings, with determinant +1."""
    return np.allclose(axes @ axes.T, np.eye(3), atol=1e-14) and np.linalg.det(axes) > 0


def test_of_a_known_triangle() -> None:
    """Area 1/2, centre at a third of the corners' sum, up in the plane."""
    surface = make_surface(np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], float), np.array([(0, 1, 2)]))
    frame = make_frame(surface)
    np.testing.assert_allclose(frame.origin, [1 / 3, 1 / 3, 0], atol=1e-15)
    assert frame.size == pytest.approx(np.sqrt(0.5))
    assert frame.axes[2].tolist() == [0, 1, 0]
    assert is_right_handed_basis(frame.axes)


@pytest.mark.parametrize("surface", [BRACKET, shapes.make_sphere(subdivisions=1), zoo.make_hexagon(2)])
@pytest.mark.parametrize("up", [(0, 1, 0), (0, 0, 1), (1, 0, 0), (-1, 0, 0), (1, -2, 3)])
def test_is_a_basis_with_up_last_and_goes_there_and_back(
    surface: Surface, up: tuple[float, float, float]
) -> None:
    surface = replace(surface, up=up)
    frame = make_frame(surface)
    assert is_right_handed_basis(frame.axes)
    np.testing.assert_allclose(frame.axes[2], np.array(up) / np.linalg.norm(up), atol=1e-15)
    local = frame.localise(surface.vertices)
    np.testing.assert_allclose(frame.globalise(local), surface.vertices, atol=1e-14)
    area = replace(surface, vertices=local).area()
    assert area == pytest.approx(1.0), "in the frame, lengths are in sizes"
    np.testing.assert_allclose(frame.turn(local), (surface.vertices - frame.origin) / frame.size, atol=1e-13)


@pytest.mark.parametrize("seed", range(6))
def test_local_coordinates_do_not_change_with_place_unit_and_turn(seed: int) -> None:
    """Coordinates of a few sizes round at 1e-15; the axes multiply that by 1 / spread, about 10."""
    random = np.random.default_rng(seed)
    expected = make_frame(BRACKET).localise(BRACKET.vertices)
    moved = turned(BRACKET, random_rotation(seed))
    moved = replace(moved, vertices=moved.vertices * 10.0 ** random.uniform(-6, 6))
    moved = replace(moved, vertices=moved.vertices + random.uniform(-1, 1, 3) * moved.size())
    np.testing.assert_allclose(make_frame(moved).localise(moved.vertices), expected, atol=1e-13)


def test_first_axis_is_the_long_one_towards_the_heavier_tail() -> None:
    """A lying wedge, wide at x = 0 and narrow at x = 3: its third moment is positive along x."""
    plate = shapes.make_plate(columns=12, rows=4)
    along, across = plate.vertices[:, 0] + 0.5, plate.vertices[:, 1] - 0.5
    for sign in (1, -1):
        wedge = np.stack([3 * along, np.zeros_like(along), across * (1 - 0.9 * along)], axis=1)
        surface = make_surface(wedge * (sign, 1, sign), plate.faces)
        # the third moment decides the sign only; the axis is that of the second, which the diagonals tilt a
        # little
        assert make_frame(surface).axes[0] @ [sign, 0, 0] > 0.999


@pytest.mark.parametrize(
    "surface",
    [shapes.make_sphere(subdivisions=2), shapes.make_plate(columns=4, rows=4), shapes.make_barrel()],
)
def test_symmetric_shapes_take_the_models_axes(surface: Surface) -> None:
    frame = make_frame(surface)
    np.testing.assert_allclose(frame.axes, [(1, 0, 0), (0, 0, -1), (0, 1, 0)], atol=1e-15)


@pytest.mark.parametrize("seed", range(4))
def test_renumbering_changes_no_bit(seed: int) -> None:
    for surface in (BRACKET, shapes.make_plate(columns=16, rows=16), shapes.make_random_sheet(faces=300)):
        first, second = make_frame(surface), make_frame(zoo.renumber(surface, seed))
        assert first.origin.tobytes() == second.origin.tobytes()
        assert first.size == second.size
        assert first.axes.tobytes() == second.axes.tobytes()
