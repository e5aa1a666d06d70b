"""The dihedral angle: known folds, signs, degenerate hinges, and its gradient against finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests import zoo
from weathercoat.mesh.dihedral import all_bends, bend_angle, bend_gradient, half_edge_bend
from weathercoat.mesh.surface import Vectors

# A fold's sine and cosine are formed from products of coordinates of order one: a few roundings of 2.2e-16
# each.
ROUNDOFF = 1e-14


def bend_of(points: Vectors) -> float:
    return float(bend_angle(np.ascontiguousarray(points, float), 0, 1, 2, 3))


def gradient_of(points: Vectors) -> tuple[float, Vectors]:
    out = np.full((4, 3), np.nan)
    return float(bend_gradient(np.ascontiguousarray(points, float), 0, 1, 2, 3, out)), out


def random_hinge(seed: int) -> Vectors:
    """Four points of order one: any fold, faces of any shape."""
    return np.random.default_rng(seed).uniform(-1, 1, (4, 3))


def is_well_shaped(points: Vectors) -> bool:
    """Whether the edge and both heights over it are at least 0.2, so that differences of 1e-6 are small."""
    edge = points[1] - points[0]
    length = np.linalg.norm(edge)
    if length < 0.2:
        return False
    return all(np.linalg.norm(np.cross(edge, points[i] - points[0])) / length > 0.2 for i in (2, 3))


def random_rotation(seed: int) -> Vectors:
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


hinges = st.integers(0, 10**9).map(random_hinge).filter(is_well_shaped)


@pytest.mark.parametrize("bend", np.radians([-179, -135, -90, -30, -1, -1e-6, 1e-6, 1, 30, 90, 135, 179]))
def test_known_folds(bend: float) -> None:
    """A ridge is positive (outer dihedral above pi), a valley negative, up to folds near 0 and 2 pi."""
    assert bend_of(zoo.make_hinge(bend).vertices) == pytest.approx(bend, abs=ROUNDOFF)


def test_flat_is_exactly_zero() -> None:
    assert bend_of(zoo.make_hinge(0.0).vertices) == 0.0
    assert bend_of(np.array([(0, 0, 0), (3, 1, 0), (0.3, 2, 0), (1.5, -0.7, 0)])) == 0.0


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9])
def test_almost_closed_folds_keep_their_sign(sign: int, gap: float) -> None:
    """Bends towards -pi and pi: outer dihedrals towards 0 and 2 pi; the gap is resolved."""
    p4 = (0.5, zoo.HALF_ROOT_3 * np.cos(gap), -sign * zoo.HALF_ROOT_3 * np.sin(gap))
    points = zoo.make_hinge().vertices.copy()
    points[3] = p4
    bend = bend_of(points)
    assert np.sign(bend) == sign
    assert np.pi - abs(bend) == pytest.approx(gap, abs=ROUNDOFF)


def test_regular_solids() -> None:
    """Bends of pi minus the inner dihedral: tetrahedron arccos(1/3), octahedron arccos(-1/3)."""
    for surface, inner in (
        (zoo.make_tetrahedron(), np.arccos(1 / 3)),
        (zoo.make_octahedron(), np.arccos(-1 / 3)),
    ):
        mesh = zoo.make_mesh(surface)
        bends = np.empty(len(mesh.twin))
        all_bends(mesh.positions, mesh.tail, mesh.twin, bends)
        np.testing.assert_allclose(bends, np.pi - inner, atol=ROUNDOFF)


def test_inside_out_turns_the_sign() -> None:
    ridge = zoo.make_hinge(0.7).vertices
    assert bend_of(ridge[[1, 0, 2, 3]]) == pytest.approx(-0.7, abs=ROUNDOFF)


def test_both_half_edges_of_a_pair_agree_and_a_rim_is_flat() -> None:
    mesh = zoo.make_mesh(zoo.make_roof(0.8))
    bends = np.empty(len(mesh.twin))
    all_bends(mesh.positions, mesh.tail, mesh.twin, bends)
    paired = mesh.twin >= 0
    np.testing.assert_allclose(bends[paired], bends[mesh.twin[paired]], atol=ROUNDOFF)
    assert (bends[~paired] == 0.0).all()
    ridge = zoo.find_half_edge(mesh, 1, 4)
    assert half_edge_bend(ridge, mesh.positions, mesh.tail, mesh.twin) == pytest.approx(0.8, abs=ROUNDOFF)


@settings(max_examples=200, deadline=None)
@given(points=hinges)
def test_gradient_is_that_of_central_differences(points: Vectors) -> None:
    """A central difference over s errs by s^2 f''' / 6 and by rounding / s.

    With s = 1e-6 and heights of at least 0.2, third derivatives are below 1e4 and both are below 1e-8.
    """
    bend, gradient = gradient_of(points)
    assume(abs(bend) < np.pi - 1e-3)  # a difference across +-pi is none
    assert bend == pytest.approx(bend_of(points), abs=ROUNDOFF)
    step = 1e-6
    expected = np.empty((4, 3))
    for i in range(4):
        for axis in range(3):
            moved = np.zeros((4, 3))
            moved[i, axis] = step
            expected[i, axis] = (bend_of(points + moved) - bend_of(points - moved)) / (2 * step)
    np.testing.assert_allclose(gradient, expected, atol=1e-8)


@settings(max_examples=100, deadline=None)
@given(points=hinges)
def test_gradient_knows_no_force_and_no_torque(points: Vectors) -> None:
    """The bend does not change under translation (gradient sums to zero) and rotation (no torque about the
    origin).

    Gradients of at most 1 / 0.2 per point, and arms of at most 2: sums of a dozen terms round at 1e-13.
    """
    _, gradient = gradient_of(points)
    np.testing.assert_allclose(gradient.sum(axis=0), 0.0, atol=1e-13)
    np.testing.assert_allclose(np.cross(points, gradient).sum(axis=0), 0.0, atol=1e-13)


@settings(max_examples=60, deadline=None)
@given(points=hinges, seed=st.integers(0, 10**6), scale=st.floats(1e-3, 1e3))
def test_similarities_leave_the_bend(points: Vectors, seed: int, scale: float) -> None:
    """Rotation, translation by up to 10, and scale; the moved coordinates carry errors of 1e-15."""
    bend = bend_of(points)
    assume(abs(bend) < np.pi - 1e-6)
    moved = (points @ random_rotation(seed).T + np.random.default_rng(seed).uniform(-10, 10, 3)) * scale
    assert bend_of(moved) == pytest.approx(bend, abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(points=hinges, axis=st.integers(0, 2))
def test_a_mirror_turns_the_sign(points: Vectors, axis: int) -> None:
    """A mirror turns outside in; the same corners then read the fold from the other side."""
    mirrored = points.copy()
    mirrored[:, axis] *= -1
    assert bend_of(mirrored) == pytest.approx(-bend_of(points), abs=ROUNDOFF)


DEGENERATE = {
    "edge of no length": [(0, 0, 0), (0, 0, 0), (0, 1, 0), (0, -1, 0)],
    "first face of no area": [(0, 0, 0), (1, 0, 0), (0.5, 0, 0), (0.5, -1, 0)],
    "second face of no area": [(0, 0, 0), (1, 0, 0), (0.5, 1, 0), (2, 0, 0)],
    "all in one place": [(1, 2, 3)] * 4,
    "p3 on p1": [(0, 0, 0), (1, 0, 0), (0, 0, 0), (0.5, -1, 0)],
}


@pytest.mark.parametrize("name", DEGENERATE)
def test_degenerate_hinges_are_flat_without_gradient(name: str) -> None:
    points = np.array(DEGENERATE[name], float)
    bend, gradient = gradient_of(points)
    assert bend == bend_of(points) == 0.0
    assert (gradient == 0.0).all()


@pytest.mark.parametrize("scale", [1e-60, 1e-20, 1e20])
def test_tiny_and_huge_hinges_are_finite(scale: float) -> None:
    points = zoo.make_hinge(0.5).vertices * scale
    bend, gradient = gradient_of(points)
    assert bend == pytest.approx(0.5, abs=ROUNDOFF)
    _, unit = gradient_of(zoo.make_hinge(0.5).vertices)
    np.testing.assert_allclose(gradient * scale, unit, rtol=1e-12, atol=1e-14)
