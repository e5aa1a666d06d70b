"""Newton, descent and the first guess: known minima, no step upwards, the substrate, and whole runs."""

from __future__ import annotations

import numpy as np
import pytest

from tests import zoo
from tests.deform.folds import STILL, clamped, polygon
from tests.deform.test_energy import cracked_film
from tests.sim.runs import assert_invariants, failed_shares, make_run, snapshot_bytes
from tests.zoo import make_mesh
from weathercoat.bench.reference import measure_errors
from weathercoat.bench.reference_cases import make_flap
from weathercoat.deform.constraints import make_constraints, release
from weathercoat.deform.deformation import deform
from weathercoat.deform.descending import Minimise, lift, resting
from weathercoat.deform.descent import minimise_by_descent
from weathercoat.deform.energy import Elastic, energy, gradient, make_elastic
from weathercoat.deform.newton import minimise_by_newton
from weathercoat.deform.parameters import DeformParameters
from weathercoat.deform.unrolling import unroll
from weathercoat.mesh.shapes import make_random_sheet, make_sphere
from weathercoat.mesh.surface import Vectors

MINIMISERS = {"newton": minimise_by_newton, "descent": minimise_by_descent}
SHEET = make_random_sheet(300, 1.0, 0.8, 1)
SOLVERS = pytest.mark.parametrize("solver", MINIMISERS)


def no_guess(positions: Vectors) -> object:
    return lambda islands: positions.copy()


def minimise(solver: str, elastic: Elastic, start: Vectors, iterations: int, tolerance: float) -> Vectors:
    run: Minimise = MINIMISERS[solver]
    positions = start.copy()
    run(elastic, positions, no_guess(start), iterations=iterations, tolerance=tolerance)  # type: ignore[arg-type]
    return positions


# --- the first guess ---


@pytest.mark.parametrize("turn", [-0.2, 0.5, -0.35])
def test_the_guess_is_exact_where_targets_can_be_met(turn: float) -> None:
    """Forty rungs: up to two and a half turns."""
    mesh, constraints = clamped(40, turn)
    elastic = make_elastic(mesh, constraints, STILL, 0.0)
    guessed = unroll(mesh, elastic, mesh.positions[: mesh.vertex_count], np.ones(1, np.bool_))
    assert np.abs(guessed - polygon(40, turn)).max() < 1e-6


def test_the_guess_leaves_other_islands_alone() -> None:
    simulation = make_run(make_random_sheet(250, 1.0, 0.8, 3), steps=20)
    simulation.step(12)
    elastic = make_elastic(
        simulation.mesh, simulation.constraints, simulation.deform_parameters, simulation.age
    )
    islands = np.zeros(len(elastic.scale), np.bool_)
    assert len(islands) > 1
    islands[0] = True
    positions = simulation.mesh.positions[: simulation.mesh.vertex_count]
    guessed = unroll(simulation.mesh, elastic, positions, islands)
    moved = np.flatnonzero((guessed != positions).any(axis=1))
    assert len(moved) > 0 and set(moved) <= set(elastic.free[elastic.island == 0])
    assert np.isfinite(guessed).all()


def test_film_without_hinges_has_nothing_to_guess() -> None:
    """A triangle that hangs by one corner, and one that nothing holds."""
    for freed in ([1, 2], [0, 1, 2]):
        mesh = make_mesh(zoo.make_triangle())
        constraints = make_constraints(mesh)
        release(mesh, constraints, np.array(freed, np.int32), 0.0)
        mesh.positions[:3, 2] += [0.0, 0.3, 0.1] if len(freed) == 2 else 0.0
        for solver in MINIMISERS:
            parameters = DeformParameters(deformation_solver=solver)
            deform(mesh, constraints, parameters, 0.5)
            lengths = np.linalg.norm(mesh.positions[[1, 2, 0]] - mesh.positions[:3], axis=1)
            assert np.abs(lengths - 1.0).max() < 1e-3


# --- known minima ---


@SOLVERS
def test_a_flat_strip_rolls_up(solver: str) -> None:
    """From flat to two turns in one step."""
    mesh, constraints = clamped(40, -0.3)
    parameters = DeformParameters(
        **{**vars(STILL), "deformation_solver": solver, "deformation_tolerance": 1e-9}
    )
    solved = deform(mesh, constraints, parameters, 0.0)
    assert np.abs(mesh.positions[: mesh.vertex_count] - polygon(40, -0.3)).max() < 1e-4
    assert solved.gap is not None and solved.gap <= 1e-9 and solved.unfinished == 0


@SOLVERS
@pytest.mark.parametrize("edges", [4, 24])
def test_a_wide_flap_rolls_up_in_a_few_iterations(solver: str, edges: int) -> None:
    """On a grid the first step from flat promises little, though the guess is exact; without it Newton needs
    some hundred iterations for 24 edges.
    """
    case = make_flap(edges)
    given = {"deformation.solver": solver, "deformation.iterations": 10, "deformation.tolerance": 1e-9}
    mesh = case.mesh_at(case.start)
    solved = deform(mesh, case.constraints, case.parameters_with(given), case.age)
    assert solved.unfinished == 0
    assert measure_errors(case, mesh.positions[: mesh.vertex_count]).position < 1e-6


