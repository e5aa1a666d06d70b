"""Constraints and sweeps: what is active when, what is aimed at, and strips that curl to known shapes."""

from __future__ import annotations

import numpy as np
import pytest

from tests import zoo
from tests.zoo import find_edge, make_mesh
from weathercoat.deform.angle import DIHEDRAL
from weathercoat.deform.constraints import Constraints, follow_events, make_constraints, release
from weathercoat.deform.deformation import deform
from weathercoat.deform.parameters import DeformParameters
from weathercoat.deform.plain import (
    bends_wanted,
    deform_plainly,
    project_angles,
    project_lengths,
)
from weathercoat.deform.residual import measure_residual
from weathercoat.deform.runs import LANES, Runs
from weathercoat.mesh.dihedral import all_bends
from weathercoat.mesh.halfedge import HalfEdgeMesh, cut_edge, make_event_log, next_of, prev_of
from weathercoat.mesh.shapes import make_sphere
from weathercoat.mesh.surface import Surface, Vectors

CURL = {
    "curl_rule": "curvature",
    "curl_radius": 2.0,
    "curl_rate": 3.0,
    "curl_angle_rate": 0.8,
    "curl_angle_floor": 2.6,
    "deformation_sweeps": 10,
    "deformation_angle": "dihedral",
    "deformation_angle_stiffness": 1.0,
}


def parameters(**changes: object) -> DeformParameters:
    return DeformParameters(**{**CURL, **changes})  # type: ignore[arg-type]


def released(surface: Surface, vertices: list[int], age: float = 0.0) -> tuple[HalfEdgeMesh, Constraints]:
    mesh = make_mesh(surface)
    constraints = make_constraints(mesh)
    release(mesh, constraints, np.array(vertices, np.int32), age)
    return mesh, constraints


