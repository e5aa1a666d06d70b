"""The substrate: film below the tangent plane of its origin is put back on it."""

from __future__ import annotations

import numpy as np

from weathercoat.deform.plain import lift_to_substrate


def test_only_what_is_below_moves_and_only_along_the_normal() -> None:
    """Film vertices of two origins; the second one's plane is tilted by 45 degrees through (1, 0, 0)."""
    tilted = np.array([1.0, 0.0, 1.0]) / np.sqrt(2)
    rest_positions = np.array([(0, 0, 0), (1, 0, 0)], float)
    rest_normals = np.array([(0, 0, 1), tilted])
    origin = np.array([0, 1, 1, 0], np.int32)
    positions = np.array([(5, 5, -2), (1, 3, -1), (1, 3, 1), (0, 0, -7)], float)
    lift_to_substrate(positions, origin, rest_positions, rest_normals, np.array([0, 1, 2], np.int32))
    np.testing.assert_allclose(positions, [(5, 5, 0), (1.5, 3, -0.5), (1, 3, 1), (0, 0, -7)], atol=1e-15)


def test_nothing_stays_below_whatever_its_normal() -> None:
    """The plane through the rest position is met to round-off: 1e-15 for coordinates of order one."""
    random = np.random.default_rng(1)
    rest_positions, positions = random.uniform(-1, 1, (2, 200, 3))
    normals = random.normal(size=(200, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    vertices = np.arange(200, dtype=np.int32)
    lift_to_substrate(positions, vertices, rest_positions, normals, vertices)
    height = np.einsum("ij,ij->i", positions - rest_positions, normals)
    assert height.min() > -1e-15
    assert (height > 0.01).any()
