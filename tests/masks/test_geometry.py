"""Masks from the shape, on shapes of which the values are known."""

from __future__ import annotations

import numpy as np
import pytest

from weathercoat.masks.geometry import (
    along_up,
    distance_to,
    fade,
    mean_of_corners,
    sample_picture,
    sharp_edges,
    turned_from,
)
from weathercoat.mesh.halfedge import make_twins
from weathercoat.mesh.shapes import make_sphere
from weathercoat.mesh.surface import Surface, make_surface


def make_tent() -> Surface:
    """Two squares of unit sides that meet in a ridge of 90 degrees, along x."""
    vertices = np.array([[0, -1, -1], [1, -1, -1], [1, 0, 0], [0, 0, 0], [1, 1, -1], [0, 1, -1]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5]], np.int32)
    return make_surface(vertices, faces, up=(0.0, 0.0, 1.0))


def test_a_fade_is_smooth_and_monotone() -> None:
    beyond = np.linspace(-1.0, 2.0, 301)
    values = fade(beyond, 1.0)
    assert (values[beyond <= 0.0] == 1.0).all() and (values[beyond >= 1.0] == 0.0).all()
    assert (np.diff(values) <= 0.0).all() and np.abs(np.diff(values)).max() < 0.016  # slope at most 1.5
    assert fade(np.array([0.5]), 1.0)[0] == 0.5
    assert fade(np.array([-0.1, 0.0, 0.1]), 0.0).tolist() == [1.0, 1.0, 0.0]


def test_heights_begin_at_the_lowest_point() -> None:
    assert along_up(make_tent()).tolist() == [0.0, 0.0, 1.0, 1.0, 0.0, 0.0]


def test_angles_of_a_ball_are_those_of_its_vertices() -> None:
    """A vertex normal of an icosphere is within a degree of its radius."""
    ball = make_sphere(1280)
    radius = ball.vertices / np.linalg.norm(ball.vertices, axis=1, keepdims=True)
    expected = np.degrees(np.arccos(np.clip(radius[:, 0], -1.0, 1.0)))
    np.testing.assert_allclose(turned_from(ball, np.array([3.0, 0.0, 0.0])), expected, atol=1.0)


def test_distances_are_to_segments_not_to_their_lines() -> None:
    segments = np.array([[[0, 0, 0], [1, 0, 0]], [[5, 0, 0], [5, 1, 0]]], float)
    points = np.array([[0.5, 2, 0], [-3, 4, 0], [5, 0.5, 0.25]])
    assert distance_to(points, segments).tolist() == [2.0, 5.0, 0.25]
    assert np.isinf(distance_to(points, np.empty((0, 2, 3)))).all()


@pytest.mark.parametrize(("angle", "rims", "count"), [(80.0, True, 7), (80.0, False, 1), (95.0, False, 0)])
def test_creases_and_rims(angle: float, rims: bool, count: int) -> None:
    tent = make_tent()
    edges = sharp_edges(tent, make_twins(tent.faces), angle, rims=rims)
    assert edges.shape == (count, 2, 3)
    if count == 1:
        assert sorted(edges[0, :, 0]) == [0.0, 1.0] and (edges[0, :, 1:] == 0.0).all()


def test_vertices_take_the_mean_of_their_corners() -> None:
    tent = make_tent()
    values = np.zeros((4, 3))
    values[0] = values[1] = 1.0  # the first square
    assert mean_of_corners(tent, values).tolist() == [1.0, 1.0, 2 / 3, 1 / 3, 0.0, 0.0]


def test_a_picture_lies_with_v_upwards_and_repeats() -> None:
    picture = np.array([[0.1, 0.2], [0.3, 0.4]])  # the top row first
    centres = np.array([[0.25, 0.75], [0.75, 0.75], [0.25, 0.25], [0.75, 0.25]])
    np.testing.assert_allclose(sample_picture(picture, centres), [0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(sample_picture(picture, centres + np.array([3.0, -2.0])), [0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(sample_picture(picture, np.array([[0.5, 0.5], [0.0, 0.75]])), [0.25, 0.15])
