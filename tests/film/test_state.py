"""The film at the start, and what ages by a closed form."""

from __future__ import annotations

import numpy as np
import pytest

from tests import zoo
from tests.film.films import STEADY, make_film
from weathercoat.film.start import FilmLayout, lift_at_rest, make_film_state
from weathercoat.film.state import (
    FilmParameters,
    FilmState,
    adhesion_at,
    drying_tension,
    tension_at,
)
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.shapes import make_random_sheet

SHEET = zoo.make_mesh(make_random_sheet(faces=500))


def make_state(mesh: HalfEdgeMesh = SHEET, seed: int = 1, **changes: object) -> FilmState:
    return make_film_state(mesh, FilmParameters(**{**STEADY, **changes}), seed)  # type: ignore[arg-type]


def test_the_film_begins_attached_and_whole() -> None:
    state = make_state(tension_initial=0.25)
    assert not state.separated.any() and not state.is_tip.any()
    assert np.isinf(state.separation_age).all() and np.isinf(state.fray_age).all()
    assert (state.tension == 0.25).all() and (state.tension_cap == 1.0).all()
    assert (state.adhesion == 1.0).all() and (state.cohesion == 1000.0).all()


def test_the_film_takes_the_layout_that_it_is_given() -> None:
    adhesion, cohesion = np.linspace(1.0, 2.0, SHEET.vertex_count), np.full(len(SHEET.twin), 7.0)
    state = make_film_state(SHEET, FilmParameters(**STEADY), 1, FilmLayout(adhesion, cohesion))  # type: ignore[arg-type]
    assert (state.adhesion == adhesion).all() and (state.cohesion == cohesion).all()
    without = make_state()
    assert (state.tie == without.tie).all() and (state.rest_lift == without.rest_lift).all()


def test_a_flat_film_at_rest_lifts_by_half_on_each_of_six_sides() -> None:
    factor, lift = lift_at_rest(SHEET, FilmParameters(lift_sum="per_valence"))
    assert (factor == 0.5).all()
    np.testing.assert_allclose(lift, 3.0, rtol=1e-15)


def test_adhesion_follows_noise_about_its_base() -> None:
    state = make_state(adhesion_base=2.0, adhesion_amplitude=0.5)
    other = make_state(adhesion_base=2.0, adhesion_amplitude=1.0)
    assert state.adhesion.std() > 0.05
    np.testing.assert_allclose(other.adhesion - 2.0, 2.0 * (state.adhesion - 2.0), atol=1e-14)
    assert (
        make_state(adhesion_amplitude=0.5, seed=2).adhesion != make_state(adhesion_amplitude=0.5).adhesion
    ).all()


def test_cohesion_scatters_evenly_and_pairs_agree() -> None:
    """500 faces have 700 edges or so; the mean of as many uniform numbers within 4.5 sigma of the base."""
    state = make_state(cohesion_base=2.0, cohesion_scatter=0.2)
    paired = SHEET.twin >= 0
    assert (state.cohesion[paired] == state.cohesion[SHEET.twin[paired]]).all()
    assert (state.tie[paired] == state.tie[SHEET.twin[paired]]).all()
    edges = state.cohesion[(SHEET.twin < 0) | (SHEET.twin > np.arange(len(SHEET.twin)))]
    assert edges.min() >= 1.6 and edges.max() <= 2.4
    assert abs(edges.mean() - 2.0) < 4.5 * 0.4 / np.sqrt(12 * len(edges))
    assert len(np.unique(edges)) == len(edges)


def count_defects(state: FilmState, mesh: HalfEdgeMesh = SHEET) -> int:
    edges = (mesh.twin < 0) | (mesh.twin > np.arange(len(mesh.twin)))
    return int((state.cohesion[edges] < 500.0).sum())


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 1.0])
def test_defects_by_share_are_that_many_edges(share: float) -> None:
    """Binomial over the edges: within 4.5 sigma; a defect's cohesion is its strength times what it was."""
    state = make_state(defects_share=share, defects_strength=0.001)
    edges = int(((SHEET.twin < 0) | (SHEET.twin > np.arange(len(SHEET.twin)))).sum())
    found = count_defects(state)
    assert abs(found - share * edges) <= 4.5 * np.sqrt(share * (1 - share) * edges)
    assert set(np.unique(state.cohesion)) <= {1000.0, 1000.0 * 0.001}


