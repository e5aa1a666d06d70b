"""Runoff: sources at cracks, streaks that run down a film, and the plain version that it must equal."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests import zoo
from tests.sim.runs import LITERAL_CURL, LITERAL_FILM, make_run
from tests.stain import plain
from tests.zoo import make_mesh
from weathercoat.mesh.halfedge import HalfEdgeMesh, cut_edge, make_event_log
from weathercoat.mesh.shapes import make_box, make_bracket, make_curved_plate, make_sphere
from weathercoat.mesh.surface import Surface, Vectors
from weathercoat.stain.runoff import follow_events, make_runoff, run_off
from weathercoat.stain.rust import RustState, StainParameters, make_rust_state

STAIN = StainParameters(
    rust_threshold=0.1,
    rust_source_rate=3.0,
    rust_source_cap=0.9,
    rust_runoff_speed=4.0,
    rust_runoff_length=3.0,
    rust_alignment=0.7,
    rust_side_share=0.001,
)
HEXAGON = zoo.make_hexagon(3)
UP_X, UP_Y, UP_Z = np.eye(3)


def at(x: float, y: float = 0.0) -> int:
    return zoo.vertex_at(HEXAGON, x, y)


# --- sources ---


def sources_after(edges: list[tuple[int, int]], up: Vectors) -> tuple[HalfEdgeMesh, RustState]:
    mesh, log = make_mesh(HEXAGON), make_event_log(len(HEXAGON.faces))
    rust = make_rust_state(mesh)
    for a, b in edges:
        cut_edge(mesh, log, zoo.find_edge(mesh, a, b))
    follow_events(mesh, rust, make_runoff(mesh, rust, STAIN, up), log)
    return mesh, rust


def source_origins(mesh: HalfEdgeMesh, rust: RustState) -> list[int]:
    return sorted(int(mesh.origin[v]) for v in np.flatnonzero(rust.source[: mesh.vertex_count]))


@pytest.mark.parametrize(("up", "lowest"), [(UP_X, [0.0]), (-UP_X, [1.0]), (UP_Y, [])])
def test_the_lower_end_of_a_crack_is_a_source(up: Vectors, lowest: list[float]) -> None:
    """A slit from 0 to 1 on the x axis: upright, its lower end; level, none is lower than the other."""
    mesh, rust = sources_after([(at(0), at(1))], up)
    assert source_origins(mesh, rust) == [at(x) for x in lowest]


def test_only_the_lowest_of_a_straight_crack_is_a_source() -> None:
    edges = [(at(x), at(x + 1)) for x in (-1, 0, 1)]
    mesh, rust = sources_after(edges, UP_X)
    assert source_origins(mesh, rust) == [at(-1)]


def test_a_hollow_of_the_outline_is_a_source_on_both_sides() -> None:
    """A V whose point is vertex 0: both fans there lie lower than their neighbours; the V's ends do not."""
    left, right = at(-0.5, zoo.HALF_ROOT_3), at(0.5, zoo.HALF_ROOT_3)
    mesh, rust = sources_after([(at(0), left), (at(0), right)], UP_Y)
    assert source_origins(mesh, rust) == [at(0), at(0)]
    mesh, rust = sources_after([(at(0), left), (at(0), right)], -UP_Y)
    assert source_origins(mesh, rust) == sorted([left, right])


def test_copies_inherit_rust_and_source() -> None:
    mesh, log = make_mesh(HEXAGON), make_event_log(len(HEXAGON.faces))
    rust = make_rust_state(mesh)
    rust.film[at(0)], rust.source[at(0)] = 0.4, True
    runoff = make_runoff(mesh, rust, STAIN, UP_Y)
    for end in (at(1), at(-1)):
        cut_edge(mesh, log, zoo.find_edge(mesh, at(0), end))
    (new,) = log.split_entries()[:, 0]
    follow_events(mesh, rust, runoff, log)
    assert rust.film[new] == 0.4 and rust.source[new]


# --- runoff ---


def run(
    surface: Surface,
    sources: list[int],
    up: Vectors,
    *,
    age: float,
    steps: int,
    parameters: StainParameters = STAIN,
) -> Vectors:
    """Runoff rust of the vertices after an age in a number of steps, from sources that are there at once."""
    mesh = make_mesh(surface)
    rust = make_rust_state(mesh)
    rust.source[sources] = True
    runoff = make_runoff(mesh, rust, parameters, up)
    for _ in range(steps):
        run_off(mesh, rust, runoff, age / steps)
    assert (rust.film >= 0).all() and (rust.film <= parameters.rust_source_cap).all()
    return rust.film[: mesh.vertex_count].copy()


STRIP = zoo.make_ladder(
    9, length=0.5, width=2.0
)  # hung up by its end at x = 0: diagonals are far from downhill


