"""The fast failure against the plain one, bit for bit, in every step of whole runs under all rules."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.film.plain import plain_step
from tests.sim.runs import LITERAL_CURL, LITERAL_FILM, make_run
from tests.sim.test_invariants import SHAPES, choices, curls
from weathercoat.config.load import load_config
from weathercoat.config.presets import preset_names, preset_path
from weathercoat.film.agenda import make_agenda
from weathercoat.film.state import make_film_rules
from weathercoat.mesh.shapes import make_random_sheet, make_sphere
from weathercoat.run import prepare_simulation
from weathercoat.sim.simulation import Simulation

pytestmark = pytest.mark.compiled


def assert_same(fast: Simulation, plain: Simulation) -> None:
    """Mesh, film, log and flakes agree to the bit; that a separated vertex is disturbed matters to nobody."""
    used = plain.mesh.vertex_count
    assert fast.mesh.vertex_count == used
    for name in ("positions", "half_edge", "origin"):
        assert np.array_equal(getattr(fast.mesh, name)[:used], getattr(plain.mesh, name)[:used]), name
    for name in ("tail", "twin", "alive"):
        assert np.array_equal(getattr(fast.mesh, name), getattr(plain.mesh, name)), name
    attached = ~plain.film.separated
    for name in plain.film._fields:
        a, b = getattr(fast.film, name), getattr(plain.film, name)
        assert np.array_equal(a[attached], b[attached]) if name == "disturbed" else np.array_equal(a, b), name
    for name in ("split_entries", "break_entries", "fall_entries"):
        assert np.array_equal(getattr(fast.log, name)(), getattr(plain.log, name)()), name
    assert fast.flake_areas == plain.flake_areas


def run_both(fast: Simulation, plain: Simulation, remake: int = 0) -> None:
    """Step both to the end; the fast one's agenda is made anew every `remake` steps."""
    while plain.step_count < plain.steps:
        if remake and fast.step_count % remake == remake - 1:
            fast.agenda = make_agenda(fast.mesh, fast.film, make_film_rules(fast.film_parameters))
        fast.step()
        plain_step(plain)
        assert_same(fast, plain)


def twice(**arguments: object) -> tuple[Simulation, Simulation]:
    """Two equal simulations, of `make_run`."""
    return make_run(**arguments), make_run(**arguments)  # type: ignore[arg-type]


@settings(max_examples=40, deadline=None)
@given(
    shape=st.sampled_from(sorted(SHAPES)),
    seed=st.integers(0, 500),
    film=choices,
    curl=curls,
    remake=st.sampled_from([0, 1, 5]),
)
def test_random_runs(shape: str, seed: int, film: dict, curl: dict, remake: int) -> None:
    run_both(*twice(surface=SHAPES[shape](seed), steps=25, seed=seed, film=film, curl=curl), remake=remake)


@pytest.mark.long
@settings(max_examples=500, deadline=None)
@given(
    shape=st.sampled_from(sorted(SHAPES)),
    seed=st.integers(0, 10**6),
    film=choices,
    curl=curls,
    steps=st.sampled_from([40, 300, 2500]),
    remake=st.sampled_from([0, 7]),
)
def test_many_random_runs(shape: str, seed: int, film: dict, curl: dict, steps: int, remake: int) -> None:
    """Up to more steps than the calendar's horizon."""
    run_both(*twice(surface=SHAPES[shape](seed), steps=steps, seed=seed, film=film, curl=curl), remake=remake)


RULES = {
    "default": ({}, {}),
    "literal": (LITERAL_FILM, LITERAL_CURL),
    "linear tension": ({"tension_law": "linear"}, {}),
    "lift by the face's tension": ({"lift_tension": "face", "lift_coefficient": 0.6}, {}),
    "relaxed faces": ({"fracture_relaxation": "faces"}, {}),
    "faces relaxed to nothing, defects without cohesion": (
        {"fracture_relaxation": "faces", "fracture_face_factor": 0.0, "defects_strength": 0.0},
        {},
    ),
    "one round": ({"fracture_rounds": "one"}, {}),
    "few rounds": ({"fracture_speed": 1.0}, {}),
    "single faces fall": ({"flaking_rule": "faces"}, {}),
    "nothing tears": ({"flaking_hanging_share": 0.0}, {}),
    "much tears": ({"flaking_hanging_share": 0.6}, {}),
    "a tension that falls": ({"tension_initial": 1.5, "tension_rate": 1.0}, {}),
}


@pytest.mark.parametrize("remake", [0, 13])
@pytest.mark.parametrize("shape", ["sheet", "sphere"])
@pytest.mark.parametrize("name", RULES)
def test_every_rule(name: str, shape: str, remake: int) -> None:
    """On an open and a closed surface, with the agenda kept and made anew; and the film does fail."""
    film, curl = RULES[name]
    surface = make_random_sheet(faces=300) if shape == "sheet" else make_sphere(subdivisions=2)
    fast, plain = twice(surface=surface, steps=120, film=film, curl=curl)
    run_both(fast, plain, remake)
    assert np.isfinite(plain.rust.lifted_age).mean() > 0.2
    assert np.isfinite(plain.film.fray_age).mean() > 0.02


@pytest.mark.parametrize("name", preset_names())
def test_shipped_configs(name: str) -> None:
    """On a sheet of the mesh's own triangles, over 150 steps."""
    surface = make_random_sheet(faces=500)
    config = load_config(str(preset_path(name)), ["ageing.steps=150"]).config
    run_both(prepare_simulation(surface, config), prepare_simulation(surface, config))


@pytest.mark.parametrize("change", ["steps", "duration"])
def test_steps_that_come_otherwise_than_foreseen(change: str) -> None:
    """Whoever changes the pace of a simulation on its way gets the same results as without an agenda."""
    fast, plain = twice(surface=make_random_sheet(faces=300), steps=400)
    for _ in range(60):
        fast.step()
        plain_step(plain)
    for simulation in (fast, plain):
        if change == "steps":
            simulation.steps, simulation.step_count = 40, 6
        else:
            simulation.duration = 3.0
    for _ in range(20):
        fast.step()
        plain_step(plain)
        assert_same(fast, plain)
    assert plain.film.separated.any()