@pytest.mark.compiled
def test_defects_by_area_do_not_hang_on_the_mesh() -> None:
    """A unit sheet with 60 defects per unit area has 60, of 500 faces as of 4,000, at 4.5 sigma."""
    for faces in (500, 4000):
        mesh = zoo.make_mesh(make_random_sheet(faces=faces))
        found = [
            count_defects(make_state(mesh, seed, defects_rule="per_area", defects_density=60.0), mesh)
            for seed in range(10)
        ]
        assert abs(sum(found) - 600) < 4.5 * np.sqrt(600)


def test_seeds_and_streams_are_independent() -> None:
    """Another seed moves everything; more scatter does not move the defects."""
    plain, scattered = make_state(defects_share=0.2), make_state(defects_share=0.2, cohesion_scatter=0.3)
    other = make_state(defects_share=0.2, seed=2)
    defects = plain.cohesion < 500.0
    assert (defects == (scattered.cohesion < 500.0)).all()
    assert (defects != (other.cohesion < 500.0)).any()
    assert (plain.tie != other.tie).all()


def test_lift_factor_is_the_sigmoid_of_the_dihedral() -> None:
    """1 / (1 + exp(-a (phi - pi))): a half where flat or at a rim, above on a ridge."""
    mesh = zoo.make_mesh(zoo.make_roof(0.8))
    state = make_state(mesh, lift_convexity=2.0)
    ridge = zoo.find_half_edge(mesh, 1, 4)
    assert state.lift_factor[ridge] == pytest.approx(1 / (1 + np.exp(-1.6)), rel=1e-14)
    assert (state.lift_factor[mesh.twin < 0] == 0.5).all()


def test_saturating_tension_is_exact_in_any_number_of_steps() -> None:
    """T = cap + (T0 - cap) exp(-rate t), and restarting half-way changes only roundings."""
    whole = tension_at(0.2, 0.0, 0.7, 3.0, True, 1.0)
    assert whole == pytest.approx(0.7 - 0.5 * np.exp(-3.0), rel=1e-15)
    half = tension_at(0.2, 0.0, 0.7, 3.0, True, 0.4)
    assert tension_at(half, 0.4, 0.7, 3.0, True, 1.0) == pytest.approx(whole, rel=1e-14)


def test_linear_tension_grows_without_cap() -> None:
    assert tension_at(0.5, 0.2, 0.1, 3.0, False, 1.2) == pytest.approx(3.5, rel=1e-15)


@pytest.mark.parametrize("law", ["saturating", "linear"])
def test_an_intact_face_has_the_drying_tension(law: str) -> None:
    film = make_film(zoo.make_disc(), tension_law=law, tension_initial=0.1, tension_rate=2.0)
    assert (film.tension(0.0) == 0.1).all()
    for age in (0.1, 0.3, 5.0):
        assert (film.tension(age) == drying_tension(film.rules, age)).all()
    expected = 1.0 - 0.9 * np.exp(-10.0) if law == "saturating" else 10.1
    assert drying_tension(film.rules, 5.0) == pytest.approx(expected, rel=1e-14)


def test_adhesion_falls_by_a_rate_of_its_base_to_zero() -> None:
    film = make_film(zoo.make_disc(), adhesion_base=2.0, adhesion_decay_rate=0.5)
    loss = film.state.adhesion_loss
    assert (loss == 1.0).all()
    start = np.array([0.5, 2.0, 3.0])
    np.testing.assert_allclose(adhesion_at(start, loss[:3], 1.0), [0.0, 1.0, 2.0], atol=1e-15)
    assert (adhesion_at(start, loss[:3], 0.0) == start).all()