def packed(constraints: Constraints, runs: Runs) -> tuple[list[list[int]], list[int]]:
    """The vertices and the half-edge of each active constraint, in the order of slots."""
    vertex = constraints.seats.vertex
    lanes = [(lane, int(h)) for lane, h in zip(runs.lane, runs.half_edge, strict=True) if lane >= 0]
    vertices = [vertex[runs.seats[lane // LANES, :, lane % LANES]].tolist() for lane, _ in lanes]
    return vertices, [h for _, h in lanes]


def active_lengths(constraints: Constraints) -> list[tuple[int, ...]]:
    return sorted(tuple(sorted(pair)) for pair in packed(constraints, constraints.lengths)[0])


def active_hinges(mesh: HalfEdgeMesh, constraints: Constraints) -> set[tuple[int, int]]:
    return zoo.edge_ends(mesh, np.array(packed(constraints, constraints.angles)[1], np.int32))


def free_vertices(constraints: Constraints) -> list[int]:
    seats = constraints.seats
    moving = [v for v in np.flatnonzero(seats.seat >= 0) if seats.plane[seats.seat[v]].any()]
    return [int(v) for v in moving]


# --- what is active ---


def test_an_attached_film_has_no_constraint() -> None:
    mesh, constraints = released(zoo.make_disc(), [])
    assert (
        packed(constraints, constraints.lengths)[0]
        == packed(constraints, constraints.angles)[0]
        == free_vertices(constraints)
        == []
    )
    before = mesh.positions.copy()
    deform(mesh, constraints, parameters(), 1.0)
    assert np.array_equal(mesh.positions, before, equal_nan=True)


def test_a_released_vertex_holds_its_edges_and_bends_the_opposite_ones() -> None:
    """Paper 5.1: angles on the edges opposite to it, lengths on those incident to it."""
    surface = zoo.make_hexagon(2)
    mesh, constraints = released(surface, [0])
    ring = range(1, 7)
    assert active_lengths(constraints) == [(0, v) for v in ring]
    assert active_hinges(mesh, constraints) == {
        (min(a, b), max(a, b)) for a, b in zip(ring, [*ring[1:], 1], strict=True)
    }
    assert free_vertices(constraints) == [0]
    for p1, p2, p3, p4 in packed(constraints, constraints.angles)[0]:
        assert {int(p3), int(p4)} >= {0}, "an apex is the released vertex"
        assert p1 != p2 and p4 not in (p1, p2, p3)


def test_rims_have_lengths_but_no_angles() -> None:
    mesh, constraints = released(zoo.make_hinge(), [2])
    assert active_lengths(constraints) == [(0, 2), (1, 2)]
    assert active_hinges(mesh, constraints) == {(0, 1)}


def test_a_constraint_keeps_its_start() -> None:
    """The edge opposite to 2 and 3 starts when the first of them lets go, at the bend that it has then."""
    mesh, constraints = released(zoo.make_hinge(0.3), [2], age=0.25)
    edge = find_edge(mesh, 0, 1)
    mesh.positions[2] += (0, 0, 0.5)
    release(mesh, constraints, np.array([3], np.int32), 0.75)
    assert constraints.angle_start[edge] == pytest.approx(0.3)
    assert constraints.angle_age[edge] == 0.25


def test_a_new_constraint_starts_at_the_present_bend() -> None:
    mesh, constraints = released(zoo.make_lattice(2, 1), [])
    mesh.positions[0] += (0, 0, 0.4)
    bends = np.empty(len(mesh.twin))
    all_bends(mesh.positions, mesh.tail, mesh.twin, bends)
    release(mesh, constraints, np.array([0], np.int32), 0.5)
    edge = find_edge(mesh, 1, 3)
    assert constraints.angle_start[edge] == bends[edge] != 0.0


def test_a_broken_edge_loses_its_angle_and_has_two_lengths() -> None:
    """Paper 5.2: the length is doubled, one for each half-edge, and nothing refers across the crack."""
    surface = zoo.make_hexagon(2)
    mesh, constraints = released(surface, list(range(19)))
    lengths, angles = len(active_lengths(constraints)), len(packed(constraints, constraints.angles)[0])
    log = make_event_log(len(surface.faces))
    for k in (1, 4):
        cut_edge(mesh, log, zoo.find_half_edge(mesh, 0, k))
    follow_events(mesh, constraints, log)
    assert len(active_lengths(constraints)) == lengths + 2
    assert len(packed(constraints, constraints.angles)[0]) == angles - 2
    (new,) = log.split_entries()[:, 0]
    assert constraints.inverse_mass[new] == 1.0 and new in free_vertices(constraints)
    sides = {
        v: set(mesh.tail.reshape(-1, 3)[(mesh.tail.reshape(-1, 3) == v).any(axis=1)].flat) for v in (0, new)
    }
    for v, other in ((0, new), (new, 0)):
        for runs in (constraints.lengths, constraints.angles):
            rows = [vertices for vertices in packed(constraints, runs)[0] if v in vertices]
            assert rows and not any(other in vertices for vertices in rows)
            if runs is constraints.lengths:
                assert {end for ends in rows for end in ends} <= sides[v]


def test_fallen_faces_take_their_constraints_along() -> None:
    surface = zoo.make_two_pieces()
    mesh, constraints = released(surface, list(range(10)))
    log = make_event_log(7)
    mesh.alive[6] = False
    mesh.half_edge[7:10] = -1
    log.falls[0], log.counts[2] = 6, 1
    follow_events(mesh, constraints, log)
    assert max(max(pair) for pair in active_lengths(constraints)) < 7
    assert free_vertices(constraints) == list(range(7))


def test_every_live_edge_of_a_free_film_is_constrained_once() -> None:
    for name in zoo.ZOO:
        surface = zoo.ZOO[name]()
        mesh, constraints = released(surface, list(range(len(surface.vertices))))
        inner = int((mesh.twin >= 0).sum()) // 2
        assert len(active_lengths(constraints)) == inner + int((mesh.twin < 0).sum())
        assert len(set(active_lengths(constraints))) == len(active_lengths(constraints))
        assert len(packed(constraints, constraints.angles)[0]) == inner
        for hinge, h in zip(*packed(constraints, constraints.angles), strict=True):
            g = mesh.twin[h]
            assert h < g
            expected = [mesh.tail[h], mesh.tail[next_of(h)], mesh.tail[prev_of(h)], mesh.tail[prev_of(g)]]
            assert hinge == expected


# --- what is aimed at ---


def targets_of(constraints: Constraints, p: DeformParameters, age: float) -> Vectors:
    edges = np.array(packed(constraints, constraints.angles)[1], np.int32)
    return bends_wanted(constraints, edges, p, age)


def test_curvature_targets_are_those_of_the_closed_form() -> None:
    """start - (1 - exp(-rate t)) h / radius, with h the distance of the faces' centres."""
    _, constraints = released(zoo.make_hinge(0.2), [2, 3], age=0.25)
    centres = zoo.make_hinge(0.2).vertices[zoo.make_hinge().faces].mean(axis=1)
    span = np.linalg.norm(centres[0] - centres[1])
    for age in (0.25, 0.5, 3.0):
        expected = 0.2 - span / 2.0 * (1 - np.exp(-3.0 * (age - 0.25)))
        assert targets_of(constraints, parameters(), age) == pytest.approx([expected], abs=1e-14)


def test_literal_angles_shrink_by_an_angle_per_age_to_a_floor() -> None:
    """phi falls by 0.8 per age from pi + 0.2 down to 2.6, where it stays."""
    _, constraints = released(zoo.make_hinge(0.2), [2, 3], age=0.25)
    literal = parameters(curl_rule="angle")
    assert targets_of(constraints, literal, 0.75) == pytest.approx([0.2 - 0.8 * 0.5], abs=1e-14)
    assert targets_of(constraints, literal, 9.0) == pytest.approx([2.6 - np.pi], abs=1e-14)


@pytest.mark.parametrize("rule", ["curvature", "angle"])
def test_targets_never_rise_above_their_start(rule: str) -> None:
    """A hinge that starts below the floor, or folded beyond the largest bend, keeps its start."""
    _, constraints = released(zoo.make_hinge(-3.0), [2, 3])
    targets = targets_of(constraints, parameters(curl_rule=rule, curl_radius=0.01), 5.0)
    assert targets == pytest.approx([-3.0])


def test_tight_curls_stop_short_of_folding_through() -> None:
    _, constraints = released(zoo.make_hinge(), [2, 3])
    target = targets_of(constraints, parameters(curl_radius=1e-3, curl_rate=100.0), 5.0)
    assert -np.pi < target[0] < -2.5


# --- what comes out ---


def test_a_flap_curls_to_its_target_and_keeps_its_lengths() -> None:
    """One free apex of a flat hinge, three constraints: met to round-off, the attached corners untouched."""
    mesh, constraints = released(zoo.make_hinge(), [2])
    deform(mesh, constraints, parameters(deformation_sweeps=200, curl_rate=50.0), 1.0)
    bends = np.empty(len(mesh.twin))
    all_bends(mesh.positions, mesh.tail, mesh.twin, bends)
    expected = -2 * zoo.HALF_ROOT_3 / 3 / 2.0
    assert bends[find_edge(mesh, 0, 1)] == pytest.approx(expected, abs=1e-12)
    assert mesh.positions[2, 2] == pytest.approx(zoo.HALF_ROOT_3 * np.sin(-expected), abs=1e-12), (
        "away from the metal"
    )
    assert (mesh.positions[[0, 1, 3]] == mesh.rest_positions[[0, 1, 3]]).all()
    residual = measure_residual(mesh, constraints, parameters(curl_rate=50.0), 1.0)
    assert max(residual.strain_max, residual.angle_max) < 1e-12


def curl_clamped(mesh: HalfEdgeMesh, lengths: Vectors, bends: Vectors, free: list[int], sweeps: int) -> None:
    """Sweeps over all edges with the given lengths and bends by half-edge; only `free` vertices move."""
    inverse_mass = np.zeros(len(mesh.twin))
    inverse_mass[free] = 1.0
    edges = [h for h in range(len(mesh.twin)) if mesh.twin[h] < h]
    ends = np.array([(mesh.tail[h], mesh.tail[next_of(h)]) for h in edges], np.int32)
    keep = inverse_mass[ends].sum(axis=1) > 0
    inner = [h for h in edges if mesh.twin[h] >= 0]
    hinges = np.array(
        [
            (mesh.tail[h], mesh.tail[next_of(h)], mesh.tail[prev_of(h)], mesh.tail[prev_of(mesh.twin[h])])
            for h in inner
        ],
        np.int32,
    )
    movable = inverse_mass[hinges].sum(axis=1) > 0
    targets = np.tan(0.5 * bends[inner][movable])
    for _ in range(sweeps):
        project_lengths(mesh.positions, inverse_mass, ends[keep], lengths[edges][keep])
        project_angles(DIHEDRAL, mesh.positions, inverse_mass, hinges[movable], targets, 1.0)


def test_a_clamped_strip_curls_to_a_prism() -> None:
    """Four squares, the first clamped; each rung bends by -0.4, the diagonals stay flat.

    Isometric, so the solution is exact: rung i lies at the sum of unit steps at the angles 0, 0.4, 0.8, 1.2.
    Sweeps converge linearly; 3,000 of them on 12 free coordinates end in round-off.
    """
    mesh = make_mesh(zoo.make_ladder(5))
    bends = np.zeros(len(mesh.twin))
    for rung in (1, 2, 3):
        h = find_edge(mesh, 2 * rung, 2 * rung + 1)
        bends[[h, mesh.twin[h]]] = -0.4
    curl_clamped(mesh, make_constraints(mesh).rest_length, bends, list(range(4, 10)), 3000)
    turn = 0.4 * np.arange(4)
    along = np.concatenate([[0], np.cumsum(np.cos(turn))])
    above = np.concatenate([[0], np.cumsum(np.sin(turn))])
    expected = np.array([(along[i], y, above[i]) for i in range(5) for y in (0.0, 1.0)])
    np.testing.assert_allclose(mesh.positions[:10], expected, atol=1e-9)


@pytest.mark.compiled
def test_a_clamped_sheet_curls_to_a_cylinder() -> None:
    """Targets of an oblique lattice on a cylinder of radius 2: lengths and signed bends, some of them ridges.

    The first two columns are clamped on the cylinder; the others start on the flat sheet. The exact positions
    are those of the map (x, y) -> (R sin(x / R), y, R - R cos(x / R)).
    """
    surface = zoo.make_lattice(4, 2)
    radius = 2.0
    x, y, _ = surface.vertices.T
    bent = np.stack([radius * np.sin(x / radius), y, radius - radius * np.cos(x / radius)], axis=1)
    target = make_mesh(Surface(bent, surface.faces, surface.face_group))
    bends = np.empty(len(target.twin))
    all_bends(target.positions, target.tail, target.twin, bends)
    inner = bends[target.twin >= 0]
    assert (inner > 1e-3).any() and (inner < -1e-3).any(), "a cylinder on oblique triangles has both signs"
    mesh = make_mesh(surface)
    clamped = [v for v in range(len(x)) if v % 5 < 2]
    mesh.positions[clamped] = bent[clamped]
    free = [v for v in range(len(x)) if v % 5 >= 2]
    curl_clamped(mesh, make_constraints(target).rest_length, bends, free, 6000)
    np.testing.assert_allclose(mesh.positions[: len(x)], bent, atol=1e-8)


@pytest.mark.compiled
@pytest.mark.parametrize("form", ["dihedral", "split", "arccos"])
def test_attached_vertices_never_move_and_none_goes_below_the_metal(form: str) -> None:
    """A sphere with every third vertex attached: those bit for bit, others above their tangent planes."""
    surface = make_sphere(subdivisions=2)
    free = [v for v in range(len(surface.vertices)) if v % 3]
    mesh, constraints = released(surface, free)
    for age in (0.2, 0.4, 1.0):
        deform(mesh, constraints, parameters(deformation_angle=form, curl_radius=0.1), age)
    count = mesh.vertex_count
    held = np.setdiff1d(np.arange(count), free)
    assert (mesh.positions[held] == mesh.rest_positions[held]).all()
    height = np.einsum("ij,ij->i", mesh.positions[:count] - mesh.rest_positions, mesh.rest_normals)
    assert height.min() > -1e-15
    assert np.isfinite(mesh.positions[:count]).all()
    if form != "arccos":
        assert height.max() > 1e-3, "nothing has curled"


@pytest.mark.parametrize("form", ["dihedral", "split", "arccos"])
@pytest.mark.parametrize("rule", ["curvature", "angle"])
def test_a_step_is_lengths_then_angles_then_substrate(form: str, rule: str) -> None:
    """Bit for bit what the plain sweeps give in that order."""
    mesh, constraints = released(zoo.make_hexagon(2), [0, 1, 2, 8])
    p = parameters(deformation_sweeps=3, deformation_angle=form, curl_rule=rule)
    expected = mesh._replace(positions=mesh.positions.copy())
    deform_plainly(expected, constraints, p, 0.5)
    deform(mesh, constraints, p, 0.5)
    assert mesh.positions[:19].tobytes() == expected.positions[:19].tobytes()
    assert (mesh.positions[:19] == mesh.rest_positions).all() == (form == "arccos")


def test_residual_of_known_errors() -> None:
    """A flap stretched by a tenth along its height, and a target that it is 0.1 short of."""
    mesh, constraints = released(zoo.make_hinge(), [2])
    still = measure_residual(mesh, constraints, parameters(), 0.0)
    assert (still.strain_rms, still.angle_rms, still.angle_max) == (pytest.approx(0, abs=1e-15), 0.0, 0.0)
    mesh.positions[2, 1] *= 1.1
    side = np.hypot(0.5, 1.1 * zoo.HALF_ROOT_3)
    literal = parameters(curl_rule="angle", curl_angle_rate=0.1)
    residual = measure_residual(mesh, constraints, literal, 1.0)
    assert residual.strain_rms == residual.strain_max == pytest.approx(side - 1, rel=1e-12)
    assert residual.angle_rms == residual.angle_max == pytest.approx(0.1, rel=1e-12)
