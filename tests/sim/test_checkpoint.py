"""The state as arrays and back: whoever goes on from it ends with the same bits, at every step."""

from __future__ import annotations

import io

import numpy as np
import pytest

from tests.sim.runs import CURL, LITERAL_CURL, LITERAL_FILM, assert_invariants, make_run, snapshot_bytes
from weathercoat.mesh.shapes import make_random_sheet, make_sphere
from weathercoat.mesh.surface import Surface
from weathercoat.sim.checkpoint import Arrays, restore_state, state_arrays
from weathercoat.sim.simulation import Simulation

STEPS = 40
SHEET = make_random_sheet(faces=160)
KINDS: dict[str, dict[str, dict[str, object]]] = {
    "sweeps": {},
    "literal": {"film": dict(LITERAL_FILM), "curl": dict(LITERAL_CURL)},
    "sleep": {"curl": {"deformation_sleep_tolerance": 2e-3}},
    "faces": {"film": {"lift_tension": "face"}},
    "momentum": {"curl": {"deformation_solver": "momentum"}},
    "descent": {"curl": {"deformation_solver": "descent"}},
    "newton": {"curl": {"deformation_solver": "newton"}},
    "none": {"curl": {"deformation_solver": "none"}},
}


def saved(simulation: Simulation) -> Arrays:
    """The state as it comes back from a file."""
    stream = io.BytesIO()
    np.savez(stream, **state_arrays(simulation))
    stream.seek(0)
    with np.load(stream) as archive:
        return dict(archive)


def assert_same_state(one: Simulation, other: Simulation) -> None:
    """All that is kept, and what is drawn from it."""
    ones, others = state_arrays(one), state_arrays(other)
    assert ones.keys() == others.keys()
    for name, array in ones.items():
        assert array.tobytes() == others[name].tobytes(), name
    assert snapshot_bytes(one.snapshot()) == snapshot_bytes(other.snapshot())
    assert one.residual() == other.residual()
    assert one.solving == other.solving


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_ends_the_same_wherever_it_was_interrupted(kind: str) -> None:
    """From every step: the state survives a file, and the rest of the run gives the same bits."""
    whole = make_run(SHEET, steps=STEPS, **KINDS[kind])
    states = [saved(whole)]
    for _ in range(STEPS):
        whole.step()
        states.append(saved(whole))
    assert sum(whole.flake_areas) > 0.0 and whole.mesh.vertex_count > len(SHEET.vertices)
    for start, state in enumerate(states):
        resumed = make_run(SHEET, steps=STEPS, **KINDS[kind])
        restore_state(resumed, state)
        assert resumed.step_count == start
        while resumed.step_count < STEPS:
            resumed.step()
        assert_same_state(resumed, whole)


def test_a_restored_state_is_valid_and_whole() -> None:
    """Nothing of the state is left out: every array of the simulation is as it was, derived ones too."""
    whole = make_run(make_sphere(300), steps=STEPS)
    for _ in range(25):
        whole.step()
    resumed = make_run(make_sphere(300), steps=STEPS)
    restore_state(resumed, saved(whole))
    assert_invariants(resumed)
    used = whole.mesh.vertex_count
    for owner in ("mesh", "film", "rust", "rest"):
        one, other = getattr(whole, owner), getattr(resumed, owner)
        for name, array in one._asdict().items():
            if not isinstance(array, np.ndarray):
                assert array == getattr(other, name)
                continue
            count = used if name in ("positions", "half_edge", "origin") else len(array)
            np.testing.assert_array_equal(array[:count], getattr(other, name)[:count], err_msg=name)
    seats, again = whole.constraints.seats, resumed.constraints.seats
    taken = seats.seat[:used][seats.seat[:used] >= 0]
    np.testing.assert_array_equal(seats.plane[taken], again.plane[taken])
    for name in ("lengths", "angles"):
        runs, others = getattr(whole.constraints, name), getattr(resumed.constraints, name)
        lanes = runs.lane[runs.lane >= 0]
        assert len(lanes) > 100
        for field in ("seats", "moves", "data"):
            ones, twos = getattr(runs, field), getattr(others, field)
            for row in range(ones.shape[1]):
                np.testing.assert_array_equal(ones[:, row].ravel()[lanes], twos[:, row].ravel()[lanes])


@pytest.mark.parametrize("wrong", ["missing", "shape", "type", "count"])
def test_arrays_of_another_run_are_refused(wrong: str) -> None:
    state = saved(make_run(SHEET, steps=STEPS))
    if wrong == "missing":
        del state["rust.film"]
    elif wrong == "shape":
        state["film.tension"] = state["film.tension"][:-1]
    elif wrong == "type":
        state["film.tension"] = state["film.tension"].astype(np.float32)
    else:
        state["mesh.used"] = np.array([10**9])
    with pytest.raises((KeyError, ValueError)):
        restore_state(make_run(SHEET, steps=STEPS), state)


def test_momentum_is_part_of_the_state() -> None:
    moving = make_run(SHEET, steps=STEPS, curl={**CURL, "deformation_solver": "momentum"})
    assert {"momentum.velocity", "momentum.run"} <= state_arrays(moving).keys()
    assert "momentum.velocity" not in state_arrays(make_run(SHEET, steps=STEPS))


def test_the_age_of_a_step_is_that_of_a_longer_run() -> None:
    """Exactly, also where the duration is no binary fraction."""

    def ages(surface: Surface, steps: int, duration: float) -> list[float]:
        simulation = make_run(surface, steps=steps)
        simulation.duration = duration
        return [simulation.age_after(step) for step in range(20)]

    assert ages(SHEET, 20, 0.7) == ages(SHEET, 60, 2.1) == ages(SHEET, 100, 3.5)
    assert ages(SHEET, 20, 0.7)[10] == 0.35
