"""Later rounds of a step look at tips only; that must find all that a full scan finds."""

from __future__ import annotations

import numpy as np
import pytest

from tests.film import plain
from weathercoat.film.state import FilmParameters
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.sim.simulation import Simulation, make_simulation

pytestmark = pytest.mark.compiled


def aged(seed: int) -> Simulation:
    film = FilmParameters(
        fracture_speed=200.0, fracture_shear_lag=0.1, adhesion_decay_rate=1.0, defects_density=400.0
    )
    simulation = make_simulation(make_random_sheet(500, 1.0, 1.0, seed), film=film, steps=60, seed=seed)
    for _ in range(60):
        plain.plain_step(simulation)
    return simulation


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_tips_are_all_that_a_round_can_make_critical(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    at_tips = aged(seed)

    def scan_all(mesh, state, rules, age, log, first_break, candidates, overload):  # type: ignore[no-untyped-def]
        return plain.find_overloaded(mesh, state, rules, age, candidates, overload)

    monkeypatch.setattr(plain, "find_overloaded_at_tips", scan_all)
    full = aged(seed)
    assert full.mesh.vertex_count > len(full.mesh.rest_positions) + 20, "cracks must have run"
    np.testing.assert_array_equal(at_tips.mesh.twin, full.mesh.twin)
    used = full.mesh.vertex_count
    np.testing.assert_array_equal(at_tips.mesh.positions[:used], full.mesh.positions[:used])
