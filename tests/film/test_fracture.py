"""Fracture on hand-made meshes where every break can be predicted.

Unless said otherwise the tension is 1 in every face, so an inner edge bears 2 and breaks where its cohesion,
times beta where a tip leads on along it, is below 2.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests import zoo
from tests.film.films import Film, make_film
from weathercoat.film.fracture import break_edge, cohesion_at, edge_overload, find_overloaded
from weathercoat.film.relaxation import tension_across
from weathercoat.mesh.halfedge import check_half_edges
from weathercoat.mesh.shapes import make_plate, make_random_sheet
from weathercoat.mesh.surface import Surface, Vectors

Edge = tuple[int, int]
HEXAGON = zoo.make_hexagon(4)


def at(x: float, y: float = 0.0, surface: Surface = HEXAGON) -> int:
    return zoo.vertex_at(surface, x, y)


def along(start: float, end: float) -> Edge:
    """The edge between two neighbours on the x axis of the hexagon."""
    a, b = at(start), at(end)
    return min(a, b), max(a, b)


def edge(a: int, b: int) -> Edge:
    return min(a, b), max(a, b)


# --- the test itself ---


def test_an_edge_breaks_when_its_two_faces_outpull_its_cohesion() -> None:
    film = make_film(HEXAGON)
    film.set_cohesion(2.0, along(0, 1))
    assert film.fracture() == set(), "equal is not more"
    film.set_cohesion(np.nextafter(2.0, 0.0), along(0, 1))
    assert film.fracture() == {along(0, 1)}
    assert film.fracture() == set()


def test_it_is_the_sum_of_the_tension_of_both_faces() -> None:
    film = make_film(zoo.make_hinge(), cohesion_base=2.0)
    film.state.tension[:] = film.state.tension_cap[:] = (0.3, 1.6)
    assert film.fracture() == set()
    film.state.tension[:] = film.state.tension_cap[:] = (0.5, 1.6)
    assert film.fracture() == {(0, 1)}


def test_the_weaker_half_edge_decides() -> None:
    for side in range(2):
        film = make_film(zoo.make_hinge())
        film.state.cohesion[film.half_edge(*((0, 1), (1, 0))[side])] = 1.0
        assert film.fracture() == {(0, 1)}


@pytest.mark.parametrize("held", [(0,), (1,), (0, 1)])
def test_both_ends_must_have_separated(held: tuple[int, ...]) -> None:
    film = make_film(zoo.make_hinge(), attached=held, cohesion_base=0.1)
    assert film.fracture() == set()


def test_the_apexes_may_be_attached() -> None:
    film = make_film(zoo.make_hinge(), attached=(2, 3), cohesion_base=0.1)
    assert film.fracture() == {(0, 1)}


@pytest.mark.parametrize("name", ["triangle", "fan", "annulus", "ladder", "two pieces"])
def test_rims_never_break(name: str) -> None:
    film = make_film(zoo.ZOO[name]())
    film.state.cohesion[film.mesh.twin < 0] = 0.0
    assert film.fracture() == set()


def test_defects_are_where_an_intact_film_breaks_first() -> None:
    """With cohesion 3 against a pull of 2 nothing breaks but the defects, each an edge of its own here."""
    film = make_film(
        make_random_sheet(faces=400), cohesion_base=3.0, defects_share=0.02, defects_strength=0.001,
        fracture_direction_factor=1.0,
    )  # fmt: skip
    defects = np.flatnonzero((film.state.cohesion < 1.0) & (film.mesh.twin > np.arange(len(film.mesh.twin))))
    assert len(defects) > 3
    assert film.fracture() == zoo.edge_ends(film.mesh, defects)


# --- what a break does ---


def test_a_break_inside_makes_two_tips_that_point_apart() -> None:
    film = make_film(HEXAGON)
    film.set_cohesion(1.0, along(0, 1))
    before = film.mesh.vertex_count
    film.fracture()
    assert film.mesh.vertex_count == before
    assert film.tips() == {at(0): (-1.0, 0.0, 0.0), at(1): (1.0, 0.0, 0.0)}


def test_directions_are_those_of_the_rest_surface() -> None:
    film = make_film(HEXAGON)
    film.mesh.positions[:] = film.mesh.positions[:, [1, 2, 0]] * 3
    film.set_cohesion(1.0, along(0, 1))
    film.fracture()
    assert film.tips() == {at(0): (-1.0, 0.0, 0.0), at(1): (1.0, 0.0, 0.0)}


def test_the_second_break_at_a_vertex_duplicates_it_in_place() -> None:
    """The tip at 0 gets a second broken edge: two copies with all its state, and no tip any more."""
    film = make_film(HEXAGON)
    film.state.separation_age[at(0)] = 0.125
    film.set_cohesion(1.0, along(0, 1))
    film.fracture()
    film.mesh.positions[at(0)] = (0.1, 0.2, 0.3)
    film.set_cohesion(1.0, along(-1, 0))
    film.fracture()
    first, second = film.copies(at(0))
    assert film.mesh.positions[second].tolist() == film.mesh.positions[first].tolist() == [0.1, 0.2, 0.3]
    assert film.state.separated[[first, second]].all()
    assert (film.state.separation_age[[first, second]] == 0.125).all()
    assert film.tips() == {at(-1): (-1.0, 0.0, 0.0), at(1): (1.0, 0.0, 0.0)}
    above = {int(f) for f in np.flatnonzero((film.mesh.tail.reshape(-1, 3) == first).any(axis=1))}
    below = {int(f) for f in np.flatnonzero((film.mesh.tail.reshape(-1, 3) == second).any(axis=1))}
    assert len(above) == len(below) == 3 and not above & below


def test_a_rim_vertex_splits_at_its_first_break_and_is_no_tip() -> None:
    film = make_film(HEXAGON)
    film.set_cohesion(1.0, along(3, 4))
    film.fracture()
    assert len(film.copies(at(4))) == 2
    assert len(film.copies(at(3))) == 1
    assert film.tips() == {at(3): (-1.0, 0.0, 0.0)}


def test_an_edge_between_two_rims_leaves_two_pieces() -> None:
    film = make_film(zoo.make_ladder(3))
    film.set_cohesion(1.0, (2, 3))
    assert film.fracture() == {(2, 3)}
    assert film.tips() == {}
    assert [len(film.copies(v)) for v in range(6)] == [1, 1, 2, 2, 1, 1]


def test_a_crack_that_meets_another_one_ends_there() -> None:
    """A junction: the flank of a crack along x is hit from above; three fans there, none a tip."""
    film = make_film(HEXAGON)
    film.set_cohesion(1.0, along(-1, 0), along(0, 1))
    film.fracture()
    up = at(0.5, zoo.HALF_ROOT_3)
    film.set_cohesion(1.0, (at(0), up))
    assert film.fracture() == {edge(at(0), up)}
    assert len(film.copies(at(0))) == 3
    assert set(film.tips()) == {at(-1), at(1), up}


@pytest.mark.parametrize("spokes", [3, 4, 6])
def test_all_spokes_break_one_by_one(spokes: int) -> None:
    """k broken spokes leave k vertices at the centre (one for k = 1), and each rim end has two."""
    film = make_film(zoo.make_disc(spokes))
    for k in range(1, spokes + 1):
        film.set_cohesion(0.5, (0, k))
        film.state.tension[:] = 1.0
        assert film.fracture() == {(0, k)}
        assert len(film.copies(0)) == k
        assert len(film.copies(k)) == 2
        assert set(film.tips()) == ({0} if k == 1 else set())


# --- alpha and beta ---


def crack(film: Film, calls: int) -> list[set[Edge]]:
    return [film.fracture() for _ in range(calls)]


def test_a_crack_runs_straight_where_only_straight_on_leads() -> None:
    """cos 60 = 0.5 is below alpha = 0.6: of the lattice's directions only the one ahead counts.

    Cohesion 9 becomes 1.8 there, so one edge a call breaks at each tip, until both have run into the rim.
    """
    film = make_film(HEXAGON, cohesion_base=9.0, fracture_direction_threshold=0.6)
    film.set_cohesion(1.0, along(0, 1))
    assert crack(film, 6) == [
        {along(0, 1)},
        {along(-1, 0), along(1, 2)},
        {along(-2, -1), along(2, 3)},
        {along(-3, -2), along(3, 4)},
        {along(-4, -3)},
        set(),
    ]
    assert film.tips() == {}
    assert all(len(film.copies(at(x))) == 2 for x in range(-4, 5))


@pytest.mark.parametrize(("factor", "runs"), [(0.2, True), (0.25, False), (1.0, False)])
def test_beta_decides_whether_a_crack_runs(factor: float, runs: bool) -> None:
    """Cohesion 9 times beta against a pull of 2: 1.8 breaks, 2.25 and the whole 9 do not."""
    film = make_film(
        HEXAGON, cohesion_base=9.0, fracture_direction_threshold=0.6, fracture_direction_factor=factor
    )
    film.set_cohesion(1.0, along(0, 1))
    film.fracture()
    assert film.fracture() == ({along(-1, 0), along(1, 2)} if runs else set())


@pytest.mark.parametrize(("threshold", "kinks"), [(0.49, True), (0.51, False), (0.45, True)])
def test_alpha_decides_how_far_a_crack_may_turn(threshold: float, kinks: bool) -> None:
    """Straight on is too strong; the lattice's next direction makes 60 degrees, of cosine 0.5."""
    film = make_film(HEXAGON, fracture_direction_threshold=threshold)
    film.set_cohesion(1.0, along(0, 1))
    turn = edge(at(1), at(1.5, zoo.HALF_ROOT_3))
    film.set_cohesion(9.0, turn)
    film.fracture()
    assert film.fracture() == ({turn} if kinks else set())
    if kinks:
        tip = film.tips()[at(1.5, zoo.HALF_ROOT_3)]
        assert tip == pytest.approx((0.5, zoo.HALF_ROOT_3, 0.0))


