"""The film as a shell, against counts, volumes and lengths known beforehand."""

from __future__ import annotations

import numpy as np
import pytest

from tests.output.scenes import make_plate, make_sphere
from weathercoat.output.shell import corner_normals, make_shell, open_edges, smooth_outline

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def test_open_edges_are_the_outline_in_the_order_of_the_faces() -> None:
    tails, heads, owners = open_edges(SQUARE[1])
    assert list(zip(tails.tolist(), heads.tolist(), owners.tolist(), strict=True)) == [
        (0, 1, 0), (1, 2, 0), (2, 3, 1), (3, 0, 1),
    ]  # fmt: skip
    assert len(open_edges(make_plate(7)[1])[0]) == 28
    assert len(open_edges(make_sphere(200)[1])[0]) == 0
    assert len(open_edges(np.empty((0, 3), np.int32))[0]) == 0


@pytest.mark.parametrize("bevel", [0.0, 0.01])
def test_a_shell_is_closed_and_consistently_oriented(bevel: float) -> None:
    vertices, faces = make_plate(6)
    shell = make_shell(vertices, faces[5:], 0.02, gap=0.01, bevel=bevel)
    everything = np.concatenate([shell.front, shell.back, shell.rim])
    directed = np.stack([everything, np.roll(everything, -1, axis=1)], axis=2).reshape(-1, 2)
    forward = np.unique(directed, axis=0)
    assert len(forward) == len(directed)
    assert np.array_equal(forward, np.unique(directed[:, ::-1], axis=0))


def test_a_flat_shell_has_the_volume_of_area_times_thickness() -> None:
    vertices, faces = make_plate(6)
    shell = make_shell(vertices, faces, 0.02, gap=0.01)
    assert np.allclose(shell.vertices[: len(vertices), 2], 0.03)
    assert np.allclose(shell.vertices[len(vertices) :, 2], 0.01)
    assert volume(shell.vertices, np.concatenate([shell.front, shell.back, shell.rim])) == pytest.approx(0.02)


def test_bevel_moves_straight_edges_inwards_and_mitres_corners() -> None:
    vertices, faces = SQUARE
    front = make_shell(vertices, faces, 0.1, bevel=0.05).vertices[:4, :2]
    assert np.allclose(front, [[0.05, 0.05], [0.95, 0.05], [0.95, 0.95], [0.05, 0.95]])


def test_bevel_never_exceeds_a_quarter_of_the_shortest_edge() -> None:
    vertices, faces = SQUARE
    front = make_shell(vertices, faces, 0.1, bevel=10.0).vertices[:4, :2]
    assert np.allclose(np.linalg.norm(front - vertices[:, :2], axis=1), 0.25)


def zigzag_strips() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two strips that meet along a zigzag, each with vertices of its own, and those of the first."""
    x = np.arange(12.0)
    zigzag = np.stack([x, 0.3 * (-1.0) ** np.arange(12), 0 * x], axis=1)
    above, below = zigzag + np.array([0, 2, 0]), zigzag - np.array([0, 2, 0])
    lower, upper = np.arange(11), np.arange(11) + 12
    strip = np.concatenate(
        [np.stack([lower, lower + 1, upper + 1], 1), np.stack([lower, upper + 1, upper], 1)]
    )
    vertices = np.concatenate([below, zigzag, zigzag, above])
    return vertices, np.concatenate([strip, strip + 24]).astype(np.int32), np.arange(12, 24)


def test_smoothing_keeps_a_closed_crack_closed_and_straightens_it() -> None:
    vertices, faces, crack = zigzag_strips()
    fixed = np.zeros(len(vertices), np.bool_)
    fixed[[0, 11, 12, 23, 24, 35, 36, 47]] = True
    smooth = smooth_outline(vertices, faces, fixed, 2)
    assert np.array_equal(smooth[crack], smooth[crack + 12])
    assert np.array_equal(smooth[fixed], vertices[fixed])
    middle = crack[4:8]
    assert np.abs(smooth[middle, 1]).max() < 0.2 * np.abs(vertices[middle, 1]).max()
    assert np.allclose(smooth[:, 2], 0.0)


def test_smoothing_leaves_straight_outlines_and_the_interior_alone() -> None:
    x, y = np.meshgrid(np.arange(5.0), np.arange(5.0))
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    cell = np.arange(25).reshape(5, 5)
    a, b, c, d = (part.ravel() for part in (cell[:-1, :-1], cell[:-1, 1:], cell[1:, 1:], cell[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    corners = np.isin(np.arange(25), [0, 4, 20, 24])
    assert np.allclose(smooth_outline(vertices, faces, corners, 3), vertices, atol=1e-12)


def test_smoothing_does_not_cut_across_a_crease() -> None:
    # A roof: at the ridge the middle of the two neighbours lies inside the roof.
    vertices = np.array([[-1.0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [0, 1, 1], [1, 1, 0]])
    faces = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]], np.int32)
    smooth = smooth_outline(vertices, faces, np.isin(np.arange(6), [0, 2, 3, 5]), 2)
    assert np.array_equal(smooth, vertices)


def test_corner_normals_keep_creases_sharp_and_the_rest_smooth() -> None:
    points, faces = make_sphere(600)
    normals = corner_normals(points, faces, np.radians(40.0))
    radial = points[faces] / np.linalg.norm(points[faces], axis=2, keepdims=True)
    assert np.einsum("ijk,ijk->ij", normals, radial).min() > np.cos(np.radians(3.0))
    roof = np.array([[-1.0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 1]])
    folded = np.array([[0, 1, 3], [1, 2, 3]], np.int32)
    sharp = corner_normals(roof, folded, np.radians(40.0))
    for face in range(2):
        a, b, c = roof[folded[face]]
        plain = np.cross(b - a, c - a)
        assert np.allclose(sharp[face], plain / np.linalg.norm(plain), atol=1e-6)
    smooth = corner_normals(roof, folded, np.radians(100.0))
    assert np.allclose(smooth[0, 1], smooth[1, 0])
    assert np.allclose(np.linalg.norm(smooth, axis=2), 1.0, atol=1e-6)
