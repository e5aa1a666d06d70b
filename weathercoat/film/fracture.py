"""Fracture: an edge between separated vertices breaks when its faces' tension exceeds its cohesion (paper
5.2).
"""

from __future__ import annotations

import math

import numpy as np

from weathercoat.compile import kernel
from weathercoat.film.relaxation import rest_direction, set_tension, tension_across, unload_round_crack
from weathercoat.film.state import (
    FilmParameters,
    FilmRules,
    FilmState,
    inherit_film,
    make_film_rules,
)
from weathercoat.mesh.halfedge import EventLog, HalfEdgeMesh, cut_edge, prev_of
from weathercoat.mesh.surface import Indices, Vectors

_EQUAL = 1e-9  # overloads that differ by less are equal: on a grid last bits would decide


def fracture(
    mesh: HalfEdgeMesh,
    state: FilmState,
    parameters: FilmParameters,
    age: float,
    duration: float,
    log: EventLog,
) -> None:
    """Break what is overloaded at an age, in as many rounds as cracks run edges in `duration`; appends to the
    log.

    The most overloaded edges break first; each is tested again before it breaks, since every break relaxes
    what is round it. What a break makes critical comes in the next round, so that neither the mesh nor the
    number of steps sets the speed of a crack. Tensions must have been evaluated at this age.
    """
    rules = make_film_rules(parameters)
    rounds = 1
    if parameters.fracture_rounds == "by_speed":
        state.crack_budget[0] += parameters.fracture_speed * duration / state.mean_edge
        rounds = int(state.crack_budget[0])
        state.crack_budget[0] -= rounds
    overload = np.empty(len(mesh.twin))
    candidates = np.empty(len(mesh.twin), np.int32)
    stack = np.empty(len(mesh.twin), np.int32)
    first_break = int(log.counts[1])
    for number in range(rounds):
        if number == 0:
            found = find_overloaded(mesh, state, rules, age, candidates, overload)
        else:
            found = find_overloaded_at_tips(mesh, state, rules, age, log, first_break, candidates, overload)
        if found == 0:
            return
        order = np.lexsort((state.tie[candidates[:found]], -np.round(overload[:found] / _EQUAL)))
        first_break = int(log.counts[1])
        break_in_order(mesh, state, rules, age, candidates[:found][order], log, stack)


