"""Runs: what is met at once shares no vertex, and packing follows every event."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.sim.runs import make_run
from tests.zoo import make_lattice
from weathercoat.deform.constraints import Constraints, make_constraints, release
from weathercoat.deform.deformation import deform
from weathercoat.deform.descending import Solved
from weathercoat.deform.parameters import DeformParameters
from weathercoat.deform.plain import deform_plainly, find_active
from weathercoat.deform.runs import LANES, TILE, Runs, bucket
from weathercoat.mesh.halfedge import HalfEdgeMesh, make_half_edges
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.mesh.surface import Indices
from weathercoat.sim.simulation import Simulation


def corners_of(mesh: HalfEdgeMesh, runs: Runs) -> Indices:
    """The rest vertices of each slot, (s, k)."""
    h = runs.half_edge
    tail, head, apex = (np.roll(mesh.faces, -k, axis=1).reshape(-1) for k in range(3))
    if runs.seats.shape[1] == 2:
        return np.stack([tail[h], head[h]], axis=1)
    return np.stack([tail[h], head[h], apex[h], apex[mesh.twin[h]]], axis=1)


def members(runs: Runs, run: int) -> Indices:
    """The slots of a run."""
    return np.flatnonzero(runs.run == run)


@pytest.fixture(scope="module")
def sheet() -> HalfEdgeMesh:
    """Of several tiles, in the order of a curve."""
    from weathercoat.mesh.order import order_surface

    surface = make_random_sheet(12_000, 1.0, 1.0, 5)
    ordered, _ = order_surface(surface, surface.vertices)
    return make_half_edges(ordered.vertices, ordered.faces)


@settings(deadline=None)
@given(st.lists(st.integers(0, 6), max_size=40))
def test_bucket_is_a_stable_order(keys: list[int]) -> None:
    order, first = bucket(np.array(keys, np.int32), 7)
    assert order.tolist() == np.argsort(np.array(keys, np.int32), kind="stable").tolist()
    assert np.diff(first).tolist() == np.bincount(np.array(keys, np.int64), minlength=7).tolist()


def test_members_of_a_run_share_no_vertex(sheet: HalfEdgeMesh) -> None:
    constraints = make_constraints(sheet)
    for runs in (constraints.lengths, constraints.angles):
        corners = corners_of(sheet, runs)
        for run in range(len(runs.filled)):
            used = corners[members(runs, run)]
            assert len(np.unique(used)) == used.size


def test_every_constraint_has_one_slot(sheet: HalfEdgeMesh) -> None:
    constraints = make_constraints(sheet)
    lengths, angles = constraints.lengths, constraints.angles
    assert sorted(lengths.half_edge.tolist()) == list(range(len(sheet.tail)))
    assert (lengths.half_edge[lengths.slot] == np.arange(len(sheet.tail))).all()
    inner = np.flatnonzero(sheet.twin >= 0)
    smaller = np.minimum(inner, sheet.twin[inner])
    assert (angles.half_edge[angles.slot[inner]] == smaller).all()
    assert (angles.slot[sheet.twin < 0] == -1).all()


def test_tiles_inside_share_no_vertex_and_hold_most(sheet: HalfEdgeMesh) -> None:
    constraints = make_constraints(sheet)
    for runs in (constraints.lengths, constraints.angles):
        corners = corners_of(sheet, runs)
        assert runs.inside == -(-len(sheet.rest_positions) // TILE) > 3
        last_inside = runs.tile_run[runs.inside]
        for tile in range(runs.inside):
            for run in range(runs.tile_run[tile], runs.tile_run[tile + 1]):
                assert (corners[members(runs, run)] // TILE == tile).all()
        assert np.mean(runs.run < last_inside) > 0.8


def test_a_vertex_of_many_faces_uses_up_the_colours() -> None:
    """A cone of 200 faces: each of its rims and spokes takes the apex, so each hinge is a run of its own."""
    around = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    rim = np.stack([np.cos(around), np.sin(around), np.zeros(200)], axis=1)
    vertices = np.concatenate([[(0.0, 0.0, 0.5)], rim])
    faces = np.array([(0, 1 + k, 1 + (k + 1) % 200) for k in range(200)], np.int32)
    mesh = make_half_edges(vertices, faces)
    runs = make_constraints(mesh).angles
    corners = corners_of(mesh, runs)
    for run in range(len(runs.filled)):
        used = corners[members(runs, run)]
        assert len(np.unique(used)) == used.size
    assert len(runs.half_edge) == 200


def check_packing(mesh: HalfEdgeMesh, constraints: Constraints) -> None:
    """What is packed is what is active by definition, without gaps, with the present data."""
    active = find_active(mesh, constraints)
    mass = constraints.inverse_mass
    for runs, vertices in ((constraints.lengths, active.ends), (constraints.angles, active.hinges)):
        slots = np.flatnonzero(runs.lane >= 0)
        lanes = runs.lane[slots]
        assert (runs.slot_at[lanes] == slots).all()
        assert np.bincount(runs.run[slots], minlength=len(runs.filled)).tolist() == runs.filled.tolist()
        assert (lanes - LANES * runs.first_block[runs.run[slots]] < runs.filled[runs.run[slots]]).all()
        seats = runs.seats[lanes // LANES, :, lanes % LANES]
        assert constraints.seats.vertex[seats].tolist() == vertices.tolist()
        assert (runs.moves[lanes // LANES, :, lanes % LANES] == mass[vertices]).all()
    lengths, angles = constraints.lengths, constraints.angles
    lanes = lengths.lane[lengths.lane >= 0]
    assert (lengths.target[lanes // LANES, lanes % LANES] == active.rest_length).all()
    lanes = angles.lane[angles.lane >= 0]
    h = active.hinge_edges
    data = np.stack([constraints.angle_start[h], constraints.angle_age[h], constraints.span[h]], axis=1)
    assert (angles.data[lanes // LANES, :, lanes % LANES] == data).all()
    seats = constraints.seats
    taken = np.flatnonzero(seats.seat >= 0)
    assert (seats.vertex[seats.seat[taken]] == taken).all()
    tile = mesh.origin[taken] // TILE
    assert np.bincount(tile, minlength=len(seats.filled)).tolist() == seats.filled.tolist()
    assert (seats.seat[taken] - seats.first[tile] < seats.filled[tile]).all()
    moving = taken[seats.plane[seats.seat[taken]].any(axis=1)]
    assert moving.tolist() == active.free.tolist()
    assert (seats.plane[seats.seat[moving], :3] == mesh.rest_normals[mesh.origin[moving]]).all()


def step_beside(simulation: Simulation) -> None:
    """One step, with the packing checked, and its deformation done over again plainly."""
    import weathercoat.sim.simulation as module

    def both(
        mesh: HalfEdgeMesh, constraints: Constraints, parameters: DeformParameters, age: float, **how: Any
    ) -> Solved:
        check_packing(mesh, constraints)
        beside = mesh._replace(positions=mesh.positions.copy())
        deform_plainly(beside, constraints, parameters, age)
        solved = deform(mesh, constraints, parameters, age, **how)
        used = mesh.vertex_count
        assert beside.positions[:used].tobytes() == mesh.positions[:used].tobytes()
        return solved

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "deform", both)
        simulation.step()


@pytest.mark.compiled
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), form=st.sampled_from(["dihedral", "split", "arccos"]))
def test_packed_sweeps_are_the_plain_ones_bit_for_bit(seed: int, form: str) -> None:
    """After every step of random runs in which most of the film fails."""
    sheet = make_random_sheet(300, 1.0, 0.8, seed)
    simulation = make_run(sheet, steps=25, seed=seed, curl={"deformation_angle": form})
    for _ in range(25):
        step_beside(simulation)
    assert simulation.mesh.vertex_count > len(simulation.mesh.rest_positions), "nothing has split"


@pytest.mark.compiled
def test_a_film_of_many_tiles_is_swept_as_plainly() -> None:
    """More tiles than stay in a cache, whose positions are read ahead."""
    from weathercoat.mesh.order import order_surface

    surface = make_lattice(300, 150)
    ordered, _ = order_surface(surface, surface.vertices)
    mesh = make_half_edges(ordered.vertices, ordered.faces)
    constraints = make_constraints(mesh)
    assert len(constraints.seats.filled) > 32
    free = np.flatnonzero(np.arange(len(ordered.vertices)) % 7 > 1).astype(np.int32)
    release(mesh, constraints, free, 0.0)
    parameters = DeformParameters(curl_radius=3.0, deformation_sweeps=2)
    beside = mesh._replace(positions=mesh.positions.copy())
    deform_plainly(beside, constraints, parameters, 0.5)
    deform(mesh, constraints, parameters, 0.5)
    used = mesh.vertex_count
    assert mesh.positions[:used].tobytes() == beside.positions[:used].tobytes()
    assert not np.array_equal(mesh.positions[:used], mesh.rest_positions)
