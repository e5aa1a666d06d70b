"""Fracture: an edge between separated vertices breaks when its faces' tension exceeds its cohesion (paper
5.2).
"""

from __future__ import annotations

import math

import numpy as np

from weathercoat.compile import kernel
from weathercoat.film.agenda import STEP, Agenda, call_edge, join_fringe
from weathercoat.film.calendar import HORIZON, put, take_due
from weathercoat.film.fringe import disturb_round
from weathercoat.film.relaxation import (
    relax_face,
    rest_direction,
    tension_across,
    tension_until,
    unload_round_crack,
)
from weathercoat.film.state import (
    FilmParameters,
    FilmRules,
    FilmState,
    face_tension,
    inherit_film,
    make_film_rules,
)
from weathercoat.mesh.halfedge import EventLog, HalfEdgeMesh, cut_edge, prev_of
from weathercoat.mesh.surface import Vectors

_EQUAL = 1e-9  # overloads that differ by less are equal: on a grid last bits would decide


def fracture(
    mesh: HalfEdgeMesh,
    state: FilmState,
    agenda: Agenda,
    parameters: FilmParameters,
    age: float,
    tick: float,
    log: EventLog,
) -> None:
    """Break what is overloaded at an age, in as many rounds as cracks run edges in a tick; appends to the
    log.

    The most overloaded edges break first; each is tested again before it breaks, since every break relaxes
    what is round it. What a break makes critical comes in the next round, so that neither the mesh nor the
    number of steps sets the speed of a crack. Comes after `separate` in a step.
    """
    _fracture(mesh, state, make_film_rules(parameters), agenda, age, tick, log)


@kernel
def _fracture(
    mesh: HalfEdgeMesh,
    state: FilmState,
    rules: FilmRules,
    agenda: Agenda,
    age: float,
    tick: float,
    log: EventLog,
) -> None:
    rounds = 1
    if rules.crack_speed < math.inf:
        state.crack_budget[0] += rules.crack_speed * tick / state.mean_edge
        rounds = int(state.crack_budget[0])
        state.crack_budget[0] -= rounds
    first_break = log.counts[1]
    for number in range(rounds):
        if number == 0:
            found = find_overloaded(mesh, state, rules, agenda, age, tick)
        else:
            found = find_overloaded_at_tips(mesh, state, rules, agenda, age, log, first_break)
        if found == 0:
            return
        sort_by_overload(state, agenda, found)
        first_break = log.counts[1]
        break_in_order(mesh, state, rules, agenda, age, found, log)