def test_what_lies_behind_a_tip_is_not_led_on() -> None:
    """120 degrees from the direction: cohesion 5 stays 5 against 1.5, of a relaxed face and a whole one."""
    film = make_film(HEXAGON, fracture_direction_threshold=0.01)
    film.set_cohesion(1.0, along(0, 1))
    film.set_cohesion(5.0, (at(1), at(0.5, zoo.HALF_ROOT_3)), (at(0), at(0.5, zoo.HALF_ROOT_3)))
    film.fracture()
    assert film.fracture() == set()


def test_only_the_way_out_of_the_tip_counts() -> None:
    """The edge must start at the tip: one that is merely parallel, a row above, is as strong as ever."""
    film = make_film(HEXAGON, fracture_direction_threshold=0.6)
    film.set_cohesion(1.0, along(0, 1))
    film.set_cohesion(9.0, (at(0.5, zoo.HALF_ROOT_3), at(1.5, zoo.HALF_ROOT_3)))
    film.fracture()
    assert film.fracture() == set()


@pytest.mark.parametrize(("bond", "breaks"), [(9.0, True), (15.0, False)])
def test_two_tips_that_face_each_other_weaken_once(bond: float, breaks: bool) -> None:
    """beta = 0.2 once: 15 becomes 3 and holds against 2; squared it would be 0.6."""
    film = make_film(HEXAGON, fracture_direction_threshold=0.6)
    film.set_cohesion(1.0, along(-2, -1), along(0, 1))
    film.set_cohesion(bond, along(-1, 0))
    film.fracture()
    assert film.fracture() == ({along(-1, 0)} if breaks else set())


