"""Fracture: an edge between separated vertices breaks when its faces' tension exceeds its cohesion (paper
5.2).
"""

from __future__ import annotations

import math

import numpy as np

from weathercoat.compile import kernel
from weathercoat.film.state import (
    FilmParameters,
    FilmRules,
    FilmState,
    inherit_film,
    make_film_rules,
    tension_at,
)
from weathercoat.mesh.halfedge import EventLog, HalfEdgeMesh, cut_edge, prev_of
from weathercoat.mesh.surface import Indices, Vectors

_REACH = 3.0  # shear lags beyond which a crack no longer unloads the film: exp(-3) is 5 %
_EQUAL = 1e-9  # caps and overloads that differ by less are equal: on a grid last bits would decide


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
def tension_across(
    mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, f: int, a: int, b: int, age: float
) -> float:
    """Tension of face f now that pulls across the edge from a to b.

    A free edge unloads the film across itself but not along itself, so a crack beside another one stops while
    one that comes straight at it runs on into it. Without this the film between them never comes apart where
    edges are much shorter than the shear lag.
    """
    along = 0.0
    length = 0.0
    relieved = 0.0
    for axis in range(3):
        step = mesh.rest_positions[mesh.origin[b], axis] - mesh.rest_positions[mesh.origin[a], axis]
        along += state.relief[f, axis] * step
        length += step * step
        relieved += state.relief[f, axis] ** 2
    tension = state.tension_now[f]
    if relieved == 0.0 or length == 0.0:
        return tension
    full = tension_at(rules.tension_initial, 0.0, 1.0, rules.tension_rate, rules.saturating, age)
    return tension + max(full - tension, 0.0) * max(1.0 - along * along / length, 0.0)


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


@kernel
def rest_direction(mesh: HalfEdgeMesh, source: int, target: int, out: Vectors) -> None:
    """Unit vector at rest from one origin to another into out (3,); zero where they coincide."""
    length = 0.0
    for axis in range(3):
        out[axis] = mesh.rest_positions[target, axis] - mesh.rest_positions[source, axis]
        length += out[axis] ** 2
    if length > 0.0:
        out /= math.sqrt(length)


@kernel
def set_tension(state: FilmState, f: int, value: float, cap: float, age: float) -> None:
    """Start the tension of face f anew from a value at an age, tending to `cap`."""
    state.tension[f] = value
    state.tension_now[f] = value
    state.tension_age[f] = age
    state.tension_cap[f] = cap


@kernel
def unload_round_crack(
    mesh: HalfEdgeMesh,
    state: FilmState,
    rules: FilmRules,
    age: float,
    seed: int,
    start: int,
    end: int,
    tip_start: bool,
    tip_end: bool,
    stack: Indices,
) -> None:
    """Relax the film that hangs together with face `seed` beside a broken edge between the origins start and
    end.

    A free edge unloads the film beside it over the shear lag: caps fall to 1 - exp(-r / lambda) at the
    distance r, and tensions are clipped to them. What lies ahead of a tip, within alpha of its direction, is
    not unloaded: that is where the stress of a crack goes. A face that is as relaxed already is not crossed,
    since what lies behind it mostly is as well.
    """
    depth = 1
    stack[0] = seed
    while depth > 0:
        depth -= 1
        f = stack[depth]
        distance, along_start, along_end = place_by_edge(mesh, f, start, end)
        if distance > _REACH * rules.shear_lag and f != seed:
            continue
        if (tip_end and along_end > rules.direction_threshold) or (
            tip_start and along_start > rules.direction_threshold
        ):
            continue
        cap = 1.0 - math.exp(-distance / rules.shear_lag)
        if cap >= state.tension_cap[f] - _EQUAL:
            continue
        set_tension(state, f, min(state.tension_now[f], cap), cap, age)
        rest_direction(mesh, start, end, state.relief[f])
        for h in range(3 * f, 3 * f + 3):
            g = mesh.twin[h]
            if g >= 0:
                stack[depth] = g // 3
                depth += 1


@kernel
def place_by_edge(mesh: HalfEdgeMesh, f: int, start: int, end: int) -> tuple[float, float, float]:
    """Where the rest centre of face f lies from the edge between two origins.

    Returned: the distance to the edge, and for each end the cosine between the edge's outward direction there
    and the way from that end to the centre.
    """
    squared = 0.0
    along = 0.0
    to_start = 0.0
    to_end = 0.0
    for axis in range(3):
        a, b = mesh.rest_positions[start, axis], mesh.rest_positions[end, axis]
        centre = (
            mesh.rest_positions[mesh.faces[f, 0], axis]
            + mesh.rest_positions[mesh.faces[f, 1], axis]
            + mesh.rest_positions[mesh.faces[f, 2], axis]
        ) / 3.0
        squared += (b - a) ** 2
        along += (centre - a) * (b - a)
        to_start += (centre - a) ** 2
        to_end += (centre - b) ** 2
    length = math.sqrt(squared)
    if length == 0.0:
        return math.sqrt(to_start), 0.0, 0.0
    along /= length
    if along < 0.0:
        distance = math.sqrt(to_start)
    elif along > length:
        distance = math.sqrt(to_end)
    else:
        distance = math.sqrt(max(to_start - along * along, 0.0))
    cosine_start = -along / math.sqrt(to_start) if to_start > 0.0 else 0.0
    cosine_end = (along - length) / math.sqrt(to_end) if to_end > 0.0 else 0.0
    return distance, cosine_start, cosine_end
