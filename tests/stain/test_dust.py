"""Dust: the product of height, slope and concavity, growing linearly to one."""

from __future__ import annotations

import numpy as np
import pytest

from tests import zoo
from weathercoat.mesh.surface import Surface, Vectors
from weathercoat.stain.dust import dust_at, dust_exposure


def exposure(surface: Surface, up: tuple[float, float, float]) -> Vectors:
    return dust_exposure(zoo.make_mesh(surface), np.array(up, float))


def test_a_level_sheet_that_looks_up_is_half_exposed() -> None:
    """Height 1 (nothing is higher), slope 1, and 1 - pi / 2 pi = 1/2 where flat; looking down, slope 0."""
    np.testing.assert_allclose(exposure(zoo.make_hexagon(2), (0, 0, 1)), 0.5, atol=1e-15)
    np.testing.assert_allclose(exposure(zoo.make_hexagon(2), (0, 0, -1)), 0.0, atol=1e-15)


def test_an_upright_sheet_gathers_dust_low_down() -> None:
    """Slope 1/2, concavity 1/2, and a height term from 1 at the bottom to 0 at the top, linearly."""
    surface = zoo.make_ladder(5)
    np.testing.assert_allclose(
        exposure(surface, (1, 0, 0)), 0.25 * (1 - surface.vertices[:, 0] / 4), atol=1e-15
    )


def test_a_slope_counts_by_its_normal() -> None:
    """(1 - g . n) / 2 with the outward normal n at 60 degrees to up: 3/4."""
    surface = zoo.make_triangle()
    up = (0.0, np.sin(np.pi / 3), np.cos(np.pi / 3))
    low = exposure(surface, up)[0]
    assert low == pytest.approx(0.75 * 0.5, rel=1e-14)


@pytest.mark.parametrize("bend", [-1.5, -0.5, 0.5, 1.5])
def test_hollows_gather_more_than_ridges(bend: float) -> None:
    """1 - phi / 2 pi with phi the mean outer dihedral at a vertex: the fold's edges have pi + bend, the
    others pi.

    An end of the hinge's edge starts two half-edges, of which one is the fold.
    """
    surface = zoo.make_hinge(bend)
    mesh = zoo.make_mesh(surface)
    up = np.array([1.0, 0.0, 0.0])
    slope = 0.5 * (1 + mesh.rest_normals[0] @ up)
    assert dust_exposure(mesh, up)[0] == pytest.approx(slope * (0.5 - bend / 2 / (2 * np.pi)), rel=1e-13)


def test_a_closed_solid() -> None:
    """An octahedron on its corner: the top is highest (0); the bottom looks down (0); the belt has half a
    height.

    There the normal is level (1/2) and the bend is pi - arccos(-1/3) on all edges.
    """
    found = exposure(zoo.make_octahedron(), (0, 0, 1))
    bend = np.pi - np.arccos(-1 / 3)
    np.testing.assert_allclose(found, [0.25 * (0.5 - bend / (2 * np.pi))] * 4 + [0.0, 0.0], atol=1e-15)


def test_dust_grows_linearly_to_one() -> None:
    """A closed form of the age: the number of steps has no part in it."""
    given = np.array([0.0, 0.1, 0.5])
    np.testing.assert_allclose(dust_at(given, 2.0, 0.5), [0.0, 0.1, 0.5], atol=1e-15)
    np.testing.assert_allclose(dust_at(given, 2.0, 3.0), [0.0, 0.6, 1.0], atol=1e-15)