@kernel
def edge_overload(mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, h: int, age: float) -> float:
    """Tension of the two faces of an inner edge over its cohesion now, the direction factor included.

    Where an end is a tip and the way from it to the other end goes on in the tip's direction (dot product at
    least alpha, on the rest surface), the cohesion counts beta times, once, and of the tensions counts what
    pulls across the edge.
    """
    g = mesh.twin[h]
    a, b = mesh.tail[h], mesh.tail[g]
    bond = min(cohesion_at(state, rules, h, age), cohesion_at(state, rules, g, age))
    if leads_on(mesh, state, rules, a, b) or leads_on(mesh, state, rules, b, a):
        bond *= rules.direction_factor
        load = tension_across(mesh, state, rules, h // 3, a, b, age)
        load += tension_across(mesh, state, rules, g // 3, a, b, age)
    else:
        load = state.tension_now[h // 3] + state.tension_now[g // 3]
    return load / bond if bond > 0.0 else math.inf


@kernel
def cohesion_at(state: FilmState, rules: FilmRules, h: int, age: float) -> float:
    """Cohesion of a half-edge at an age: it falls for ever once an edge of its face has broken."""
    fray_age = state.fray_age[h // 3]
    if fray_age < age:
        return state.cohesion[h] * math.exp(-rules.cohesion_decay_rate * (age - fray_age))
    return state.cohesion[h]


@kernel
def leads_on(mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, tip: int, other: int) -> bool:
    """Whether the edge from `tip` to `other` continues the crack that ends in `tip`; false where it is no
    tip.
    """
    if not state.is_tip[tip]:
        return False
    dot = 0.0
    length = 0.0
    for axis in range(3):
        step = mesh.rest_positions[mesh.origin[other], axis] - mesh.rest_positions[mesh.origin[tip], axis]
        dot += state.crack_direction[tip, axis] * step
        length += step * step
    return dot >= rules.direction_threshold * math.sqrt(length)


@kernel
def find_overloaded(
    mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, age: float, candidates: Indices, overload: Vectors
) -> int:
    """Collect the edges that break at an age, by their smaller half-edge, with their overload; returns how
    many.
    """
    tail, twin, separated, is_tip = mesh.tail, mesh.twin, state.separated, state.is_tip
    tension, cohesion, fray_age = state.tension_now, state.cohesion, state.fray_age
    most_frayed = math.exp(-rules.cohesion_decay_rate * age)
    found = 0
    for h in range(len(twin)):
        g = twin[h]
        if g < h:
            continue
        a, b = tail[h], tail[g]
        if not (separated[a] and separated[b]):
            continue
        # what the edge cannot fall below is cheap to know, and settles most edges
        least = min(cohesion[h], cohesion[g])
        if fray_age[h // 3] < age or fray_age[g // 3] < age:
            least *= most_frayed
        if tension[h // 3] + tension[g // 3] <= least and not (is_tip[a] or is_tip[b]):
            continue
        load = edge_overload(mesh, state, rules, h, age)
        if load > 1.0:
            candidates[found] = h
            overload[found] = load
            found += 1
    return found


@kernel
def find_overloaded_at_tips(
    mesh: HalfEdgeMesh,
    state: FilmState,
    rules: FilmRules,
    age: float,
    log: EventLog,
    first_break: int,
    candidates: Indices,
    overload: Vectors,
) -> int:
    """As `find_overloaded`, of the edges at the tips that the log's breaks from `first_break` on have made.

    Within a step tensions only fall and cohesion stays, so no other edge can have become overloaded. An edge
    between two tips is found at both.
    """
    found = 0
    for i in range(first_break, log.counts[1]):
        for side in range(2):
            tip = mesh.tail[log.breaks[i, side]]
            if not state.is_tip[tip]:
                continue
            leaving = mesh.half_edge[tip]
            while leaving >= 0:
                g = mesh.twin[leaving]
                if g >= 0 and state.separated[mesh.tail[g]]:
                    load = edge_overload(mesh, state, rules, leaving, age)
                    if load > 1.0:
                        candidates[found] = min(leaving, g)
                        overload[found] = load
                        found += 1
                leaving = mesh.twin[prev_of(leaving)]
    return found


@kernel
def break_in_order(
    mesh: HalfEdgeMesh,
    state: FilmState,
    rules: FilmRules,
    age: float,
    half_edges: Indices,
    log: EventLog,
    stack: Indices,
) -> None:
    """Break the edges one after another, each where it is still overloaded."""
    for h in half_edges:
        if mesh.twin[h] >= 0 and edge_overload(mesh, state, rules, h, age) > 1.0:
            break_edge(mesh, state, rules, age, h, log, stack)


@kernel
def break_edge(
    mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, age: float, h: int, log: EventLog, stack: Indices
) -> None:
    """Break the edge of half-edge h: part its faces, make tips or copies at its ends, relax the film round
    it.
    """
    g = mesh.twin[h]
    start, end = mesh.tail[h], mesh.tail[g]
    origins = mesh.origin[start], mesh.origin[end]
    first_split = log.counts[0]
    tip_start, tip_end = cut_edge(mesh, log, h)
    inherit_film(state, log, first_split)
    if tip_start:
        state.is_tip[start] = True
        rest_direction(mesh, origins[1], origins[0], state.crack_direction[start])
    if tip_end:
        state.is_tip[end] = True
        rest_direction(mesh, origins[0], origins[1], state.crack_direction[end])
    for side in range(2):
        f = h // 3 if side == 0 else g // 3
        state.fray_age[f] = min(state.fray_age[f], age)
        if rules.shear_lag > 0.0:
            unload_round_crack(mesh, state, rules, age, f, origins[0], origins[1], tip_start, tip_end, stack)
        else:
            set_tension(state, f, rules.face_factor * state.tension_now[f], state.tension_cap[f], age)
