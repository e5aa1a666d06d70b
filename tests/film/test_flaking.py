"""Flaking: what nothing holds falls, whole, and its area is accounted for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import zoo
from tests.film.films import Film, make_film
from weathercoat.film.flaking import rest_edge_length, rest_face_area
from weathercoat.mesh.shapes import make_random_sheet

TRIANGLE = zoo.HALF_ROOT_3 / 2  # area of a unit triangle


def face_of(film: Film, *corners: int) -> int:
    (found,) = np.flatnonzero((np.sort(film.mesh.faces, axis=1) == sorted(corners)).all(axis=1))
    return int(found)


def break_all(film: Film, *edges: tuple[int, int]) -> None:
    film.set_cohesion(0.0, *edges)
    assert film.fracture() == {(min(pair), max(pair)) for pair in edges}


def test_rest_measures() -> None:
    film = make_film(zoo.make_ladder(2, length=3.0, width=4.0))
    film.mesh.positions[:] = 0.0
    assert [
        rest_edge_length(film.mesh.rest_positions, film.mesh.faces, film.half_edge(*pair))
        for pair in ((0, 2), (2, 3), (0, 3))
    ] == [
        3,
        4,
        5,
    ]
    assert [rest_face_area(film.mesh.rest_positions, film.mesh.faces, f) for f in (0, 1)] == pytest.approx(
        [6.0, 6.0]
    )


@pytest.mark.parametrize("rule", ["faces", "islands"])
def test_a_face_falls_when_its_last_edge_has_broken(rule: str) -> None:
    """In the middle of a hexagon whose rim is attached: two broken edges hold, three do not."""
    surface = zoo.make_hexagon(2)
    film = make_film(surface, attached=tuple(range(7, 19)), flaking_rule=rule)
    a, b = zoo.vertex_at(surface, 1, 0), zoo.vertex_at(surface, 0.5, zoo.HALF_ROOT_3)
    f = face_of(film, 0, a, b)
    film.state.tension[:] = 100.0
    break_all(film, (0, a), (0, b))
    assert film.flake() == [] and film.mesh.alive.all()
    film.state.tension[:] = 100.0
    film.set_cohesion(0.0, (a, b))
    film.log.clear()
    film.fracture()
    areas = film.flake()
    assert areas == [pytest.approx(TRIANGLE)]
    assert np.flatnonzero(~film.mesh.alive).tolist() == [f]
    assert film.log.fall_entries().tolist() == [f]
    assert (film.mesh.twin[3 * f : 3 * f + 3] == -1).all()


def test_rims_count_as_broken() -> None:
    """A corner face of a ladder has one inner edge: with it gone, the face falls by the literal rule."""
    film = make_film(zoo.make_ladder(3), flaking_rule="faces")
    break_all(film, (0, 3))
    assert film.flake() == [0.5]
    assert np.flatnonzero(~film.mesh.alive).tolist() == [face_of(film, 0, 1, 3)]


def test_an_island_falls_whole_and_only_by_the_rule_of_islands() -> None:
    """A ladder attached at its left end is parted at the rung in the middle: its right half may fall."""
    for rule, fallen in (("islands", [2.0]), ("faces", [])):
        film = make_film(zoo.make_ladder(5), attached=(0, 1), flaking_rule=rule)
        break_all(film, (4, 5))
        assert film.flake() == pytest.approx(fallen)
        centre = film.positions[film.mesh.faces].mean(axis=1)
        assert (film.mesh.alive == ((centre[:, 0] < 2) | (rule == "faces"))).all()


@pytest.mark.parametrize("held", [4, 5, 8, 9])
def test_one_attached_vertex_holds_a_piece(held: int) -> None:
    film = make_film(zoo.make_ladder(5), attached=(0, held))
    film.set_cohesion(0.0, (4, 5))
    film.state.separated[held] = True
    film.fracture()
    film.state.separated[np.flatnonzero(film.mesh.origin[: film.mesh.vertex_count] == held)] = False
    assert film.flake() == []
    assert film.mesh.alive.all()


def test_a_piece_that_was_never_held_falls_when_its_last_vertex_lets_go() -> None:
    """The triangle of two pieces, without a break: it hangs on its own vertices only."""
    film = make_film(zoo.make_two_pieces(), attached=(0, 7))
    assert film.flake(separating=(1, 2)) == []
    film.state.separated[7] = True
    assert film.flake(separating=(7,)) == [pytest.approx(TRIANGLE)]
    film.state.separated[0] = True
    assert film.flake(separating=(0,)) == [pytest.approx(6 * TRIANGLE)]
    assert not film.mesh.alive.any()


def test_nothing_falls_in_a_quiet_step() -> None:
    film = make_film(zoo.make_disc())
    assert film.flake(separating=()) == []
    assert film.mesh.alive.all()


# --- pieces that hang by a thread ---


def hanging_ladder(share: float) -> Film:
    """Eight rungs, the left two attached: the free faces begin at rung 2 and hang by that rung alone.

    The rung is 1 long and their area 5, so they hang by 1 / (2 sqrt(5 pi)) of the outline of a disc as large.
    """
    return make_film(zoo.make_ladder(8), attached=(0, 1, 2, 3), flaking_hanging_share=share)


@pytest.mark.parametrize(("share", "falls"), [(0.0, False), (0.12, False), (0.13, True), (0.5, True)])
def test_a_piece_tears_off_where_it_hangs_by_less_than_a_share_of_its_girth(
    share: float, falls: bool
) -> None:
    """1 / (2 sqrt(5 pi)) = 0.126 of the girth of the piece is held; see `hanging_ladder`."""
    film = hanging_ladder(share)
    assert film.flake() == ([pytest.approx(5.0)] if falls else [])
    centre = film.positions[film.mesh.faces].mean(axis=1)
    assert (film.mesh.alive == ((centre[:, 0] < 2) | (not falls))).all()


def test_tearing_off_is_a_break_like_any_other() -> None:
    """The rung that tore is in the log, frays and relaxes what is left, and its ends are split."""
    film = hanging_ladder(0.5)
    film.flake()
    h, g = film.log.break_entries()[0]
    assert zoo.edge_ends(film.mesh, np.array([h])) == {(4, 5)}
    left = h if film.mesh.alive[h // 3] else g
    assert film.state.fray_age[left // 3] == 1.0
    assert film.tension()[left // 3] == 0.5
    assert film.tips() == {}
    assert len(film.copies(4)) == len(film.copies(5)) == 1


def test_the_film_between_attached_vertices_never_tears() -> None:
    """All free pieces hang by everything: a hexagon whose rim is attached, at the largest share."""
    film = make_film(zoo.make_hexagon(3), attached=tuple(range(19, 37)), flaking_hanging_share=1.0)
    assert film.flake() == []


# --- conservation ---


@pytest.mark.compiled
@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    rule=st.sampled_from(["faces", "islands"]),
    share=st.sampled_from([0.0, 0.2, 0.9]),
    attached=st.floats(0.0, 0.5),
)
def test_area_of_the_film_and_of_what_fell_is_that_at_the_start(
    seed: int, rule: str, share: float, attached: float
) -> None:
    """Conservation of area after every call; sums of 150 areas of a unit sheet round at 1e-15.

    What has fallen is never attached, and under the rule of islands each piece that is left has an attached
    vertex.
    """
    random = np.random.default_rng(seed)
    surface = make_random_sheet(faces=150, seed=seed % 7 + 1)
    held = np.flatnonzero(random.random(len(surface.vertices)) < attached)
    film = make_film(
        surface,
        attached=tuple(held),
        flaking_rule=rule,
        flaking_hanging_share=share,
        fracture_face_factor=1.0,
    )
    film.state.cohesion[:] = random.uniform(0.0, 8.0, len(film.state.cohesion))
    lost = 0.0
    areas = surface.face_areas()
    for age in (1.0, 2.0, 3.0):
        film.state.tension[:] = age
        film.state.tension_cap[:] = age
        film.fracture(age)
        lost += sum(film.flake(age))
        assert areas[film.mesh.alive].sum() + lost == pytest.approx(surface.area(), abs=1e-12)
        used = np.unique(film.mesh.tail[np.repeat(film.mesh.alive, 3)])
        assert set(held) <= set(used.tolist()) or rule == "faces"
        assert (film.mesh.half_edge[used] >= 0).all()
