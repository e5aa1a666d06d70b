"""What holds after every step of any run: random meshes, parameters and seeds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import zoo
from tests.sim.runs import CURL, FILM, LITERAL_CURL, LITERAL_FILM, assert_invariants, failed_shares, make_run
from weathercoat.mesh.halfedge import make_twins
from weathercoat.mesh.shapes import make_bracket, make_curved_plate, make_random_sheet, make_sphere
from weathercoat.mesh.surface import Surface, make_surface
from weathercoat.sim.simulation import Simulation

SHAPES = {
    "sheet": lambda seed: make_random_sheet(faces=120 + seed % 60, seed=seed),
    "sphere": lambda seed: make_sphere(subdivisions=1 + seed % 2),
    "curved plate": lambda seed: make_curved_plate(columns=8, rows=6, angle=40.0 + seed % 200),
    "octahedron": lambda seed: zoo.make_octahedron(),
    "annulus": lambda seed: zoo.make_annulus(12),
    "two pieces": lambda seed: zoo.make_two_pieces(),
    "roof": lambda seed: zoo.make_roof(np.sin(seed) * 2.5, rows=6),
    "rough sheet": lambda seed: roughened(make_random_sheet(faces=150, seed=seed), seed),
}


def roughened(surface: Surface, seed: int) -> Surface:
    """The sheet with every vertex off by up to a third of an edge, any way: sharp folds and slivers."""
    reach = 0.3 * np.sqrt(surface.area() / len(surface.faces))
    error = np.random.default_rng(seed).uniform(-reach, reach, surface.vertices.shape)
    return make_surface(surface.vertices + error, surface.faces)


choices = st.fixed_dictionaries(
    {
        "tension_law": st.sampled_from(["saturating", "linear"]),
        "tension_rate": st.floats(0.5, 10.0),
        "adhesion_amplitude": st.floats(0.0, 1.0),
        "adhesion_decay_rate": st.floats(0.0, 1.5),
        "cohesion_base": st.floats(0.3, 3.0),
        "cohesion_scatter": st.floats(0.0, 0.5),
        "cohesion_decay_rate": st.floats(0.0, 3.0),
        "defects_share": st.floats(0.0, 0.2),
        "lift_coefficient": st.floats(0.1, 1.0),
        "lift_sum": st.sampled_from(["per_valence", "plain"]),
        "lift_tension": st.sampled_from(["drying", "face"]),
        "fracture_direction_threshold": st.floats(0.05, 0.95),
        "fracture_direction_factor": st.floats(0.05, 0.95),
        "fracture_relaxation": st.sampled_from(["shear_lag", "faces"]),
        "fracture_shear_lag": st.floats(0.01, 0.3),
        "fracture_face_factor": st.floats(0.0, 1.0),
        "fracture_rounds": st.sampled_from(["by_speed", "one"]),
        "fracture_speed": st.floats(0.5, 100.0),
        "flaking_rule": st.sampled_from(["islands", "faces"]),
        "flaking_hanging_share": st.floats(0.0, 0.5),
    }
)
curls = st.fixed_dictionaries(
    {
        "curl_rule": st.sampled_from(["curvature", "angle"]),
        "curl_radius": st.floats(0.02, 2.0),
        "curl_rate": st.floats(0.5, 20.0),
        "curl_angle_rate": st.floats(0.0, 5.0),
        "curl_angle_floor": st.floats(0.5, 3.1),
        "deformation_sweeps": st.integers(0, 8),
        "deformation_angle": st.sampled_from(["dihedral", "split", "arccos"]),
    }
)


def run_checked(simulation: Simulation) -> None:
    """Step to the end, with all checks after each step."""
    assert_invariants(simulation)
    while simulation.step_count < simulation.steps:
        simulation.step()
        assert_invariants(simulation)


@settings(max_examples=40, deadline=None)
@given(shape=st.sampled_from(sorted(SHAPES)), seed=st.integers(0, 500), film=choices, curl=curls)
def test_random_runs(shape: str, seed: int, film: dict, curl: dict) -> None:
    run_checked(make_run(SHAPES[shape](seed), steps=12, seed=seed, film=film, curl=curl))


@pytest.mark.long
@settings(max_examples=400, deadline=None)
@given(shape=st.sampled_from(sorted(SHAPES)), seed=st.integers(0, 10**6), film=choices, curl=curls)
def test_many_random_runs(shape: str, seed: int, film: dict, curl: dict) -> None:
    run_checked(make_run(SHAPES[shape](seed), steps=40, seed=seed, film=film, curl=curl))


RULES = {
    "default": ({}, {}),
    "literal": (LITERAL_FILM, LITERAL_CURL),
    "linear tension": ({"tension_law": "linear"}, {}),
    "plain sum": ({"lift_sum": "plain"}, {}),
    # what cracks have relaxed lifts less, so the film needs more lift to fail as much
    "lift by the face's tension": ({"lift_tension": "face", "lift_coefficient": 0.6}, {}),
    "relaxed faces": ({"fracture_relaxation": "faces"}, {}),
    "one round": ({"fracture_rounds": "one"}, {}),
    "single faces fall": ({"flaking_rule": "faces"}, {}),
    "shrinking angles": ({}, {"curl_rule": "angle"}),
    "split angles": ({}, {"deformation_angle": "split"}),
    "arccos angles": ({}, {"deformation_angle": "arccos"}),
}


@pytest.mark.parametrize("name", RULES)
@pytest.mark.parametrize("shape", ["sheet", "bracket"])
def test_every_rule_by_itself(name: str, shape: str) -> None:
    """Each literal rule, on an open sheet and a closed part with creases: sound, and the film does fail."""
    film, curl = RULES[name]
    surface = (
        make_random_sheet(faces=250)
        if shape == "sheet"
        else make_bracket(bend=0.2, thickness=0.12, hole=0.05, edge_length=0.14)
    )
    simulation = make_run(surface, steps=30, film=film, curl=curl)
    run_checked(simulation)
    shares = failed_shares(simulation)
    assert shares["separated"] > 0.2 and shares["cracked"] > 0.05
    if name != "arccos angles":  # which has no gradient at flat
        moved = simulation.mesh.positions[: simulation.mesh.vertex_count]
        rest = simulation.mesh.rest_positions[simulation.mesh.origin[: simulation.mesh.vertex_count]]
        assert np.linalg.norm(moved - rest, axis=1).max() > 1e-3


def test_the_film_ends_whole_where_it_is_strong() -> None:
    """Nothing separates under an adhesion that no lift reaches: nothing changes but what ages."""
    simulation = make_run(make_random_sheet(faces=120), film={"adhesion_base": 100.0}, steps=20)
    run_checked(simulation)
    assert failed_shares(simulation) == {"separated": 0.0, "lost": 0.0, "cracked": 0.0}
    assert (simulation.mesh.twin == make_twins(simulation.mesh.faces)).all()


def test_everything_falls_where_nothing_holds() -> None:
    simulation = make_run(make_sphere(subdivisions=1), film={"adhesion_base": 0.01}, steps=5)
    run_checked(simulation)
    assert not simulation.mesh.alive.any()
    assert sum(simulation.flake_areas) == pytest.approx(1.0, abs=1e-12)
    assert len(simulation.snapshot().film_faces) == 0
    assert simulation.snapshot().bare.all()


def test_defaults_of_the_tests_name_every_parameter() -> None:
    """So that tuning a default cannot change what these tests run."""
    from weathercoat.deform.parameters import DeformParameters
    from weathercoat.film.state import FilmParameters

    assert set(FilmParameters.__dataclass_fields__) - set(FILM) == {"defects_density"}
    assert set(DeformParameters.__dataclass_fields__) == set(CURL)
