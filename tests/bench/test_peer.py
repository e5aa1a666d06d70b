"""The peer is timed where it is installed, and leaves our simulation as it was."""

from __future__ import annotations

import pytest

from weathercoat.bench.drive import drive
from weathercoat.bench.measure import measure_sweep
from weathercoat.bench.situation import load_speed_config, make_speed_simulation
from weathercoat.mesh.shapes import make_random_sheet


def test_the_peer_is_timed_on_the_same_constraints() -> None:
    pytest.importorskip("pypbd")
    simulation = make_speed_simulation(make_random_sheet(500), load_speed_config(20))
    drive(simulation, 0, 0)
    before = simulation.mesh.positions.copy()
    found = measure_sweep(simulation, with_peer=True)
    assert found["peer"]["ms"] > 0.0
    assert found["peer"]["times_ours"] == pytest.approx(found["peer"]["ms"] / found["sweep"]["ms"])
    count = simulation.mesh.vertex_count
    assert (simulation.mesh.positions[:count] == before[:count]).all()
