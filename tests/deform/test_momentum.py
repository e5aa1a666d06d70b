"""Momentum: long curls in few sweeps, nothing lost where targets contradict each other, no bit by chance."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import weathercoat.deform.deformation as deformation
import weathercoat.sim.simulation as simulation_module
from tests.sim.runs import finish, make_run
from weathercoat.deform.angle import FORMS
from weathercoat.deform.constraints import Constraints, make_constraints, refresh_round, release
from weathercoat.deform.deformation import deform
from weathercoat.deform.descending import Solved
from weathercoat.deform.momentum import Momentum, extrapolate, gather, make_momentum
from weathercoat.deform.parameters import DeformParameters
from weathercoat.deform.plain import Active, bends_wanted, find_active, half_tangents, sweep_plainly
from weathercoat.deform.residual import Residual, measure_residual
from weathercoat.deform.runs import TILE
from weathercoat.deform.team import Team
from weathercoat.mesh.dihedral import all_bends
from weathercoat.mesh.halfedge import HalfEdgeMesh, make_half_edges
from weathercoat.mesh.order import order_surface
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.mesh.surface import Indices, Vectors

# --- the same, plainly ---


class Sheet(NamedTuple):
    """Film whose targets are given, and the RMS of these over its hinges."""

    mesh: HalfEdgeMesh
    constraints: Constraints
    target_rms: float


def islands_of(active: Active, inverse_mass: Vectors) -> dict[int, int]:
    """For each vertex that moves the least one that constraints connect it with."""
    island = {v: v for v in active.free.tolist()}

    def root(v: int) -> int:
        while island[v] != v:
            v = island[v]
        return v

    for corners in [*active.ends.tolist(), *active.hinges.tolist()]:
        roots = [root(v) for v in corners if inverse_mass[v] > 0.0]
        for v in roots:
            island[v] = min(roots)
    return {v: root(v) for v in island}


def shortest_edges(mesh: HalfEdgeMesh, constraints: Constraints) -> Vectors:
    """The shortest rest length of an edge at each origin."""
    shortest = np.full(len(mesh.rest_positions), np.inf)
    for ends in (mesh.faces, np.roll(mesh.faces, -1, axis=1)):
        np.minimum.at(shortest, ends.reshape(-1), constraints.rest_length)
    return shortest


class PlainMomentum:
    """The velocity and the run of each film vertex, in dictionaries."""

    def __init__(self) -> None:
        self.velocity: dict[int, Vectors] = {}
        self.run: dict[int, int] = {}
        self.restarts = 0

    def deform(
        self, mesh: HalfEdgeMesh, constraints: Constraints, parameters: DeformParameters, age: float
    ) -> None:
        """One step's sweeps; changes positions."""
        active, mass = find_active(mesh, constraints), constraints.inverse_mass
        target = bends_wanted(constraints, active.hinge_edges, parameters, age)
        if parameters.deformation_angle == "dihedral":
            half_tangents(target)
        island = islands_of(active, mass)
        movers = sorted(island, key=lambda v: (mesh.origin[v] // TILE, v))
        velocity = {v: self.velocity.get(v, np.zeros(3)) for v in movers}
        run = dict.fromkeys(island.values(), 0)
        for v in movers:
            run[island[v]] = max(run[island[v]], self.run.get(v, 0))
        shortest = shortest_edges(mesh, constraints)
        reach = {v: 0.25 * shortest[mesh.origin[v]] for v in movers}
        for _ in range(parameters.deformation_sweeps):
            start, push = {}, {}
            for v in movers:
                x, y, z = (run[island[v]] / (run[island[v]] + 3.0) * velocity[v]).tolist()
                squared = x * x + y * y + z * z
                within = reach[v] / math.sqrt(squared) if squared > reach[v] * reach[v] else 1.0
                push[v] = within * np.array([x, y, z])
                start[v] = mesh.positions[v].copy()
                mesh.positions[v] += push[v]
            form = FORMS[parameters.deformation_angle]
            sweep_plainly(mesh, mass, active, form, target, parameters.deformation_angle_stiffness)
            total = dict.fromkeys(run, 0.0)
            for v in movers:
                velocity[v] = mesh.positions[v] - start[v]
                onwards = 0.0
                for own, all_of_it in zip(
                    (velocity[v] - push[v]).tolist(), velocity[v].tolist(), strict=True
                ):
                    onwards += own * all_of_it
                total[island[v]] += onwards
            self.restarts += sum(total[root] < 0.0 for root in run)
            run = {root: run[root] + 1 if total[root] >= 0.0 else 0 for root in run}
        self.velocity = velocity
        self.run = {v: run[island[v]] for v in movers}


@pytest.mark.compiled
@settings(max_examples=8, deadline=None)
@given(
    seed=st.integers(0, 10_000), form=st.sampled_from(["dihedral", "split", "arccos"]), share=st.booleans()
)
def test_it_is_the_plain_momentum_bit_for_bit(seed: int, form: str, share: bool) -> None:
    """After every step of random runs in which most of the film fails, alone and shared by two threads."""
    curl: dict[str, object] = {"deformation_solver": "momentum", "deformation_angle": form}
    simulation = make_run(make_random_sheet(200, 1.0, 0.8, seed), steps=25, seed=seed, curl=curl)
    simulation.team = Team(2 if share else 1)
    plain = PlainMomentum()

    def both(
        mesh: HalfEdgeMesh, constraints: Constraints, parameters: DeformParameters, age: float, **how: Any
    ) -> Solved:
        beside = mesh._replace(positions=mesh.positions.copy())
        plain.deform(beside, constraints, parameters, age)
        solved = deform(mesh, constraints, parameters, age, **how)
        used = mesh.vertex_count
        assert beside.positions[:used].tobytes() == mesh.positions[:used].tobytes()
        assert {v: int(how["momentum"].run[v]) for v in plain.run} == plain.run
        return solved

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulation_module, "deform", both)
        patch.setattr(deformation, "_WORTH_SHARING", 0)
        finish(simulation)
    assert simulation.mesh.vertex_count > len(simulation.mesh.rest_positions), "nothing has split"
    assert plain.restarts > 0 or form == "arccos", "nothing was turned back"


@pytest.mark.compiled
def test_threads_change_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sheet of three tiles, with the threshold below which one thread works alone taken away."""
    monkeypatch.setattr(deformation, "_WORTH_SHARING", 0)
    sheet = make_random_sheet(6000, 1.0, 0.8, 3)
    results = []
    for threads in (1, 2, 3):
        simulation = make_run(sheet, steps=12, curl={"deformation_solver": "momentum"})
        simulation.team = Team(threads)
        finish(simulation)
        results.append(simulation.mesh.positions[: simulation.mesh.vertex_count].tobytes())
    assert results[0] == results[1] == results[2]


# --- how fast, and where to ---


def make_sheet(faces: int, width: float, height: float, clamped: float, bend_to: float | None) -> Sheet:
    """A flat sheet of edges of about 1, clamped within a distance of its left rim, free beyond.

    bend_to: the angle of the cylinder that it is to become, from whose exact positions the targets are taken,
    and on which the clamped part lies already. None: the same curvature, 1 / 6, in all directions, which no
    flat sheet can take on; it is clamped about its middle.
    """
    surface = make_random_sheet(faces, width, height, 1)
    ordered, _ = order_surface(surface, surface.vertices)
    rest = ordered.vertices
    mesh = make_half_edges(rest, ordered.faces)
    constraints = make_constraints(mesh)
    if bend_to is None:
        is_held = np.hypot(rest[:, 0], rest[:, 1] - 0.5 * height) < clamped
        wanted = -constraints.span / 6.0
    else:
        x = rest[:, 0] - rest[:, 0].min()
        is_held = x < clamped
        radius = width / bend_to
        rolled = [radius * np.sin(x / radius), rest[:, 1], radius - radius * np.cos(x / radius)]
        mesh.positions[: len(rest)] = np.stack(rolled, axis=1)
        wanted = np.empty(len(mesh.twin))
        all_bends(mesh.positions, mesh.tail, mesh.twin, wanted)
        mesh.positions[np.flatnonzero(~is_held)] = rest[~is_held]
    free = np.flatnonzero(~is_held).astype(np.int32)
    release(mesh, constraints, free, 0.0)
    return aimed_at(mesh, constraints, free, wanted)


def aimed_at(mesh: HalfEdgeMesh, constraints: Constraints, free: Indices, wanted: Vectors) -> Sheet:
    """The sheet with a target, (3 m,), for each hinge."""
    has_target = ~np.isnan(constraints.angle_start)
    constraints.angle_start[has_target] = wanted[has_target]
    refresh_round(mesh, constraints, free)
    return Sheet(mesh, constraints, float(np.sqrt(np.mean(wanted[has_target] ** 2))))


def make_flap(edges: int) -> Sheet:
    """A strip of so many edges, clamped along the first, that is to become half a cylinder."""
    return make_sheet(2 * round(4 * edges * 2 / math.sqrt(3)), float(edges), 4.0, 1.2, math.pi)


def parameters(solver: str, sweeps: int) -> DeformParameters:
    """Of targets that stay as they are."""
    return DeformParameters(curl_rate=0.0, deformation_solver=solver, deformation_sweeps=sweeps)


def residual_after(sheet: Sheet, solver: str, sweeps: int, momentum: Momentum | None = None) -> Residual:
    """The residual after so many sweeps in one step."""
    deform(sheet.mesh, sheet.constraints, parameters(solver, sweeps), 0.0, momentum=momentum)
    return measure_residual(sheet.mesh, sheet.constraints, parameters(solver, sweeps), 0.0)


@pytest.mark.compiled
@pytest.mark.parametrize(("edges", "sweeps"), [(4, 45), (6, 65), (8, 130), (12, 450), (24, 1800)])
def test_flaps_come_within_a_tenth(edges: int, sweeps: int) -> None:
    """A quarter more sweeps than are needed for the RMS error of the angles to be a tenth of their RMS; plain
    ones, the same number, are far from it.
    """
    flap, plain = make_flap(edges), make_flap(edges)
    assert residual_after(flap, "momentum", sweeps).angle_rms < 0.1 * flap.target_rms
    assert residual_after(plain, "sweeps", sweeps).angle_rms > 0.2 * flap.target_rms


@pytest.mark.compiled
def test_the_exact_answer_is_reached() -> None:
    """All targets are met where that is possible: those of the lengths of the rolled strip, too."""
    flap = make_flap(8)
    start = flap.mesh.positions.copy()
    assert residual_after(flap, "momentum", 500).angle_rms < 0.01 * flap.target_rms
    again = Sheet(flap.mesh._replace(positions=start), flap.constraints, flap.target_rms)
    assert residual_after(again, "sweeps", 500).angle_rms > 0.2 * flap.target_rms


@pytest.mark.compiled
def test_momentum_lives_on_from_step_to_step() -> None:
    """Hundred steps of five sweeps are not far from one of five hundred, and begun anew in each they are."""
    kept, lost, at_once = make_flap(12), make_flap(12), make_flap(12)
    momentum = make_momentum(kept.mesh, kept.constraints)
    for _ in range(100):
        carried = residual_after(kept, "momentum", 5, momentum)
        anew = residual_after(lost, "momentum", 5)
    assert carried == residual_after(at_once, "momentum", 500)
    assert anew.angle_rms > 5 * carried.angle_rms


@pytest.mark.compiled
def test_contradicting_targets_end_where_plain_sweeps_end() -> None:
    """A curvature of the same size in all directions. Both come to rest with the same errors, to 3 %, with
    momentum in a tenth of the sweeps.
    """
    with_momentum = residual_after(make_sheet(600, 16.0, 16.0, 2.0, None), "momentum", 600)
    plain = residual_after(make_sheet(600, 16.0, 16.0, 2.0, None), "sweeps", 6000)
    assert with_momentum.angle_rms < 1.03 * plain.angle_rms
    assert with_momentum.strain_rms < 1.03 * plain.strain_rms


def test_a_push_is_at_most_a_quarter_of_the_shortest_edge() -> None:
    """Of a film that flies off, of which the sweeps then make what they make of one at rest."""
    flap = make_flap(4)
    mesh, constraints = flap.mesh, flap.constraints
    momentum = make_momentum(mesh, constraints)
    momentum.velocity[:] = (600.0, 0.0, 800.0)
    momentum.run[:] = 1000
    movers = gather(mesh, constraints, momentum)
    extrapolate(movers, constraints.seats, 0, len(constraints.seats.filled))
    origin = mesh.origin[movers.vertex]
    expected = 0.25 * shortest_edges(mesh, constraints)[origin, None] * (0.6, 0.0, 0.8)
    np.testing.assert_allclose(movers.velocity, expected, rtol=1e-12, atol=1e-15)
    after = residual_after(flap, "momentum", 60, momentum)
    assert after.angle_rms < 0.1 * flap.target_rms


def test_film_that_is_held_does_not_move_and_has_no_momentum() -> None:
    flap = make_flap(4)
    momentum = make_momentum(flap.mesh, flap.constraints)
    momentum.velocity[:] = (0.0, 0.0, 0.1)
    momentum.run[:] = 10
    held = np.flatnonzero(flap.constraints.inverse_mass[: flap.mesh.vertex_count] == 0.0)
    before = flap.mesh.positions[held].copy()
    residual_after(flap, "momentum", 3, momentum)
    assert (flap.mesh.positions[held] == before).all()
    assert not momentum.velocity[held].any() and not momentum.run[held].any()