def test_of_three_ways_on_the_tip_takes_one() -> None:
    """At alpha = 0.45 three edges lead on, all with the same overload: the hash decides."""
    film = make_film(HEXAGON, cohesion_base=9.0, fracture_direction_threshold=0.45)
    film.set_cohesion(1.0, along(0, 1))
    film.fracture()
    expected = set()
    for tip, sign in ((at(0), -1), (at(1), 1)):
        x = film.positions[tip, 0]
        ways = [at(x + sign), at(x + sign / 2, zoo.HALF_ROOT_3), at(x + sign / 2, -zoo.HALF_ROOT_3)]
        hashes = [film.state.tie[zoo.find_edge(film.mesh, tip, way)] for way in ways]
        expected.add(edge(tip, ways[int(np.argmin(hashes))]))
    assert film.fracture() == expected


# --- order, ties, rounds ---


@pytest.mark.parametrize(("rung", "diagonal", "first"), [(1.0, 1.2, (2, 3)), (1.2, 1.0, (0, 3))])
def test_the_most_overloaded_breaks_first_and_relieves_its_neighbour(
    rung: float, diagonal: float, first: Edge
) -> None:
    """Both are overloaded and share a face; a break takes its tension to 0, and the other's load to 1."""
    film = make_film(zoo.make_ladder(3), fracture_face_factor=0.0)
    film.set_cohesion(rung, (2, 3))
    film.set_cohesion(diagonal, (0, 3))
    assert film.fracture() == {first}
    assert film.fracture() == set()


