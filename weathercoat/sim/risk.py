"""Risk: how near each vertex of a state is to separation, and each edge to fracture, if nothing else happens.

Between events all that decides ages by closed forms, the same that the agenda of failure looks ahead with.
Here they are followed to the step in which they fail: tension rises to its cap, adhesion and bonds fall, the
film stays where it is. An attached vertex round which nothing moves until then separates in that very step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.film.fracture import edge_overload, is_slack
from weathercoat.film.lift import lift_on
from weathercoat.film.state import FilmRules, FilmState, drying_tension, make_film_rules
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Indices, Vectors
from weathercoat.sim.simulation import Simulation

NEVER = -1  # in arrays of steps: not within the horizon
ATTACHED, SEPARATED, BARE = 0, 1, 2  # in `Risk.state`


@dataclass(frozen=True)
class Risk:
    """What threatens the film after `step` steps, at `age`; n0 rest vertices, in the order of the surface.

    horizon: steps that were looked ahead. ages: (horizon + 1,), the ages now and after each of them. state:
    uint8 (n0,), ATTACHED, SEPARATED or BARE. separation: (n0,), lift over adhesion now, above 1 where the
    vertex lets go; 0 where it has. separation_steps: int32 (n0,), steps until it separates, 0 where it has.

    edges: int32 (e, 2), the ends, as rest vertices, of the film's edges that are whole. fracture: (e,), the
    tension of their faces over their cohesion now, above 1 where they break once both ends have separated.
    fracture_steps: int32 (e,), steps until they break.
    """

    step: int
    age: float
    horizon: int
    ages: Vectors
    state: NDArray[np.uint8]
    separation: Vectors
    separation_steps: Indices
    edges: Indices
    fracture: Vectors
    fracture_steps: Indices

    def fracture_on_vertices(self) -> Vectors:
        """The largest ratio of the edges at each vertex, (n0,); 0 where there are none."""
        worst = np.zeros(len(self.state))
        for end in range(2):
            np.maximum.at(worst, self.edges[:, end], self.fracture)
        return worst

    def fracture_steps_on_vertices(self) -> Indices:
        """The fewest steps of the edges at each vertex, int32 (n0,)."""
        first = np.full(len(self.state), np.iinfo(np.int32).max, np.int32)
        known = self.fracture_steps != NEVER
        for end in range(2):
            np.minimum.at(first, self.edges[known, end], self.fracture_steps[known])
        first[first == np.iinfo(np.int32).max] = NEVER
        return first

    def scalars(self) -> dict[str, Vectors]:
        """All on the vertices, by the names of the properties in files: ratios, and steps with -1 for
        never.
        """
        return {
            "risk_separation": self.separation,
            "steps_to_separation": self.separation_steps.astype(np.float64),
            "risk_fracture": self.fracture_on_vertices(),
            "steps_to_fracture": self.fracture_steps_on_vertices().astype(np.float64),
        }


def assess_risk(simulation: Simulation, horizon: int | None = None) -> Risk:
    """The risk in the present state of a simulation, which stays as it is.

    horizon: how many steps to look ahead, by default as many as the run has in all.
    """
    mesh, film = simulation.mesh, simulation.film
    rules = make_film_rules(simulation.film_parameters)
    now = simulation.step_count
    horizon = simulation.steps if horizon is None else horizon
    ages = np.array([simulation.age_after(now + i) for i in range(horizon + 1)])
    rest_count = len(film.adhesion)
    live = np.repeat(mesh.alive, 3)
    here = np.arange(len(mesh.twin))
    whole = np.flatnonzero(live & (mesh.twin > here)).astype(np.int32)
    ends = np.stack([mesh.tail[whole], mesh.tail[mesh.twin[whole]]], axis=1)

    has_film = np.zeros(rest_count, np.bool_)
    has_film[mesh.origin[mesh.tail[live]]] = True
    attached = has_film & ~film.separated[:rest_count] & (mesh.half_edge[:rest_count] >= 0)
    state = np.where(attached, ATTACHED, np.where(has_film, SEPARATED, BARE)).astype(np.uint8)

    vertices = np.flatnonzero(attached).astype(np.int32)
    ratio, overload = np.zeros(rest_count), np.zeros(len(whole))
    held = np.empty(len(vertices))
    _ratios(mesh, film, rules, vertices, ages[0], held)
    ratio[vertices] = held
    _overloads(mesh, film, rules, whole, ages[0], overload)

    lets_go = np.full(len(vertices), NEVER, np.int32)
    breaks = np.full(len(whole), NEVER, np.int32)
    steering = simulation.steering
    if steering is not None and steering.is_keyed:
        for i in range(1, horizon + 1):
            steering.go_to(ages[i])
            _first_separations(mesh, film, rules, vertices, ages[i : i + 1], i, lets_go)
            _first_breaks(mesh, film, rules, whole, ages[i : i + 1], i, breaks)
        steering.go_to(ages[0])
    else:
        _first_separations(mesh, film, rules, vertices, ages[1:], 1, lets_go)
        _first_breaks(mesh, film, rules, whole, ages[1:], 1, breaks)
    separation_steps = np.zeros(rest_count, np.int32)
    separation_steps[vertices] = lets_go

    # an edge waits for both its ends; copies at cracks have all separated
    free_after = np.zeros(len(mesh.origin), np.int32)
    free_after[:rest_count] = np.where(attached, separation_steps, 0)
    free_after = np.where(film.separated, 0, free_after)
    waits = free_after[ends]
    steps = np.maximum(breaks, waits.max(axis=1))
    steps[(breaks == NEVER) | (waits == NEVER).any(axis=1)] = NEVER
    return Risk(
        step=now,
        age=float(ages[0]),
        horizon=horizon,
        ages=ages,
        state=state,
        separation=ratio,
        separation_steps=separation_steps,
        edges=mesh.origin[ends],
        fracture=overload,
        fracture_steps=steps.astype(np.int32),
    )


@kernel
def lift_and_hold(
    mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, v: int, age: float
) -> tuple[float, float]:
    """What lifts the attached vertex v at an age with the film as it lies now, and what holds it."""
    scale = rules.lift_coefficient
    if not rules.lifts_by_face:
        scale *= drying_tension(rules, age)
    if rules.lifts_by_face or state.disturbed[v]:
        lift = scale * lift_on(mesh, state, rules, v, age)
    else:
        lift = scale * (state.rest_lift[v] * state.lift_gain[v])
    return lift, max(state.adhesion[v] - state.adhesion_loss[v] * age, 0.0)


@kernel
def _ratios(
    mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, vertices: Indices, age: float, out: Vectors
) -> None:
    for i in range(len(vertices)):
        lift, held = lift_and_hold(mesh, state, rules, vertices[i], age)
        out[i] = lift / held if held > 0.0 else (np.inf if lift > 0.0 else 0.0)


@kernel
def _overloads(
    mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, edges: Indices, age: float, out: Vectors
) -> None:
    for i in range(len(edges)):
        slack = is_slack(mesh, state, rules, edges[i], age)
        out[i] = 0.0 if slack else edge_overload(mesh, state, rules, edges[i], age, age)


@kernel
def _first_separations(
    mesh: HalfEdgeMesh,
    state: FilmState,
    rules: FilmRules,
    vertices: Indices,
    ages: Vectors,
    first: int,
    out: Indices,
) -> None:
    """Note for vertices without a step the first of the ages, counted from `first`, at which they let go: as
    loads rise and bonds fall, by bisection.
    """
    for i in range(len(vertices)):
        if out[i] != NEVER:
            continue
        low, high = 0, len(ages)
        while low < high:
            middle = (low + high) // 2
            lift, held = lift_and_hold(mesh, state, rules, vertices[i], ages[middle])
            if lift > held:
                high = middle
            else:
                low = middle + 1
        if low < len(ages):
            out[i] = first + low


@kernel
def _first_breaks(
    mesh: HalfEdgeMesh,
    state: FilmState,
    rules: FilmRules,
    edges: Indices,
    ages: Vectors,
    first: int,
    out: Indices,
) -> None:
    """As `_first_separations`, of edges whose ends have separated."""
    for i in range(len(edges)):
        if out[i] != NEVER:
            continue
        low, high = 0, len(ages)
        while low < high:
            middle = (low + high) // 2
            age = ages[middle]
            overload = edge_overload(mesh, state, rules, edges[i], age, age)
            if overload > 1.0 and not is_slack(mesh, state, rules, edges[i], age):
                high = middle
            else:
                low = middle + 1
        if low < len(ages):
            out[i] = first + low
