"""Whole runs on some eighty faces: small enough for kernels without the JIT, where every index is checked."""

from __future__ import annotations

from itertools import pairwise

import pytest

from tests.checked import COMPILED
from tests.deform.test_runs import step_beside
from tests.film.test_plain import RULES, run_both, twice
from tests.sim.runs import LITERAL_CURL, LITERAL_FILM, assert_invariants, failed_shares, finish, make_run
from weathercoat.deform import deformation, momentum, runs, seats, sweeps
from weathercoat.deform.team import Team
from weathercoat.mesh.shapes import make_random_sheet, make_sphere
from weathercoat.sim.simulation import Simulation

SHEET = make_random_sheet(80)
BALL = make_sphere(subdivisions=1)


@pytest.mark.parametrize("name", RULES)
def test_failure_is_the_plain_one(name: str) -> None:
    """Under all rules, with the agenda made anew on the way."""
    film, curl = RULES[name]
    fast, plain = twice(surface=SHEET, steps=30, film=film, curl=curl)
    run_both(fast, plain, remake=13)
    assert failed_shares(plain)["separated"] > 0.2


@pytest.mark.parametrize("solver", ["sweeps", "momentum", "descent", "newton", "none"])
def test_invariants_hold_with_every_solver(solver: str) -> None:
    """On an open and a closed surface."""
    for surface in (SHEET, BALL):
        simulation = make_run(surface, steps=16, curl={"deformation_solver": solver})
        while simulation.step_count < simulation.steps:
            simulation.step()
            assert_invariants(simulation)
        assert failed_shares(simulation)["lost"] > 0.05
        assert simulation.residual().strain_max < 0.3


@pytest.mark.parametrize("form", ["split", "arccos"])
def test_other_forms_are_swept_as_plainly(form: str) -> None:
    simulation = make_run(SHEET, steps=10, curl={"deformation_angle": form})
    for _ in range(simulation.steps):
        step_beside(simulation)
    assert simulation.mesh.vertex_count > len(simulation.mesh.rest_positions), "nothing has split"


def test_film_that_sleeps_and_wakes_is_swept_as_plainly() -> None:
    """It curls slowly in pieces that hang by much, so that islands fall asleep between the breaks."""
    simulation = make_run(
        SHEET,
        steps=72,
        film={"flaking_rule": "faces", "cohesion_base": 3.0, "tension_rate": 12.0},
        curl={"deformation_sleep_tolerance": 3e-3, "curl_radius": 1.0},
    )
    asleep = []
    for _ in range(simulation.steps):
        step_beside(simulation)
        asleep.append(int(simulation.constraints.asleep.sum()))
    changes = [after - before for before, after in pairwise(asleep)]
    assert max(changes) > 0 and min(changes) < 0
    assert simulation.mesh.vertex_count > len(simulation.mesh.rest_positions), "nothing has split"


@pytest.mark.skipif(COMPILED, reason="compiled code has its constants built in")
@pytest.mark.parametrize("solver", ["sweeps", "momentum"])
def test_many_small_tiles_are_swept_as_plainly(solver: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of nine vertices, of which two tiles fit the cache; alone and shared by two threads."""
    for module in (runs, seats, momentum):
        monkeypatch.setattr(module, "TILE", 9)
    monkeypatch.setattr("tests.deform.test_runs.TILE", 9)
    monkeypatch.setattr(sweeps, "_CACHED_TILES", 2)
    monkeypatch.setattr(deformation, "_WORTH_SHARING", 0)

    def run(threads: int) -> Simulation:
        simulation = make_run(SHEET, steps=12, curl={"deformation_solver": solver})
        simulation.team = Team(threads)
        assert len(simulation.constraints.seats.filled) > 2
        return simulation

    alone, shared = run(1), run(2)
    if solver == "sweeps":
        for _ in range(alone.steps):
            step_beside(alone)
    finish(alone)
    finish(shared)
    used = alone.mesh.vertex_count
    assert alone.mesh.positions[:used].tobytes() == shared.mesh.positions[:used].tobytes()
    assert used > len(alone.mesh.rest_positions), "nothing has split"


@pytest.mark.parametrize("share", [0.0, 0.6])
def test_flakes_take_all_area_with_them_that_is_lost(share: float) -> None:
    """With film that hangs by less than a share of its girth torn off, and by the paper's rules."""
    for film, curl in (({"flaking_hanging_share": share}, {}), (LITERAL_FILM, LITERAL_CURL)):
        simulation = make_run(BALL if share else SHEET, steps=16, film=film, curl=curl)
        finish(simulation)
        assert_invariants(simulation)
        assert simulation.flake_areas