@pytest.mark.parametrize("winner", [(2, 3), (0, 3)])
def test_equals_are_told_apart_by_the_hash(winner: Edge) -> None:
    film = make_film(zoo.make_ladder(3), fracture_face_factor=0.0)
    film.set_cohesion(1.2, (2, 3), (0, 3))
    film.state.tie[:] = 7
    h = zoo.find_edge(film.mesh, *winner)
    film.state.tie[[h, film.mesh.twin[h]]] = 3
    assert film.fracture() == {winner}


@pytest.mark.parametrize("seed", range(4))
def test_ties_do_not_hang_on_the_numbering(seed: int) -> None:
    """All edges alike: the pattern of breaks is the hash's alone."""

    def broken_places(surface: Surface) -> set[tuple[float, float]]:
        film = make_film(surface, cohesion_base=1.2, fracture_face_factor=0.0)
        pairs = np.array(sorted(film.fracture()))
        middle = surface.vertices[pairs].mean(axis=1)
        return {(round(float(x), 6) + 0.0, round(float(y), 6) + 0.0) for x, y, _ in middle}

    places = broken_places(HEXAGON)
    assert len(places) > 10
    assert broken_places(zoo.renumber(HEXAGON, seed)) == places


def test_another_seed_breaks_ties_in_another_way() -> None:
    patterns = [
        make_film(HEXAGON, cohesion_base=1.2, fracture_face_factor=0.0, seed=s).fracture() for s in (1, 2)
    ]
    assert patterns[0] != patterns[1]


def test_candidates_are_the_overloaded_edges_with_their_overload() -> None:
    film = make_film(zoo.make_ladder(3))
    film.set_cohesion(0.5, (2, 3))
    film.set_cohesion(1.6, (0, 3))
    agenda = film.agenda(1.0, 1.0)
    found = find_overloaded(film.mesh, film.state, film.rules, agenda, 1.0, 1.0)
    by_edge = dict(zip(agenda.found[:found].tolist(), agenda.values[:found].tolist(), strict=True))
    assert by_edge == {zoo.find_edge(film.mesh, 2, 3): 4.0, zoo.find_edge(film.mesh, 0, 3): 1.25}


def test_literally_a_step_has_one_round() -> None:
    film = make_film(HEXAGON, cohesion_base=9.0, fracture_direction_threshold=0.6, fracture_rounds="one")
    film.set_cohesion(1.0, along(0, 1))
    assert [len(film.fracture(duration=d)) for d in (0.01, 100.0)] == [1, 2]


