"""Separation: a vertex lets go of the metal when the lift on it exceeds its adhesion (paper 5.1).

Where nothing round a vertex has moved, its lift is what it was at the start times the drying tension, and the
agenda says when that may exceed the adhesion. The fringe, round which something has moved, is looked at in
every step, with a bound on the lift first that needs no transcendental functions.
"""

from __future__ import annotations

from weathercoat.compile import kernel
from weathercoat.film.agenda import OUTSIDE, SLACK, STEP, Agenda, begin_step, call_edge
from weathercoat.film.calendar import HORIZON, put, take_due
from weathercoat.film.fringe import disturb_round, find_in_fringe
from weathercoat.film.state import FilmParameters, FilmRules, FilmState, drying_tension, make_film_rules
from weathercoat.mesh.halfedge import HalfEdgeMesh, next_of, prev_of
from weathercoat.mesh.surface import Indices


def separate(
    mesh: HalfEdgeMesh,
    state: FilmState,
    agenda: Agenda,
    parameters: FilmParameters,
    age: float,
    tick: float,
) -> Indices:
    """Begin a step at an age, a tick after the last one, and let the attached vertices go whose lift exceeds
    their adhesion; returns them ascending, int32 (k,).

    By default the film's drying tension lifts, not the face's own, since the relaxed one would leave the
    pieces round a crack on the metal for ever.
    """
    rules = make_film_rules(parameters)
    count = _separate(mesh, state, rules, agenda, age, tick)
    return agenda.found[:count].copy()


@kernel
def _separate(
    mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, agenda: Agenda, age: float, tick: float
) -> int:
    begin_step(mesh, state, rules, agenda, age, tick)
    found = find_due(mesh, state, rules, agenda, age, tick)
    found = find_in_fringe(mesh, state, rules, agenda, age, found)
    separating = agenda.found[:found]
    separating.sort()
    for v in separating:
        release_vertex(mesh, state, agenda, v, age)
    return found


@kernel
def find_due(
    mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, agenda: Agenda, age: float, tick: float
) -> int:
    """Collect in agenda.found the undisturbed vertices that separate at an age; returns how many.

    Film vertices that can be attached are the rest vertices themselves: copies at cracks have all separated.
    """
    out, step = agenda.found, agenda.counts[STEP]
    lift = rules.lift_coefficient * drying_tension(rules, age)
    found = 0
    for i in range(take_due(agenda.vertices, step, out)):
        v = out[i]
        if state.separated[v] or agenda.membership[v] != OUTSIDE or mesh.half_edge[v] < 0:
            continue
        held = max(state.adhesion[v] - state.adhesion_loss[v] * age, 0.0)
        if lift * (state.rest_lift[v] * state.lift_gain[v]) > held:
            out[found] = v
            found += 1
        else:
            ahead = HORIZON
            while ahead > 1 and not surely_holds(state, rules, v, age, age + ahead * tick):
                ahead //= 2
            put(agenda.vertices, v, step + ahead)
    return found


@kernel
def surely_holds(state: FilmState, rules: FilmRules, v: int, age: float, later: float) -> bool:
    """Whether vertex v cannot separate between two ages as long as nothing round it moves."""
    tension = max(drying_tension(rules, age), drying_tension(rules, later)) * (1.0 + SLACK) + SLACK
    least = state.adhesion[v] * (1.0 - SLACK) - state.adhesion_loss[v] * later
    return rules.lift_coefficient * tension * state.rest_lift[v] * state.lift_gain[v] <= least


@kernel
def release_vertex(mesh: HalfEdgeMesh, state: FilmState, agenda: Agenda, v: int, age: float) -> None:
    """Let vertex v go: its edges to separated vertices may break from now on, and whose lift depends on it
    joins the fringe.
    """
    tail, twin, separated, first = mesh.tail, mesh.twin, state.separated, mesh.half_edge[v]
    edges, attached_corners, step = agenda.edges, agenda.attached_corners, agenda.counts[STEP]
    separated[v] = True
    state.separation_age[v] = age
    leaving = first
    while leaving >= 0:
        attached_corners[leaving // 3] -= 1
        if separated[tail[next_of(leaving)]]:
            call_edge(edges, twin, leaving, step)
        leaving = twin[prev_of(leaving)]
        if leaving == first:
            break
    disturb_round(
        first, tail, twin, separated, state.disturbed, agenda.fringe, agenda.membership, agenda.counts
    )
