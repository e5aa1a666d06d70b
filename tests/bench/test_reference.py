"""Reference cases: their shapes are what they claim, and errors measure the distance to them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from weathercoat.bench.reference import (
    ReferenceCase,
    bends_at,
    lengths_at,
    measure_errors,
    turn_between,
    with_answer,
)
from weathercoat.bench.reference_cases import (
    FLAPS,
    fold,
    make_clamped_sheet,
    make_cones,
    make_cracked_disc,
    make_cracked_plate,
    make_cut_disc,
    make_flap,
    make_reference_cases,
    make_strip,
    make_uniform_sheet,
    roll,
)
from weathercoat.mesh.halfedge import check_half_edges, make_half_edges
from weathercoat.mesh.shapes import make_plate


def small_cases() -> list[ReferenceCase]:
    return [
        make_strip("regular", 100, 270.0, irregular=False),
        make_strip("irregular", 200, 720.0, irregular=True),
        make_flap(6),
        make_cracked_disc(5),
    ]


@pytest.mark.parametrize("case", small_cases(), ids=lambda case: case.name)
def test_an_exact_answer_meets_every_aim_and_keeps_off_the_metal(case: ReferenceCase) -> None:
    assert case.answer is not None and case.answer.kind == "exact"
    there = case.answer.positions
    assert np.abs(turn_between(bends_at(case, there), case.targets)).max() < 1e-12
    np.testing.assert_allclose(lengths_at(case, there), case.active.rest_length, rtol=1e-12)
    height = np.einsum("ij,ij->i", there - case.mesh.rest_positions, case.mesh.rest_normals)
    assert height.min() > -1e-12
    held = np.setdiff1d(np.arange(case.mesh.vertex_count), case.active.free)
    np.testing.assert_allclose(there[held], case.start[held], atol=1e-15)
    errors = measure_errors(case, there)
    assert max(errors.position, errors.angle, errors.length_max) < 1e-10


def test_a_rolled_strip_is_a_cylinder() -> None:
    flat = make_plate(2.0, 1.0, 64, 2).vertices
    rolled = roll(flat, turn=2.0 * np.pi, flat_part=0.5)
    radius = 1.5 / (2.0 * np.pi)
    curved = flat[:, 0] > -0.5
    axis = np.array([-0.5, 0.0, radius])
    away = (rolled - axis)[curved]
    np.testing.assert_allclose(np.hypot(away[:, 0], away[:, 2]), radius, rtol=1e-12)
    end = flat[:, 0] == 1.0
    np.testing.assert_allclose(rolled[end][:, 0], -0.5, atol=1e-12)  # a whole turn on from where it began
    np.testing.assert_array_equal(rolled[~curved], flat[~curved])


def test_folds_keep_all_lengths_of_a_grid() -> None:
    plate = make_plate(6.0, 2.0, 6, 2)
    folded = fold(plate.vertices, bend=0.7, cell=1.0)
    for face in plate.faces:
        for a, b in ((0, 1), (1, 2), (2, 0)):
            before = np.linalg.norm(plate.vertices[face[a]] - plate.vertices[face[b]])
            assert np.linalg.norm(folded[face[a]] - folded[face[b]]) == pytest.approx(before, rel=1e-12)


@pytest.mark.parametrize("rings", [1, 2, 7])
def test_a_cut_disc_is_open_along_its_crack(rings: int) -> None:
    disc = make_cut_disc(rings)
    mesh = make_half_edges(disc.vertices, disc.faces)
    assert check_half_edges(mesh) == ""
    assert len(disc.faces) == 6 * rings**2
    sides = 6 * rings
    assert disc.area() == pytest.approx(0.5 * sides * math.sin(2 * np.pi / sides), rel=1e-12)
    assert (mesh.twin < 0).sum() == 6 * rings + 2 * rings
    normals = np.cross(*(disc.vertices[disc.faces[:, k]] - disc.vertices[disc.faces[:, 0]] for k in (1, 2)))
    assert normals[:, 2].min() > 0.0


def test_cones_keep_distances_along_rays_and_circles() -> None:
    angle = np.linspace(0.3 * np.pi, np.pi, 2001)
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    for side in (1.0, -1.0):
        lips = make_cones(circle * [1.0, side, 1.0], steepness=0.8)
        np.testing.assert_allclose(np.linalg.norm(lips, axis=1), 1.0, rtol=1e-12)
        steps = np.linalg.norm(np.diff(lips, axis=0), axis=1)
        np.testing.assert_allclose(steps, np.diff(angle), rtol=1e-6)
        assert lips[:, 2].min() >= 0.0


def test_errors_are_relative_to_length_and_targets() -> None:
    case = make_flap(4)
    assert case.answer is not None
    flat = measure_errors(case, case.start)
    assert flat.angle == pytest.approx(1.0) and flat.length < 1e-12
    moved = case.answer.positions.copy()
    moved[case.active.free[3], 1] += 0.01 * case.length
    assert measure_errors(case, moved).position == pytest.approx(0.01)
    moved[case.active.free[3], 1] = np.nan
    assert math.isinf(measure_errors(case, moved).angle)


def test_targets_grow_by_shares() -> None:
    case = make_flap(4)
    case.aim(0.25)
    start = case.constraints.angle_start[case.active.hinge_edges]
    np.testing.assert_array_equal(start, 0.25 * case.targets)
    assert case.can_grow


def test_the_clamped_sheet_keeps_flat_lengths_and_has_no_metal() -> None:
    case = make_clamped_sheet(400)
    assert case.answer is None
    np.testing.assert_allclose(lengths_at(case, case.start), case.active.rest_length, rtol=1e-12)
    assert not case.mesh.rest_normals.any()
    assert (case.targets > 0.0).any(), "bends of both signs, as any irregular triangulation has"


def test_the_uniform_sheet_wants_one_curvature_everywhere() -> None:
    case = make_uniform_sheet(200)
    span = case.constraints.span[case.active.hinge_edges]
    np.testing.assert_allclose(case.targets / span, case.targets[0] / span[0], rtol=1e-12)
    found = with_answer(case, case.start)
    assert found.answer is not None and found.answer.kind == "minimum"
    assert measure_errors(found, case.start).position == 0.0


def test_frozen_film_is_cracked_loose_and_laid_flat() -> None:
    case = make_cracked_plate("plate", 600)
    assert case.faces > 300 and len(case.active.free) > 50 and not case.can_grow
    assert case.mesh.vertex_count > len(case.mesh.rest_positions)
    np.testing.assert_array_equal(
        case.start, case.mesh.rest_positions[case.mesh.origin[: case.mesh.vertex_count]]
    )
    assert (case.targets < 0.0).any()


def test_the_list_holds_every_flap_and_can_be_cut() -> None:
    assert {f"flap-{edges}" for edges in FLAPS} < set(make_reference_cases())
    assert list(make_reference_cases(["flap-8", "cylinder-90"])) == ["flap-8", "cylinder-90"]