def test_cracks_run_a_length_per_age_with_fractions_carried_over() -> None:
    """Edges of length 1, speed 1.5, ticks of 1/4: 3/8 of a round each, so rounds in ticks 3, 6 and 8."""
    film = make_film(
        HEXAGON,
        cohesion_base=9.0,
        fracture_direction_threshold=0.6,
        fracture_rounds="by_speed",
        fracture_speed=1.5,
    )
    assert film.state.mean_edge == pytest.approx(1.0)
    film.set_cohesion(1.0, along(0, 1))
    assert [len(film.fracture(duration=0.25)) for _ in range(8)] == [0, 0, 1, 0, 0, 2, 0, 2]


@pytest.mark.parametrize("ticks", [1, 2, 4, 16])
def test_the_number_of_steps_does_not_set_the_speed(ticks: int) -> None:
    """Three rounds in all: the defect, and then two edges at each end."""
    film = make_film(
        HEXAGON,
        cohesion_base=9.0,
        fracture_direction_threshold=0.6,
        fracture_rounds="by_speed",
        fracture_speed=3.0,
    )
    film.set_cohesion(1.0, along(0, 1))
    broken = set().union(*(film.fracture(duration=1 / ticks) for _ in range(ticks)))
    assert broken == {along(x, x + 1) for x in range(-2, 3)}


# --- fraying and relaxation ---