@pytest.mark.parametrize("steps", [1, 7, 100])
def test_a_source_grows_to_its_cap_by_the_closed_form(steps: int) -> None:
    """cap (1 - exp(-rate t)), whatever the number of steps; nothing is above it to pass rust on."""
    film = run(STRIP, [0], -UP_X, age=0.7, steps=steps)
    assert film[0] == pytest.approx(0.9 * (1 - np.exp(-3 * 0.7)), rel=1e-13)


def test_a_streak_fades_over_its_length() -> None:
    """In the steady state a vertex has exp(-s / length) of the source s above it, as long as more than a
    tenth comes.

    Rates of 3 and 4 / 0.5 over an age of 20 leave exp(-60) and less of the way.
    """
    film = run(STRIP, [0], -UP_X, age=20.0, steps=2000)
    expected = 0.9 * np.exp(-0.5 * np.arange(9) / 3.0)
    np.testing.assert_allclose(film[0::2], expected, rtol=1e-9)
    short = run(STRIP, [0], -UP_X, age=20.0, steps=2000, parameters=replace(STAIN, rust_runoff_length=0.6))
    reached = 0.9 * np.exp(-0.5 * np.arange(9) / 0.6)
    last = int(np.flatnonzero(reached <= 0.1)[0])
    np.testing.assert_allclose(short[0 : 2 * last + 1 : 2], reached[: last + 1], rtol=1e-9)
    assert (short[2 * last + 2 :: 2] == 0.0).all(), "what is below a tenth runs no further"


def test_rust_does_not_run_up_or_across() -> None:
    """From the middle of the left side: nothing above it, nothing on the other side of the strip."""
    film = run(STRIP, [8], -UP_X, age=5.0, steps=500)
    assert (film[:8] == 0.0).all()
    assert (film[1::2] == 0.0).all()
    assert (film[8::2] > 0.1).all()


def test_level_surfaces_hold_their_rust() -> None:
    film = run(STRIP, [8], UP_Z, age=5.0, steps=50)
    assert np.flatnonzero(film).tolist() == [8]


@pytest.mark.parametrize("speed", [1.0, 2.0])
def test_a_streak_has_a_speed(speed: float) -> None:
    """Twice the speed of run-off and source reaches as far in half the age: time enters by rate . t."""
    slow = run(STRIP, [0], -UP_X, age=1.0, steps=100)
    changed = replace(STAIN, rust_runoff_speed=4.0 * speed, rust_source_rate=3.0 * speed)
    np.testing.assert_allclose(
        run(STRIP, [0], -UP_X, age=1.0 / speed, steps=100, parameters=changed), slow, rtol=1e-12
    )


def test_the_number_of_steps_is_a_resolution() -> None:
    """First order in the tick: the error against 6,400 steps falls like 1 / N, and is below 0.015 of 1 at 100
    steps.
    """
    exact = run(STRIP, [0], -UP_X, age=1.0, steps=6400)
    errors = [np.abs(run(STRIP, [0], -UP_X, age=1.0, steps=n) - exact).max() for n in (50, 100, 200, 400)]
    assert errors[1] < 0.015
    for coarse, fine in pairwise(errors):
        assert fine < 0.7 * coarse


@pytest.mark.parametrize("seed", range(3))
def test_the_numbering_has_no_part_in_it(seed: int) -> None:
    """A direction in which no two vertices are level, so that the order of heights is that of the shape."""
    up = np.array([0.83, 0.55, 0.11])
    up /= np.linalg.norm(up)
    surface = zoo.renumber(HEXAGON, seed)
    back = [int(np.flatnonzero((surface.vertices == place).all(axis=1))[0]) for place in HEXAGON.vertices]
    top = at(1, 0)
    plain = run(HEXAGON, [top], up, age=2.0, steps=50)
    other = run(surface, [back[top]], up, age=2.0, steps=50)
    np.testing.assert_allclose(other[back], plain, atol=1e-15)
    assert (plain > 0.1).sum() >= 3


def test_last_bits_do_not_decide_where_rust_runs() -> None:
    """On a lattice much is level and much equally steep; errors of 1e-14 in the positions must not choose."""
    plain = run(HEXAGON, [at(-1), at(0), at(1)], UP_Y, age=2.0, steps=50)
    for seed in range(5):
        error = np.random.default_rng(seed).uniform(-1e-14, 1e-14, HEXAGON.vertices.shape)
        moved = replace(HEXAGON, vertices=HEXAGON.vertices + error)
        film = run(moved, [at(-1), at(0), at(1)], UP_Y, age=2.0, steps=50)
        np.testing.assert_allclose(film, plain, atol=1e-10)


@pytest.mark.parametrize("seed", range(5))
def test_last_bits_do_not_make_sources(seed: int) -> None:
    """A level slit has no lower end, however its ends round."""
    error = np.random.default_rng(seed).uniform(-1e-14, 1e-14, HEXAGON.vertices.shape)
    mesh, log = (
        make_mesh(replace(HEXAGON, vertices=HEXAGON.vertices + error)),
        make_event_log(len(HEXAGON.faces)),
    )
    rust = make_rust_state(mesh)
    cut_edge(mesh, log, zoo.find_edge(mesh, at(0), at(1)))
    follow_events(mesh, rust, make_runoff(mesh, rust, STAIN, UP_Y), log)
    assert not rust.source.any()


