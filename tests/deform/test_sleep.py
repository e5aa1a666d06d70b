"""Sleep: who falls asleep and wakes, and what it costs in accuracy."""

from __future__ import annotations

import numpy as np
import pytest

from tests.deform.test_runs import step_beside
from tests.sim.runs import assert_invariants, make_run
from weathercoat.deform.constraints import follow_events
from weathercoat.mesh.halfedge import cut_edge, make_event_log
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.sim.simulation import Simulation

pytestmark = pytest.mark.compiled

WHOLE = {"cohesion_base": 1e3, "defects_share": 0.0, "flaking_rule": "faces"}  # nothing breaks or falls
QUICK = {"curl_rate": 20.0, "curl_radius": 1.0, "deformation_sweeps": 10}


def make_resting(tolerance: float, **film: object) -> Simulation:
    """A run in which film lets go, bends and comes to rest."""
    return make_run(
        make_random_sheet(600, 1.0, 0.8, 2),
        steps=240,
        film={**WHOLE, "adhesion_decay_rate": 0.0, "tension_rate": 20.0, "lift_coefficient": 0.33, **film},
        curl={**QUICK, "deformation_sleep_tolerance": tolerance},
    )


def curl(tolerance: float, *, steps: int = 240) -> Simulation:
    """That run after a number of steps."""
    simulation = make_resting(tolerance)
    for _ in range(steps):
        simulation.step()
    return simulation


def positions(simulation: Simulation) -> np.ndarray:
    return simulation.mesh.positions[: simulation.mesh.vertex_count]


def test_film_at_rest_sleeps_and_keeps_its_shape() -> None:
    """The error is that of a few tens of steps of less than the tolerance: below a hundred tolerances."""
    exact = curl(0.0)
    moved = np.linalg.norm(positions(exact) - exact.mesh.rest_positions, axis=1)
    assert moved.max() > 0.01 and 0.2 < np.mean(moved > 0.0) < 0.95
    errors = []
    for tolerance in (1e-5, 1e-6):
        lazy = curl(tolerance)
        free = int((exact.constraints.inverse_mass > 0.0).sum())
        assert lazy.constraints.asleep.sum() > 0.3 * free
        errors.append(np.linalg.norm(positions(lazy) - positions(exact), axis=1).max())
        assert errors[-1] < 100 * tolerance
    assert errors[1] < errors[0]


def test_without_a_tolerance_nobody_sleeps() -> None:
    assert not curl(0.0, steps=60).constraints.asleep.any()


def test_a_break_wakes_the_ends_of_the_edge() -> None:
    simulation = curl(1e-4)
    mesh, constraints = simulation.mesh, simulation.constraints
    h = next(
        h
        for h in np.flatnonzero(mesh.twin >= 0)
        if constraints.asleep[mesh.tail[h]] and constraints.asleep[mesh.tail[mesh.twin[h]]]
    )
    ends = mesh.tail[h], mesh.tail[mesh.twin[h]]
    log = make_event_log(len(mesh.faces))
    cut_edge(mesh, log, h)
    follow_events(mesh, constraints, log)
    for v in ends:
        assert not constraints.asleep[v]
        assert constraints.inverse_mass[v] == 1.0
        assert constraints.seats.plane[constraints.seats.seat[v]].any()


def test_what_is_packed_follows_sleepers_and_those_that_breaks_and_releases_wake() -> None:
    """Every step beside the plain one; adhesion and cohesion go on falling slowly, so events come singly."""
    simulation = make_resting(
        1e-3, adhesion_decay_rate=0.1, cohesion_base=2.3, defects_share=0.02, cohesion_decay_rate=0.0
    )
    changes = []
    for _ in range(240):
        before = int(simulation.constraints.asleep.sum())
        step_beside(simulation)
        assert_invariants(simulation)
        changes.append(int(simulation.constraints.asleep.sum()) - before)
    assert max(changes) > 0 and min(changes) < 0
    assert simulation.mesh.vertex_count > len(simulation.mesh.rest_positions), "nothing has split"


def test_the_residual_counts_sleepers() -> None:
    """As many strains as without sleep, though their constraints are not packed."""
    lazy = curl(1e-4)
    awake = int(lazy.constraints.angles.filled.sum())
    assert awake < len(np.flatnonzero(~np.isnan(lazy.constraints.angle_start)))
    assert 0.0 < lazy.residual().strain_rms < 0.1
    assert 0.0 < lazy.residual().angle_rms < 1.0
