"""Separation: a vertex lets go in the step in which the lift outgrows what is left of its adhesion."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests import zoo
from tests.film.films import Film, make_film, sum_lift
from weathercoat.film.fringe import find_in_fringe
from weathercoat.film.separation import find_due
from weathercoat.mesh.shapes import make_sphere
from weathercoat.mesh.surface import Surface

STEPS = 400
DRYING = {"tension_initial": 0.0, "tension_rate": 3.0, "adhesion_decay_rate": 0.6, "lift_coefficient": 0.2}


def attached_film(surface: Surface, **changes: object) -> Film:
    return make_film(surface, attached=tuple(range(len(surface.vertices))), **changes)


def separating(film: Film, age: float) -> list[int]:
    """Who would let go at an age, without letting them go."""
    agenda = film.agenda(age, 1.0)
    found = find_due(film.mesh, film.state, film.rules, agenda, age, 1.0)
    found = find_in_fringe(film.mesh, film.state, film.rules, agenda, age, found)
    return np.sort(agenda.found[:found]).tolist()


def first_steps(film: Film) -> dict[int, int]:
    """For each vertex, the first of STEPS steps in which it separates."""
    when: dict[int, int] = {}
    for step in range(1, STEPS + 1):
        found = film.separate(step / STEPS)
        when.update(dict.fromkeys(found, step))
    return when


@pytest.mark.parametrize("rule", ["drying", "face"])
@pytest.mark.parametrize("law", ["saturating", "linear"])
@pytest.mark.parametrize("base", [0.5, 0.8])
def test_a_flat_film_separates_at_the_predicted_step(rule: str, law: str, base: float) -> None:
    """All in the first step with k 3 T(t) > A (1 - d t): six half-edges, each lifting half of k T."""
    film = attached_film(
        zoo.make_hexagon(2), tension_law=law, adhesion_base=base, lift_sum="per_valence", **DRYING
    )
    ages = [step / STEPS for step in range(1, STEPS + 1)]
    tension = [1 - math.exp(-3 * age) if law == "saturating" else 3 * age for age in ages]
    lifts = [0.2 * 3 * t > base * (1 - 0.6 * age) for t, age in zip(tension, ages, strict=True)]
    predicted = lifts.index(True) + 1
    assert 1 < predicted < STEPS
    assert set(first_steps(film).items()) == {(v, predicted) for v in range(19)}


def test_the_plain_sum_lets_rims_go_later() -> None:
    """Literally the corners of a hexagon (two or three half-edges opposite) lift less than the inside."""
    surface = zoo.make_hexagon(2)
    film = attached_film(surface, adhesion_base=0.5, lift_sum="plain", **DRYING)
    opposite = np.bincount(surface.faces.reshape(-1))
    when = first_steps(film)
    for v, count in enumerate(opposite):
        reached = [
            step
            for step in range(1, STEPS + 1)
            if 0.2 * count / 2 * (1 - math.exp(-3 * step / STEPS)) > 0.5 * (1 - 0.6 * step / STEPS)
        ]
        assert when.get(v) == (reached[0] if reached else None)
    assert len(set(when.values())) > 1


def test_lift_must_exceed_the_adhesion() -> None:
    """With T = 1 and k = 1/8, the lift on a flat vertex is exactly 3/8: equal adhesion holds."""
    film = attached_film(zoo.make_disc(6), lift_coefficient=0.125, adhesion_base=0.375, lift_sum="plain")
    assert separating(film, 1.0) == []
    film.state.adhesion[0] = np.nextafter(0.375, 0.0)
    assert separating(film, 1.0) == [0]


def test_weak_places_go_first_and_none_goes_twice() -> None:
    film = attached_film(zoo.make_disc(6), lift_sum="per_valence", lift_coefficient=0.25, adhesion_base=1.0)
    film.state.adhesion[[3, 5]] = 0.7
    assert separating(film, 0.5) == [3, 5]
    assert film.separate(0.5) == [3, 5]
    assert film.state.separated[:7].tolist() == [False, False, False, True, False, True, False]
    assert film.state.separation_age[[3, 5]].tolist() == [0.5, 0.5]
    assert separating(film, 0.6) == []


def test_convex_places_go_before_flat_ones_and_hollows_last() -> None:
    """The lift at a foot of the fold is that of its dihedral: sigmoids of 0.8, 0 and -0.8 times 6 k."""
    reach = {}
    for bend in (0.8, 0.0, -0.8):
        film = attached_film(zoo.make_hinge(bend), lift_sum="per_valence", lift_coefficient=0.1)
        film.state.adhesion[:] = np.inf
        total = 0.6 / (1 + math.exp(-2 * bend))
        film.state.adhesion[2] = 0.999 * total
        assert separating(film, 1.0) == [2]
        film.state.adhesion[2] = 1.001 * total
        assert separating(film, 1.0) == []
        reach[bend] = total
    assert reach[0.8] > reach[0.0] > reach[-0.8]


def test_the_drying_tension_lifts_beside_a_crack_unless_told_otherwise() -> None:
    """With the face's own tension, relaxed by a break, the pieces round a crack stay on the metal."""
    for rule, expected in (("drying", [0]), ("face", [])):
        film = attached_film(zoo.make_disc(6), lift_tension=rule, lift_sum="plain", lift_coefficient=0.4)
        film.state.adhesion[1:] = np.inf
        assert separating(film, 1.0) == [0]
        film.state.tension[:] = 0.5
        film.state.tension_cap[:] = 0.5
        assert separating(film, 1.0) == expected


def test_vertices_without_a_face_do_not_separate() -> None:
    film = attached_film(zoo.make_two_pieces(), adhesion_base=0.0, lift_sum="plain")
    film.mesh.alive[6] = False
    film.mesh.half_edge[7:10] = -1
    assert separating(film, 1.0) == list(range(7))


@pytest.mark.compiled
@pytest.mark.parametrize("rule", ["drying", "face"])
@pytest.mark.parametrize("sums", ["plain", "per_valence"])
def test_finds_whom_a_plain_evaluation_finds_while_the_film_moves(rule: str, sums: str) -> None:
    """The lift that is kept for undisturbed vertices, against all lifts summed anew in every step."""
    film = attached_film(
        make_sphere(subdivisions=2), tension_initial=0.0, tension_rate=3.0, lift_coefficient=0.3,
        lift_sum=sums, lift_tension=rule, adhesion_amplitude=0.5, adhesion_decay_rate=0.5, cohesion_base=1.2,
    )  # fmt: skip
    random = np.random.default_rng(3)
    seen = 0
    for step in range(1, 31):
        age = step / 30
        count = film.mesh.vertex_count
        scale = 0.3 * (1 - math.exp(-3 * age) if rule == "drying" else 1.0)
        adhesion = np.maximum(film.state.adhesion - 0.5 * age, 0.0)[film.mesh.origin[:count]]
        margin = scale * sum_lift(film, age) - adhesion
        margin[film.state.separated[:count]] = -1.0
        assert (np.abs(margin) > 1e-12).all()
        found = film.separate(age)
        assert found == np.flatnonzero(margin > 0).tolist()
        seen += len(found)
        film.fracture(age)
        moved = np.flatnonzero(film.state.separated[: film.mesh.vertex_count])
        film.mesh.positions[moved] += random.normal(scale=0.02, size=(len(moved), 3))
    assert 30 < seen <= 162