@kernel
def edge_overload(
    mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, h: int, age: float, later: float
) -> float:
    """Tension of the two faces of an inner edge over its cohesion at an age, the direction factor included.

    Where an end is a tip and the way from it to the other end goes on in the tip's direction (dot product at
    least alpha, on the rest surface), the cohesion counts beta times, once, and of the tensions counts what
    pulls across the edge. With a `later` age that is later: no less than the overload is at any time between,
    as far as no event comes in.
    """
    g = mesh.twin[h]
    a, b = mesh.tail[h], mesh.tail[g]
    bond = min(cohesion_at(state, rules, h, later), cohesion_at(state, rules, g, later))
    if leads_on(mesh, state, rules, a, b) or leads_on(mesh, state, rules, b, a):
        bond *= rules.direction_factor
        load = state.stress[h // 3] * tension_across(mesh, state, rules, h // 3, a, b, age, later)
        load += state.stress[g // 3] * tension_across(mesh, state, rules, g // 3, a, b, age, later)
    else:
        load = state.stress[h // 3] * tension_until(state, rules, h // 3, age, later)
        load += state.stress[g // 3] * tension_until(state, rules, g // 3, age, later)
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
    mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, agenda: Agenda, age: float, tick: float
) -> int:
    """Collect in agenda.found the edges that break at an age, by their smaller half-edge ascending, with
    their overload in agenda.values; returns how many.
    """
    edges, step = agenda.found, agenda.counts[STEP]
    due = edges[: take_due(agenda.edges, step, edges)]
    due.sort()
    found = 0
    for h in due:
        g = mesh.twin[h]
        if g < 0 or not (state.separated[mesh.tail[h]] and state.separated[mesh.tail[g]]):
            continue
        overload = edge_overload(mesh, state, rules, h, age, age)
        ahead = 1
        if overload > 1.0 and not is_slack(mesh, state, rules, h, age):
            edges[found] = h
            agenda.values[found] = overload
            found += 1
        elif overload <= 1.0:
            ahead = HORIZON
            while ahead > 1 and edge_overload(mesh, state, rules, h, age, age + ahead * tick) > 1.0:
                ahead //= 2
        put(agenda.edges, h, step + ahead)
    return found


@kernel
def is_slack(mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, h: int, age: float) -> bool:
    """Whether nothing pulls on an inner edge away from tips: it holds then even without any cohesion."""
    g = mesh.twin[h]
    if state.is_tip[mesh.tail[h]] or state.is_tip[mesh.tail[g]]:
        return False
    load = state.stress[h // 3] * face_tension(state, rules, h // 3, age)
    return load + state.stress[g // 3] * face_tension(state, rules, g // 3, age) <= 0.0


@kernel
def find_overloaded_at_tips(
    mesh: HalfEdgeMesh,
    state: FilmState,
    rules: FilmRules,
    agenda: Agenda,
    age: float,
    log: EventLog,
    first_break: int,
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
                    overload = edge_overload(mesh, state, rules, leaving, age, age)
                    if overload > 1.0:
                        agenda.found[found] = min(leaving, g)
                        agenda.values[found] = overload
                        found += 1
                leaving = mesh.twin[prev_of(leaving)]
    return found


@kernel
def sort_by_overload(state: FilmState, agenda: Agenda, count: int) -> None:
    """Bring the first `count` edges in agenda.found into the order in which they break: by overload, the
    largest first, and equals by their hash.
    """
    edges = agenda.found[:count]
    if count == 1:
        return
    rank = -np.rint(agenda.values[:count] / _EQUAL)
    by_tie = np.argsort(state.tie[edges], kind="mergesort")
    edges[:] = edges[by_tie][np.argsort(rank[by_tie], kind="mergesort")]


@kernel
def break_in_order(
    mesh: HalfEdgeMesh,
    state: FilmState,
    rules: FilmRules,
    agenda: Agenda,
    age: float,
    count: int,
    log: EventLog,
) -> None:
    """Break the first `count` edges in agenda.found one after another, each where it is still overloaded."""
    for h in agenda.found[:count]:
        if mesh.twin[h] >= 0 and edge_overload(mesh, state, rules, h, age, age) > 1.0:
            break_edge(mesh, state, rules, agenda, age, h, log)


@kernel
def break_edge(
    mesh: HalfEdgeMesh,
    state: FilmState,
    rules: FilmRules,
    agenda: Agenda,
    age: float,
    h: int,
    log: EventLog,
) -> None:
    """Break the edge of half-edge h: part its faces, make tips or copies at its ends, relax the film round
    it.
    """
    g = mesh.twin[h]
    start, end = mesh.tail[h], mesh.tail[g]
    origins = mesh.origin[start], mesh.origin[end]
    first_split = log.counts[0]
    from_start = leads_on(mesh, state, rules, start, end)
    from_end = leads_on(mesh, state, rules, end, start)
    tip_start, tip_end = cut_edge(mesh, log, h)
    inherit_film(state, log, first_split)
    if tip_start:
        make_tip(mesh, state, rules, agenda, start, origins[1], end if from_end else -1)
    if tip_end:
        make_tip(mesh, state, rules, agenda, end, origins[0], start if from_start else -1)
    call_hinges(mesh, state, agenda, h, g, log, first_split)
    for turn in range(2):
        side = h if turn == 0 else g
        fray(mesh, state, agenda, side // 3, age)
        if rules.shear_lag > 0.0:
            unload_round_crack(
                mesh, state, rules, agenda, age, side, origins[0], origins[1], tip_start, tip_end
            )
        else:
            relax_face(state, rules, side // 3, age)


@kernel
def call_hinges(
    mesh: HalfEdgeMesh, state: FilmState, agenda: Agenda, h: int, g: int, log: EventLog, first_split: int
) -> None:
    """Have the vertices of the fringe packed anew that are opposite to the broken edge of h and g, or whose
    hinges have a corner that the log's splits from `first_split` on have replaced.
    """
    tail, twin, half_edge, separated = mesh.tail, mesh.twin, mesh.half_edge, state.separated
    fringe, membership, counts = agenda.fringe, agenda.membership, agenda.counts
    for apex in (tail[prev_of(h)], tail[prev_of(g)]):
        if not separated[apex]:
            join_fringe(apex, fringe, membership, counts)
    for i in range(first_split, log.counts[0]):
        disturb_round(
            half_edge[log.splits[i, 0]], tail, twin, separated, state.disturbed, fringe, membership, counts
        )


@kernel
def make_tip(
    mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, agenda: Agenda, v: int, source: int, before: int
) -> None:
    """Make vertex v the tip of a crack that comes from the origin `source`; before: the vertex that was its
    tip up to now, -1 for a new crack.
    """
    edges, twin, step = agenda.edges, mesh.twin, agenda.counts[STEP]
    state.is_tip[v] = True
    direction = state.crack_direction[v]
    length = rest_direction(mesh, source, mesh.origin[v], direction)
    if before >= 0 and rules.turning_length > 0.0:
        turn_from(state.crack_direction[before], length / rules.turning_length, direction)
    leaving = mesh.half_edge[v]
    while leaving >= 0:
        call_edge(edges, twin, leaving, step + 1)
        leaving = twin[prev_of(leaving)]


@kernel
def turn_from(old: Vectors, way: float, direction: Vectors) -> None:
    """Let the unit vector `direction` of a crack's last edge be that of the crack, which was `old` before it;
    way: how long the edge is, in turning lengths.

    A crack that forgot its direction at each edge would be a random walk of the mesh's step: it closes on
    itself within a few edges, and the flakes are as small as the mesh allows.
    """
    kept = math.exp(-way)
    squared = 0.0
    for axis in range(3):
        direction[axis] = kept * old[axis] + (1.0 - kept) * direction[axis]
        squared += direction[axis] * direction[axis]
    if squared > 0.0:
        direction /= math.sqrt(squared)


@kernel
def fray(mesh: HalfEdgeMesh, state: FilmState, agenda: Agenda, f: int, age: float) -> None:
    """Let the cohesion of face f fall from an age on, if it does not already."""
    if age < state.fray_age[f]:
        state.fray_age[f] = age
        for h in range(3 * f, 3 * f + 3):
            call_edge(agenda.edges, mesh.twin, h, agenda.counts[STEP] + 1)