def test_side_neighbours_get_a_small_share() -> None:
    """Straight down in the lattice two ways are equally good (30 degrees off): one takes over."""
    film = run(HEXAGON, [at(0)], UP_Y, age=0.01, steps=1, parameters=replace(STAIN, rust_source_rate=1e9))
    below = sorted(film[[at(-0.5, -zoo.HALF_ROOT_3), at(0.5, -zoo.HALF_ROOT_3)]])
    taken = 0.9 * np.exp(-1 / 3.0) * (1 - np.exp(-4.0 * 0.01))
    assert below == pytest.approx([0.001 * taken, taken], rel=1e-12)
    assert np.count_nonzero(film) == 3


def test_a_crack_stops_a_streak() -> None:
    """A film that is cut across below the source: rust stays on the piece above."""
    mesh, log = make_mesh(STRIP), make_event_log(len(STRIP.faces))
    cut_edge(mesh, log, zoo.find_edge(mesh, 8, 9))
    rust = make_rust_state(mesh)
    rust.source[0] = True
    runoff = make_runoff(mesh, rust, STAIN, -UP_X)
    for _ in range(400):
        run_off(mesh, rust, runoff, 0.05)
    rusty = np.flatnonzero(rust.film > 0)
    assert (mesh.rest_positions[mesh.origin[rusty], 0] <= 2.0).all()
    assert rust.film[mesh.origin == 8].max() > 0.1


def test_no_rust_no_work() -> None:
    assert (run(HEXAGON, [], UP_Y, age=1.0, steps=3) == 0.0).all()


# --- the plain version ---

SHAPES = {
    "sphere": make_sphere(subdivisions=2),
    "bracket": make_bracket(bend=0.2, thickness=0.12, hole=0.05, edge_length=0.14),
    "curved plate": make_curved_plate(columns=14, rows=14),
    "box": make_box(cells=5),
}
STAINS = {
    "default": {},
    "fast": {"rust_runoff_speed": 30.0, "rust_source_rate": 30.0, "rust_side_share": 0.3},
    "wide": {"rust_alignment": 0.0, "rust_threshold": 0.0, "rust_runoff_length": 1.0},
}
RULES = {"default": ({}, {}), "literal": (LITERAL_FILM, LITERAL_CURL)}


@pytest.mark.compiled
@pytest.mark.parametrize("rules", RULES)
@pytest.mark.parametrize("stains", STAINS)
@pytest.mark.parametrize("name", SHAPES)
def test_runoff_equals_the_plain_version_bit_for_bit(name: str, stains: str, rules: str) -> None:
    """Through runs with cracks and flakes, in steps of two lengths, and made anew on the way."""
    film, curl = RULES[rules]
    run = make_run(SHAPES[name], steps=60, film=film, curl=curl, stain=STAINS[stains], seed=len(name))
    expected = make_rust_state(run.mesh)
    most = 0
    for step in range(run.steps):
        count = 1 + step // 20 % 2
        if step % 7 == 3:
            run.runoff = make_runoff(run.mesh, run.rust, run.stain_parameters, UP_Z)
        run.step(count)
        plain.follow_events(run.mesh, expected.film, expected.source, run.log, UP_Z)
        most = max(
            most,
            plain.stain(run.mesh, expected, run.stain_parameters, UP_Z, count * run.duration / run.steps),
        )
        used = run.mesh.vertex_count
        np.testing.assert_array_equal(run.rust.film[:used], expected.film[:used])
        np.testing.assert_array_equal(run.rust.source[:used], expected.source[:used])
    assert most > 10, "hardly any rust ran"


@pytest.mark.compiled
@pytest.mark.parametrize("seed", range(3))
def test_any_order_of_newcomers_is_sorted(seed: int) -> None:
    """Many start at once, and in one tick many more: the order and the lists have to grow."""
    rng = np.random.default_rng(seed)
    mesh = make_mesh(make_sphere(subdivisions=4))
    rust = make_rust_state(mesh)
    expected = make_rust_state(mesh)
    parameters = replace(STAIN, rust_runoff_speed=1e3, rust_alignment=0.2, rust_side_share=0.5)
    rust.film[: mesh.vertex_count] = expected.film[: mesh.vertex_count] = np.where(
        rng.random(mesh.vertex_count) < 0.5, rng.random(mesh.vertex_count), 0.0
    )
    runoff = make_runoff(mesh, rust, parameters, UP_Z)
    for _ in range(20):
        run_off(mesh, rust, runoff, 0.1)
        plain.stain(mesh, expected, parameters, UP_Z, 0.1)
        np.testing.assert_array_equal(rust.film, expected.film)
