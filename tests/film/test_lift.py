"""Lift: the sigmoid of eq. 1, Stoney's proportionality of eq. 2, and the sums over a vertex."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests import zoo
from tests.film.films import Film, make_film, sum_lift
from weathercoat.film.agenda import FRINGE, SLACK
from weathercoat.film.fringe import bound_lift, find_in_fringe
from weathercoat.film.lift import sigmoid_bound
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.mesh.surface import Surface, Vectors


def lift_of(film: Film, tension: float | Vectors = 1.0, per_valence: bool = False) -> Vectors:
    """The lift of each vertex, where the faces have these tensions for ever and lift by them."""
    film.state.tension[:] = film.state.tension_cap[:] = tension
    film.parameters = replace(
        film.parameters, lift_tension="face", lift_sum="per_valence" if per_valence else "plain"
    )
    return sum_lift(film)


def attached_film(surface: Surface, **changes: object) -> Film:
    return make_film(surface, attached=tuple(range(len(surface.vertices))), **changes)


def test_flat_sum_is_half_the_tension_for_each_opposite_half_edge() -> None:
    """At phi = pi the sigmoid is 1/2. Opposite to a disc's centre lie six rims, to a rim vertex two."""
    lift = lift_of(attached_film(zoo.make_disc(6)), 0.7)
    np.testing.assert_allclose(lift, [6 * 0.7 / 2] + [2 * 0.7 / 2] * 6, rtol=1e-14)


@pytest.mark.parametrize("name", ["disc", "hexagon", "fan", "lattice", "annulus", "triangle", "two pieces"])
def test_per_valence_makes_rims_and_corners_equal_to_the_inside(name: str) -> None:
    """Equal tension on a flat film lifts every vertex by 6 T / 2, whatever its valence."""
    np.testing.assert_allclose(
        lift_of(attached_film(zoo.ZOO[name]()), 0.7, per_valence=True), 2.1, rtol=1e-14
    )


@pytest.mark.parametrize("spokes", [3, 4, 5, 8])
def test_valence_matters_only_to_the_plain_sum(spokes: int) -> None:
    film = attached_film(zoo.make_disc(spokes))
    assert lift_of(film)[0] == pytest.approx(spokes / 2)
    assert lift_of(film, per_valence=True)[0] == pytest.approx(3.0)


@pytest.mark.parametrize("bend", [-2.5, -0.8, -0.01, 0.0, 0.01, 0.8, 2.5])
@pytest.mark.parametrize("convexity", [0.0, 2.0, 7.0])
def test_sigmoid_of_the_dihedral(bend: float, convexity: float) -> None:
    """F = T / (1 + exp(-a (phi - pi))), at a hinge: corners 2 and 3 have one half-edge opposite."""
    film = attached_film(zoo.make_hinge(bend), lift_convexity=convexity)
    expected = 0.7 / (1 + np.exp(-convexity * bend))
    lift = lift_of(film, 0.7)
    assert lift[2] == pytest.approx(expected, rel=1e-13)
    assert lift[3] == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("convexity", [0.0, 0.3, 2.0, 100.0])
def test_the_bound_is_above_the_sigmoid_and_close_to_it(convexity: float) -> None:
    """Above it everywhere but for round-off, and for small bends by at most 0.02."""
    for bend in np.concatenate([np.linspace(-np.pi, np.pi, 4001), np.geomspace(1e-300, 1e-3, 50)]):
        for factor in (1e-6, 1.0, 1e6):
            bound = sigmoid_bound(factor * np.sin(bend), factor * np.cos(bend), convexity)
            exact = 1 / (1 + np.exp(-convexity * bend))
            assert bound >= exact * (1 - 1e-12)
            if abs(convexity * bend) < 1.0 and abs(bend) < 0.8:
                assert bound <= exact + 0.02


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sums", ["plain", "per_valence"])
def test_the_bound_of_a_crumpled_film_is_above_its_lift(sums: str, seed: int) -> None:
    """Every third vertex attached, the others anywhere: hinges bent by any angle, some vertices of eight and
    more."""
    random = np.random.default_rng(seed)
    surface = make_random_sheet(faces=300, seed=seed + 1)
    attached = tuple(range(0, len(surface.vertices), 3))
    film = make_film(surface, attached=attached, lift_sum=sums)
    free = film.state.separated[: film.mesh.vertex_count]
    film.mesh.positions[: len(free)][free] += random.normal(scale=0.05, size=(free.sum(), 3))
    agenda = film.agenda(1.0, 1.0)
    find_in_fringe(film.mesh, film.state, film.rules, agenda, 1.0, 0)
    lift = sum_lift(film)
    assert agenda.counts[FRINGE] > 50
    for i in range(agenda.counts[FRINGE]):
        bound = bound_lift(
            film.mesh.positions, agenda.hinges, agenda.sums, i, film.parameters.lift_convexity, -1.0
        )
        assert bound * (1 + SLACK) >= lift[agenda.fringe[i]]


def test_ridges_lift_more_than_flats_and_these_more_than_valleys() -> None:
    by_bend = [lift_of(attached_film(zoo.make_hinge(bend)))[2] for bend in np.linspace(-3, 3, 13)]
    assert (np.diff(by_bend) > 0).all()
    assert by_bend[0] + by_bend[-1] == pytest.approx(1.0), "the sigmoid is symmetric about flat"


def test_stoney_lift_is_proportional_to_tension() -> None:
    """Eq. 2: all but the tension constant, the displacement, and by Hooke the lift, is k T."""
    film = attached_film(zoo.make_roof(0.6))
    unit = lift_of(film, 1.0)
    for tension in (0.0, 1e-3, 0.5, 40.0):
        np.testing.assert_allclose(lift_of(film, tension), tension * unit, rtol=1e-14)


def test_each_face_lifts_with_its_own_tension() -> None:
    surface = zoo.make_disc(6)
    tension = np.arange(1.0, 7.0)
    lift = lift_of(attached_film(surface), tension)
    assert lift[0] == pytest.approx(tension.sum() / 2)
    for v in range(1, 7):
        faces = np.flatnonzero((surface.faces == v).any(axis=1))
        assert lift[v] == pytest.approx(tension[faces].sum() / 2)


def test_separated_vertices_have_no_lift() -> None:
    lift = lift_of(make_film(zoo.make_disc(6), attached=(0, 1)))
    assert (lift[2:] == 0.0).all()
    assert lift[0] == pytest.approx(6 / 2) and lift[1] == pytest.approx(2 / 2)


def test_the_present_dihedral_counts_where_the_film_has_moved() -> None:
    film = make_film(zoo.make_hinge(0.0), attached=(0, 1, 3))
    film.mesh.positions[2] = (
        0.5,
        0.0,
        zoo.HALF_ROOT_3,
    )  # the free flap stands upright: a valley of 90 degrees
    assert lift_of(film)[3] == pytest.approx(1 / (1 + np.exp(2.0 * np.pi / 2)), rel=1e-13)


def test_a_broken_edge_lifts_as_if_flat() -> None:
    film = make_film(zoo.make_hinge(1.0), attached=(2, 3), cohesion_base=1.0)
    assert lift_of(film)[3] == pytest.approx(1 / (1 + np.exp(-2.0)), rel=1e-13)
    assert film.fracture() == {(0, 1)}
    assert lift_of(film)[3] == 0.5