@SOLVERS
def test_the_minimum_is_the_same_from_flat_and_from_curled(solver: str) -> None:
    """A twelfth of a turn, without a guess."""
    mesh, constraints = clamped(10, -0.05)
    elastic = make_elastic(mesh, constraints, STILL, 0.0)
    flat = mesh.positions[: mesh.vertex_count].copy()
    curled = polygon(10, -0.09)
    curled[:4] = flat[:4]
    ends = [minimise(solver, elastic, start, 300, 1e-16) for start in (flat, curled)]
    assert np.abs(ends[0] - ends[1]).max() < 1e-6
    first = np.linalg.norm(gradient(elastic, flat))
    assert np.linalg.norm(gradient(elastic, ends[0])) < 1e-5 * first


@pytest.mark.compiled
@SOLVERS
def test_no_step_raises_the_energy(solver: str) -> None:
    """Of any island, however few the iterations; and more iterations never end higher."""
    elastic, start = cracked_film(4)
    lift(elastic, start)
    before = energy(elastic, start)
    for iterations in (1, 2, 3, 5, 10, 30):
        after = energy(elastic, minimise(solver, elastic, start, iterations, 1e-14))
        assert (after <= before).all()
        before = after


@pytest.mark.compiled
def test_newton_converges_quadratically_where_targets_cannot_be_met() -> None:
    """Cracked film that wants to curl both ways: the gradient falls to round-off."""
    elastic, start = cracked_film(4)
    lift(elastic, start)
    end = minimise("newton", elastic, start, 200, 1e-18)
    force = gradient(elastic, end)
    held = resting(elastic, end, force)
    assert np.abs(force[~held]).max() < 1e-7 * np.abs(gradient(elastic, start)).max()
    assert energy(elastic, end).sum() > 0.01 * elastic.scale.sum(), "there is no exact fit"


@SOLVERS
def test_film_stays_above_the_substrate(solver: str) -> None:
    elastic, start = cracked_film(6)
    end = minimise(solver, elastic, start, 60, 1e-10)
    depth = np.einsum("ij,ij->i", elastic.normals, end[elastic.free]) - elastic.offsets
    assert depth.min() > -1e-12
    force = gradient(elastic, end)
    held = resting(elastic, end, force)
    assert held.any(), "some of it is pressed against the metal"


@SOLVERS
def test_a_spent_budget_is_told(solver: str) -> None:
    mesh, constraints = clamped(12, -0.3)
    elastic = make_elastic(mesh, constraints, STILL, 0.0)
    start = mesh.positions[: mesh.vertex_count].copy()
    solved = MINIMISERS[solver](elastic, start, no_guess(start), iterations=2, tolerance=1e-12)  # type: ignore[arg-type]
    assert solved.iterations == 2 and solved.unfinished == 1 and solved.gap > 1e-12


@SOLVERS
def test_faces_of_no_extent_do_no_harm(solver: str) -> None:
    """Two vertices of the film in one place, and a sliver."""
    mesh, constraints = clamped(10, -0.2)
    mesh.positions[9] = mesh.positions[8]
    mesh.positions[13] = mesh.positions[12] + [1e-9, 0, 0]
    elastic = make_elastic(mesh, constraints, STILL, 0.0)
    start = mesh.positions[: mesh.vertex_count]
    end = minimise(solver, elastic, start, 100, 1e-6)
    assert np.isfinite(end).all()
    assert (energy(elastic, end) <= energy(elastic, start)).all()


# --- whole runs ---


@pytest.mark.compiled
@SOLVERS
@pytest.mark.parametrize("surface", [SHEET, make_sphere(320)], ids=["sheet", "ball"])
def test_invariants_hold_in_a_run(solver: str, surface: object) -> None:
    simulation = make_run(surface, steps=30, curl={"deformation_solver": solver})  # type: ignore[arg-type]
    for _ in range(30):
        simulation.step()
        assert_invariants(simulation)
    assert failed_shares(simulation)["lost"] > 0.05
    assert simulation.solving.iterations > 30
    assert simulation.solving.largest_gap is not None
    assert simulation.residual().energy < 1.0
    assert simulation.residual().strain_max < 0.1


@pytest.mark.compiled
def test_a_converged_run_is_nearer_to_balance() -> None:
    ends = {}
    for solver in ("sweeps", "newton"):
        simulation = make_run(SHEET, steps=30, curl={"deformation_solver": solver})
        simulation.step(15)
        for _ in range(5):
            simulation.step()
        ends[solver] = simulation.residual()
    assert ends["newton"].imbalance < 0.1 * ends["sweeps"].imbalance
    assert ends["newton"].energy < ends["sweeps"].energy


@pytest.mark.compiled
@SOLVERS
def test_the_same_bytes_again(solver: str) -> None:
    """Whatever has run before in the process."""
    found = set()
    for _ in range(2):
        simulation = make_run(SHEET, steps=12, curl={"deformation_solver": solver})
        for _ in range(12):
            simulation.step()
        found.add(snapshot_bytes(simulation.snapshot()))
    assert len(found) == 1


def test_no_solver_leaves_the_film_flat() -> None:
    simulation = make_run(SHEET, steps=12, curl={"deformation_solver": "none"})
    for _ in range(12):
        simulation.step()
    mesh = simulation.mesh
    used = slice(0, mesh.vertex_count)
    assert (mesh.positions[used] == mesh.rest_positions[mesh.origin[used]]).all()
    assert failed_shares(simulation)["separated"] > 0.2
