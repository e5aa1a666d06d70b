"""Driving and timing a run: all steps are taken, samples stand for their tenth, and nothing else changes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from weathercoat.bench.drive import TENTHS, Tenth, drive, sum_stages
from weathercoat.bench.situation import load_speed_config, make_speed_simulation, measure_load
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.sim.simulation import Simulation

SHEET = make_random_sheet(500)


def make_simulation(steps: int) -> Simulation:
    return make_speed_simulation(SHEET, load_speed_config(steps))


def test_a_run_that_is_timed_whole_is_the_run() -> None:
    driven, stepped = make_simulation(23), make_simulation(23)
    seen: list[int] = []
    tenths = drive(driven, 0, 5, seen.append)
    for _ in range(23):
        stepped.step()
    assert driven.step_count == 23 and seen[-1] == 23
    assert sum(tenth.timed for tenth in tenths) == 23 and len(tenths) == TENTHS
    count = driven.mesh.vertex_count
    assert np.array_equal(driven.mesh.positions[:count], stepped.mesh.positions[:count])
    assert sum(tenth.mesh_seconds > 0.0 for tenth in tenths) == 5


def test_a_sampled_run_reaches_the_same_age_and_load() -> None:
    """The load is laid out by age, so the steps that it is reached in change it by a few edges of 100."""
    sampled, whole = make_simulation(400), make_simulation(400)
    seen: list[int] = []
    tenths = drive(sampled, 3, 0, seen.append)
    in_whole = drive(whole, 0, 0)
    assert sampled.step_count == 400 and sampled.age == 1.0
    assert [tenth.timed for tenth in tenths] == [3] * TENTHS
    assert all(later > earlier for earlier, later in pairwise(seen))
    broken = [sum(tenth.broken_edges for tenth in run) for run in (tenths, in_whole)]
    assert broken[0] == pytest.approx(broken[1], abs=5)
    assert measure_load(sampled, 0).separated_share == pytest.approx(
        measure_load(whole, 0).separated_share, abs=0.02
    )


def test_samples_stand_for_their_tenth() -> None:
    stages = {"failure": 1.0, "deformation": 2.0, "stains": 0.5}
    tenths = [Tenth(5, stages, wall=4.0, cpu=3.0, mesh_seconds=0.25, broken_edges=0)] * TENTHS
    found = sum_stages(tenths, 1000)
    expected = {"failure": 200.0, "deformation": 400.0, "stains": 100.0, "other": 100.0, "cpu": 600.0}
    assert found == pytest.approx({**expected, "mesh": 2.5, "total": 802.5})
