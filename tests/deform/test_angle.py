"""Angle constraints on single hinges: the formula, conservation laws, and what each form can do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import zoo
from tests.mesh.test_dihedral import bend_of, gradient_of, hinges
from weathercoat.deform.angle import FORMS
from weathercoat.deform.plain import project_angles
from weathercoat.mesh.surface import Vectors

HINGE = np.array([(0, 1, 2, 3)], np.int32)
FREE = np.ones(4)
CLAMPED = np.array([0.0, 0.0, 1.0, 1.0])
SIGNED = ["dihedral", "split"]


def project(
    form: str,
    points: Vectors,
    target: float,
    inverse_mass: Vectors = FREE,
    times: int = 1,
    stiffness: float = 1.0,
) -> Vectors:
    """The hinge after a number of projections on a wanted bend."""
    result = np.array(points, float)
    wanted = np.tan(target / 2) if form == "dihedral" else target
    for _ in range(times):
        project_angles(FORMS[form], result, inverse_mass, HINGE, np.array([wanted]), stiffness)
    return result


@settings(max_examples=100, deadline=None)
@given(points=hinges, target=st.floats(-2.5, 2.5), seed=st.integers(0, 1000))
def test_one_projection_is_the_position_based_formula(points: Vectors, target: float, seed: int) -> None:
    """Eq. 3, Delta p = -w grad C C / sum w |grad C|^2, with C = 2 tan((bend - target) / 2) clamped to 1.

    Masses within a factor of four, so that the bound on leverage is not reached.
    """
    weights = np.random.default_rng(seed).uniform(0.5, 2.0, 4)
    bend, gradient = gradient_of(points)
    sine, cosine = np.sin((bend - target) / 2), np.cos((bend - target) / 2)
    error = 2 * sine / cosine if 2 * abs(sine) < cosine else np.sign(sine)
    step = error / np.sum(weights[:, None] * gradient**2)
    expected = points - weights[:, None] * gradient * step
    np.testing.assert_allclose(project("dihedral", points, target, weights), expected, atol=1e-11)


@settings(max_examples=60, deadline=None)
@given(points=hinges, target=st.floats(-2.5, 2.5), form=st.sampled_from(["dihedral", "arccos"]))
def test_inner_forces_neither_push_nor_spin(points: Vectors, target: float, form: str) -> None:
    """With equal masses the centre and, to first order, the angular momentum are kept.

    Moves of up to 5 (1 rad over 0.2) times arms of 2 round at 1e-14.
    """
    move = project(form, points, target) - points
    np.testing.assert_allclose(move.sum(axis=0), 0.0, atol=1e-13)
    np.testing.assert_allclose(np.cross(points, move).sum(axis=0), 0.0, atol=1e-12)


@pytest.mark.parametrize("form", SIGNED)
@pytest.mark.parametrize(
    "masses", [FREE, CLAMPED, np.array([0.0, 0.0, 1.0, 0.0]), np.array([0.5, 1.0, 2.0, 1.0])]
)
@pytest.mark.parametrize("start", [-2.0, -0.3, 0.0, 0.3, 2.0])
@pytest.mark.parametrize("target", [-2.4, -1.0, 0.0, 0.5, 2.4])
def test_signed_forms_meet_any_target_from_any_fold(
    form: str, masses: Vectors, start: float, target: float
) -> None:
    """A Newton iteration on a smooth angle ends in round-off: 1e-12 of angles of order one.

    Halves of the split form need a neutral direction of their own, so there a single free apex converges too,
    linearly.
    """
    points = zoo.make_hinge(start).vertices
    after = project(form, points, target, masses, times=200)
    assert bend_of(after) == pytest.approx(target, abs=1e-12)
    assert (after[masses == 0] == points[masses == 0]).all()


@settings(max_examples=40, deadline=None)
@given(points=hinges, target=st.floats(-2.0, 2.0))
def test_the_dihedral_form_converges_on_hinges_of_any_shape(points: Vectors, target: float) -> None:
    after = project("dihedral", points, target, times=500)
    assert bend_of(after) == pytest.approx(target, abs=1e-10)


def test_stiffness_takes_that_share_of_the_way() -> None:
    """A small error, so that the correction is linear in it to 1e-4 of itself."""
    points = zoo.make_hinge(0.0).vertices
    whole = project("dihedral", points, 1e-2) - points
    np.testing.assert_allclose(
        project("dihedral", points, 1e-2, stiffness=0.25) - points, 0.25 * whole, atol=1e-15
    )


@pytest.mark.parametrize("form", ["dihedral", "split", "arccos"])
def test_a_met_target_moves_nothing(form: str) -> None:
    points = zoo.make_hinge(-0.7).vertices
    np.testing.assert_allclose(project(form, points, -0.7), points, atol=1e-15)


@pytest.mark.parametrize("form", ["dihedral", "split", "arccos"])
@pytest.mark.parametrize("apex", [2, 3])
def test_a_face_of_no_area_stays(form: str, apex: int) -> None:
    points = zoo.make_hinge(0.4).vertices.copy()
    points[apex] = (0.3, 0.0, 0.0)
    assert (project(form, points, 1.0) == points).all()


@pytest.mark.parametrize("form", ["dihedral", "split", "arccos"])
@settings(max_examples=60, deadline=None)
@given(
    points=st.integers(0, 10**6).map(lambda seed: np.random.default_rng(seed).uniform(-1, 1, (4, 3))),
    target=st.floats(-2.8, 2.8),
    free=st.integers(0, 3),
)
def test_no_correction_throws_a_point_far(form: str, points: Vectors, target: float, free: int) -> None:
    """A single free point whose leverage may vanish: at most 1 rad over at least 0.05 of both apexes'.

    With heights h and gradients 1 / h of the apexes, and those of an edge's end at most a lever times them,
    the move is below 1 lever (1/h3 + 1/h4) / (0.05 (1/h3^2 + 1/h4^2)), hence 40 levers of the lower height.
    The split form moves an end of the edge twice, the second time with the lever that the first left: twice
    that.
    """
    masses = np.zeros(4)
    masses[free] = 1.0
    edge = np.linalg.norm(points[1] - points[0])
    normals = [np.cross(points[1] - points[0], points[k] - points[0]) for k in (2, 3)]
    heights = [np.linalg.norm(n) / edge for n in normals]
    lever = 1 + max(np.linalg.norm(points[k] - points[0]) for k in (2, 3)) / edge
    after = project(form, points, target, masses)
    assert np.isfinite(after).all()
    assert np.linalg.norm(after - points) <= 80 * lever * min(heights) + 1e-9


# --- what tells the forms apart ---


@pytest.mark.parametrize("form", SIGNED)
def test_signed_forms_fold_a_ridge_into_a_valley_through_flat(form: str) -> None:
    after = project(form, zoo.make_hinge(0.6).vertices, -0.8, times=200)
    assert bend_of(after) == pytest.approx(-0.8, abs=1e-12)


@pytest.mark.parametrize("start", [0.6, -0.6])
def test_arccos_cannot_tell_a_ridge_from_a_valley(start: float) -> None:
    """Both of them end at outer dihedrals whose arccos is that of pi - 0.8, each on its own side."""
    after = project("arccos", zoo.make_hinge(start).vertices, -0.8, times=200)
    assert bend_of(after) == pytest.approx(np.sign(start) * 0.8, abs=1e-12)


def test_arccos_has_no_gradient_at_flat() -> None:
    points = zoo.make_hinge(0.0).vertices
    assert (project("arccos", points, -0.8) == points).all()
    assert bend_of(project("dihedral", points, -0.8)) < -0.5
    assert bend_of(project("split", points, -0.8)) < -0.5


@pytest.mark.parametrize("target", [-0.8, 0.0, 0.8])
def test_the_split_form_opens_what_is_folded_on_itself(target: float) -> None:
    """Where n1 + n2 = 0 there is no neutral direction; the hinge is a valley or a ridge as its target is."""
    points = np.array([(0, 0, 0), (1, 0, 0), (0.5, 1, 0), (0.5, 1, 0)], float)
    after = project("split", points, target, times=200)
    assert bend_of(after) == pytest.approx(target, abs=1e-12)


@pytest.mark.parametrize("height", [0.05, 0.2, 1.0, 5.0])
def test_the_split_form_converges_where_the_faces_differ_in_height(height: float) -> None:
    points = np.array([(0, 0, 0), (1, 0, 0), (0.5, 1, 0), (0.5, -height, 0)], float)
    after = project("split", points, -0.8, times=2000)
    assert bend_of(after) == pytest.approx(-0.8, abs=1e-9)


@pytest.mark.parametrize("target", [-1.2, 1.2])
def test_the_split_form_turns_each_face_to_half_the_outer_dihedral(target: float) -> None:
    """Paper 4.3, with the edge held: each face makes phi_0 / 2 with the neutral direction, here +z."""
    after = project("split", zoo.make_hinge(0.0).vertices, target, CLAMPED, times=100)
    for apex in (2, 3):
        way = after[apex] - (0.5, 0, 0)
        assert np.arccos(way[2] / np.linalg.norm(way)) == pytest.approx((np.pi + target) / 2, abs=1e-12)