def test_a_broken_edge_frays_the_other_edges_of_its_faces() -> None:
    """C exp(-rate (age - age of the break)) for the half-edges of both faces, and for no others."""
    film = make_film(HEXAGON, cohesion_base=5.0, cohesion_decay_rate=2.0, fracture_direction_factor=1.0)
    film.set_cohesion(1.0, along(0, 1))
    film.fracture(age=0.25)
    frayed = {film.half_edge(*along(0, 1)) // 3, film.half_edge(*along(0, 1)[::-1]) // 3}
    for f in range(len(film.mesh.alive)):
        for h in range(3 * f, 3 * f + 3):
            for age in (0.25, 0.75, 2.0):
                bond = film.state.cohesion[h] * (math.exp(-2.0 * (age - 0.25)) if f in frayed else 1.0)
                assert cohesion_at(film.state, film.rules, h, age) == pytest.approx(bond, rel=1e-14)


def test_fraying_goes_on_from_the_first_break() -> None:
    film = make_film(HEXAGON, cohesion_base=5.0, cohesion_decay_rate=2.0, fracture_direction_factor=1.0)
    film.set_cohesion(1.0, along(0, 1))
    film.fracture(age=0.25)
    f = film.half_edge(*along(0, 1)) // 3
    film.set_cohesion(0.1, (at(0), at(0.5, zoo.HALF_ROOT_3)))
    film.fracture(age=0.5)
    assert film.state.fray_age[f] == 0.25


def test_a_frayed_edge_breaks_when_its_closed_form_says_so() -> None:
    """C exp(-2 (t - 0.1)) falls below the pull: its two faces keep 0.5 and 1, in sum 1.5.

    5 exp(-2 (t - 0.1)) = 1.5 at t = 0.1 + ln(5 / 1.5) / 2 = 0.702; four edges fray, and the first breaks
    then.
    """
    due = 0.1 + math.log(5 / 1.5) / 2
    film = make_film(HEXAGON, cohesion_base=5.0, cohesion_decay_rate=2.0, fracture_direction_factor=1.0)
    film.set_cohesion(1.0, along(0, 1))
    film.fracture(age=0.1)
    assert film.fracture(age=due - 1e-9) == set()
    broken = film.fracture(age=due + 1e-9)
    apexes = {at(0.5, zoo.HALF_ROOT_3), at(0.5, -zoo.HALF_ROOT_3)}
    assert broken and all(set(pair) & apexes and set(pair) & {at(0), at(1)} for pair in broken)


def test_literally_a_break_relaxes_its_two_faces_only() -> None:
    film = make_film(HEXAGON, fracture_face_factor=0.3)
    film.set_cohesion(1.0, along(0, 1))
    film.fracture()
    a, b = film.half_edge(*along(0, 1)) // 3, film.half_edge(*along(0, 1)[::-1]) // 3
    expected = np.ones(len(film.mesh.alive))
    expected[[a, b]] = 0.3
    assert (film.tension() == expected).all()
    assert (film.state.tension_cap == 1.0).all(), "drying goes on to the same tension"


def test_a_relaxed_face_dries_again_from_where_it_was() -> None:
    film = make_film(HEXAGON, fracture_face_factor=0.3, tension_rate=2.0)
    film.set_cohesion(1.0, along(0, 1))
    film.fracture(age=0.5)
    f = film.half_edge(*along(0, 1)) // 3
    assert film.tension(1.0)[f] == pytest.approx(1.0 - 0.7 * math.exp(-1.0), rel=1e-14)


def distance_to_segment(point: Vectors, a: Vectors, b: Vectors) -> float:
    share = np.clip(np.dot(point - a, b - a) / np.dot(b - a, b - a), 0.0, 1.0)
    return float(np.linalg.norm(point - (a + share * (b - a))))


def unloaded_caps(
    film: Film, broken: Edge, tips: tuple[int, ...], lag: float, alpha: float, caps: Vectors | None = None
) -> Vectors:
    """What the break of an edge leaves of `caps` (m,), 1 by default: 1 - exp(-r / lag) where it reaches; a
    plain flood.

    It floods from each of the edge's two faces over twins, within 3 lags, not into what lies ahead of a tip,
    and not across faces that are as relaxed already.
    """
    mesh = film.mesh
    rest = mesh.rest_positions
    a, b = rest[broken[0]], rest[broken[1]]
    caps = np.ones(len(mesh.faces)) if caps is None else caps.copy()

    def is_ahead(centre: Vectors) -> bool:
        for tip in tips:
            origin, source = (a, b) if tip == broken[0] else (b, a)
            ahead, way = origin - source, centre - origin
            if np.dot(ahead, way) / np.linalg.norm(ahead) / np.linalg.norm(way) > alpha:
                return True
        return False

    for seed in np.flatnonzero(np.isin(mesh.faces, broken).sum(axis=1) == 2):
        todo = [int(seed)]
        while todo:
            f = todo.pop()
            centre = rest[mesh.faces[f]].mean(axis=0)
            distance = distance_to_segment(centre, a, b)
            cap = 1.0 - math.exp(-distance / lag)
            if (f != seed and distance > 3 * lag) or is_ahead(centre) or cap >= caps[f]:
                continue
            caps[f] = cap
            todo += [int(g) // 3 for g in mesh.twin[3 * f : 3 * f + 3] if g >= 0]
    return caps


LAG = {"fracture_relaxation": "shear_lag", "fracture_direction_threshold": 0.45}


@pytest.mark.parametrize("lag", [0.2, 0.7, 1.5])
def test_a_rung_unloads_both_sides_over_the_shear_lag(lag: float) -> None:
    """No tips: caps are 1 - exp(-r / lag) within 3 lags of the break, and tensions are clipped to them."""
    film = make_film(zoo.make_ladder(12), fracture_shear_lag=lag, **LAG)
    film.set_cohesion(1.0, (10, 11))
    film.fracture()
    expected = unloaded_caps(film, (10, 11), (), lag, 0.45)
    np.testing.assert_allclose(film.state.tension_cap, expected, atol=1e-14)
    np.testing.assert_allclose(film.tension(), expected, atol=1e-14)
    assert (expected == 1.0).any() and (expected < 1.0).sum() >= 2


@pytest.mark.parametrize("alpha", [0.2, 0.45, 0.8])
def test_the_film_ahead_of_a_tip_keeps_its_tension(alpha: float) -> None:
    """Faces whose centre lies within alpha of a tip's direction: that is where the stress of a crack goes."""
    film = make_film(
        HEXAGON, fracture_shear_lag=0.8, fracture_relaxation="shear_lag", fracture_direction_threshold=alpha
    )
    film.set_cohesion(1.0, along(0, 1))
    film.fracture()
    expected = unloaded_caps(film, along(0, 1), (at(0), at(1)), 0.8, alpha)
    np.testing.assert_allclose(film.state.tension_cap, expected, atol=1e-14)
    centre = film.positions[film.mesh.faces].mean(axis=1)
    ahead = (np.abs(centre[:, 1]) < 0.3) & (centre[:, 0] > 1.2)
    assert ahead.sum() >= 4 and (film.state.tension_cap[ahead] == 1.0).all()


def test_what_does_not_hang_together_is_not_unloaded() -> None:
    """The ladder is parted at one rung; a break at the next one cannot reach across."""
    film = make_film(zoo.make_ladder(6), fracture_shear_lag=2.0, **LAG)
    film.set_cohesion(1.0, (4, 5))
    film.fracture()
    before = film.state.tension_cap.copy()
    film.set_cohesion(0.01, (6, 7))
    assert film.fracture() == {(6, 7)}
    left = film.positions[film.mesh.faces].mean(axis=1)[:, 0] < 2
    assert (film.state.tension_cap[left] == before[left]).all()
    assert (film.state.tension_cap[~left] <= before[~left]).all()


@pytest.mark.parametrize(("along_x", "share"), [(1.0, 0.0), (0.0, 1.0), (0.5, 0.75)])
def test_a_free_edge_does_not_unload_the_film_along_itself(along_x: float, share: float) -> None:
    """T + (T_dry - T) (1 - cos^2): beside a break the relaxed tension pulls on edges parallel to it, the
    film's whole one on edges across it.
    """
    film = make_film(zoo.make_hinge(), tension_rate=2.0, tension_initial=0.1)
    film.state.tension[:] = film.state.tension_cap[:] = 0.3
    full = 1 - 0.9 * math.exp(-2.0 * 0.7)
    assert tension_across(film.mesh, film.state, film.rules, 0, 0, 1, 0.7, 0.7) == 0.3, (
        "nothing has relieved it"
    )
    film.state.relief[0] = (along_x, math.sqrt(1 - along_x**2), 0.0)
    found = tension_across(film.mesh, film.state, film.rules, 0, 0, 1, 0.7, 0.7)
    assert found == pytest.approx(0.3 + (full - 0.3) * share, rel=1e-14)


def test_the_nearest_break_gives_the_direction_of_relief() -> None:
    """Two rungs break; each face keeps the direction of the one that left it the lower cap. Faces out of
    reach: none.
    """
    film = make_film(zoo.make_ladder(12), fracture_shear_lag=0.5, **LAG)
    film.set_cohesion(0.001, (8, 9), (14, 17))
    assert film.fracture() == {(8, 9), (14, 17)}
    rung, diagonal = (unloaded_caps(film, pair, (), 0.5, 0.45) for pair in ((8, 9), (14, 17)))
    for f in range(len(film.mesh.alive)):
        if rung[f] == diagonal[f] == 1.0:
            assert (film.state.relief[f] == 0.0).all()
        else:
            expected = (0.0, 1.0, 0.0) if rung[f] < diagonal[f] else (math.sqrt(0.5), math.sqrt(0.5), 0.0)
            np.testing.assert_allclose(np.abs(film.state.relief[f]), expected, atol=1e-14)


def test_only_a_crack_that_comes_straight_feels_the_tension_along_another() -> None:
    """Both faces of an edge are relaxed to 0 by a break along y, but only from a tip that leads on along x is
    it broken.

    The tip's edge bears 2 T_dry = 2 against 9 beta = 1.8; without the tip nothing pulls on it.
    """
    for tip, expected in ((False, set()), (True, {along(1, 2)})):
        film = make_film(HEXAGON, fracture_direction_threshold=0.6)
        film.set_cohesion(9.0, along(1, 2))
        film.state.tension[:] = film.state.tension_cap[:] = 0.0
        film.state.relief[:] = (0.0, 1.0, 0.0)
        film.state.is_tip[at(1)] = tip
        film.state.crack_direction[at(1)] = (1.0, 0.0, 0.0)
        film.parameters = replace(film.parameters, tension_initial=1.0)
        assert film.fracture() == expected


@pytest.mark.compiled
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("scatter", [0.0, 0.2])
def test_last_bits_do_not_decide_what_breaks(scatter: float, seed: int) -> None:
    """On a grid caps and overloads agree but for round-off: errors of 1e-14 change no break."""
    grid = make_plate(columns=12, rows=12)

    def breaks(surface: Surface, film_seed: int) -> list[set[Edge]]:
        film = make_film(
            surface,
            cohesion_base=1.5,
            cohesion_scatter=scatter,
            defects_share=0.03,
            fracture_shear_lag=0.08,
            fracture_relaxation="shear_lag",
            seed=film_seed,
        )
        return crack(film, 8)

    error = np.random.default_rng(seed).uniform(-1e-14, 1e-14, grid.vertices.shape)
    for film_seed in (1, 2, 3):
        plain = breaks(grid, film_seed)
        assert sum(map(len, plain)) > 50
        assert breaks(replace(grid, vertices=grid.vertices + error), film_seed) == plain


def test_caps_do_not_heal() -> None:
    """A face near two cracks has the smaller of both caps, and drying tends to it."""
    film = make_film(zoo.make_ladder(12), fracture_shear_lag=0.8, **LAG)
    film.set_cohesion(0.001, (8, 9), (14, 15))
    assert film.fracture() == {(8, 9), (14, 15)}
    caps = np.minimum(*(unloaded_caps(film, rung, (), 0.8, 0.45) for rung in ((8, 9), (14, 15))))
    np.testing.assert_allclose(film.state.tension_cap, caps, atol=1e-14)
    film.parameters = replace(film.parameters, tension_rate=5.0)
    assert (film.tension(9.0) <= caps + 1e-14).all()


@pytest.mark.parametrize("seed", range(3))
def test_many_breaks_unload_one_after_another(seed: int) -> None:
    """Forty random breaks in a random sheet, against the plain flood after each."""
    film = make_film(make_random_sheet(faces=400, seed=seed + 1), fracture_shear_lag=0.08, **LAG)
    expected = np.ones(len(film.mesh.alive))
    inner = np.flatnonzero(film.mesh.twin > np.arange(len(film.mesh.twin)))
    agenda = film.agenda(1.0, 1.0)
    for h in np.random.default_rng(seed).permutation(inner)[:40]:
        ends = film.mesh.faces.reshape(-1)[h], film.mesh.faces[:, [1, 2, 0]].reshape(-1)[h]
        fresh = {v for v in ends if len(film.copies(v)) == 1 and not _is_open(film, v)}
        break_edge(film.mesh, film.state, film.rules, agenda, 1.0, int(h), film.log)
        expected = unloaded_caps(film, ends, tuple(fresh), 0.08, 0.45, expected)
    assert check_half_edges(film.mesh) == ""
    np.testing.assert_allclose(film.state.tension_cap, expected, atol=1e-13)


def _is_open(film: Film, vertex: int) -> bool:
    around = [h for h in range(len(film.mesh.tail)) if film.mesh.tail[h] == vertex]
    return any(film.mesh.twin[h] < 0 for h in around)


def test_an_overload_without_cohesion_is_without_bound() -> None:
    film = make_film(zoo.make_hinge(), cohesion_base=0.0)
    assert edge_overload(film.mesh, film.state, film.rules, film.half_edge(0, 1), 1.0, 1.0) == math.inf
    assert film.fracture() == {(0, 1)}


def test_no_tension_breaks_nothing() -> None:
    film = make_film(zoo.make_hinge(), cohesion_base=0.0, tension_initial=0.0)
    assert film.fracture() == set()
