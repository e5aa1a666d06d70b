"""Relaxation: how a broken edge unloads the film beside it, and what tension is left across another edge."""

from __future__ import annotations

import math

from weathercoat.compile import kernel
from weathercoat.film.agenda import SLACK, STEP, Agenda, call_edge
from weathercoat.film.state import FilmRules, FilmState, drying_tension, face_tension, tension_of
from weathercoat.mesh.halfedge import HalfEdgeMesh, prev_of
from weathercoat.mesh.surface import Vectors

_REACH = 3.0  # shear lags beyond which a crack no longer unloads the film: exp(-3) is 5 %
_EQUAL = 1e-9  # caps that differ by less are equal: on a grid last bits would decide


@kernel
def unload_round_crack(
    mesh: HalfEdgeMesh,
    state: FilmState,
    rules: FilmRules,
    agenda: Agenda,
    age: float,
    seed: int,
    start: int,
    end: int,
    tip_start: bool,
    tip_end: bool,
) -> None:
    """Relax the film that hangs together with the face of half-edge `seed`, beside a broken edge between the
    origins start and end.

    A free edge unloads the film beside it over the shear lag: caps fall to 1 - exp(-r / lambda) at the
    distance r, and tensions are clipped to them. What lies ahead of a tip, within alpha of its direction, is
    not unloaded: that is where the stress of a crack goes. A face that is as relaxed already is not crossed,
    since what lies behind it mostly is as well.
    """
    tail, twin, is_tip, relief = mesh.tail, mesh.twin, state.is_tip, state.relief
    tension, tension_age, tension_cap = state.tension, state.tension_age, state.tension_cap
    centre, relief_distance, stack = agenda.face_centre, agenda.relief_distance, agenda.stack
    edges, next_step = agenda.edges, agenda.counts[STEP] + 1
    ax, ay, az = mesh.rest_positions[start, 0], mesh.rest_positions[start, 1], mesh.rest_positions[start, 2]
    bx, by, bz = mesh.rest_positions[end, 0], mesh.rest_positions[end, 1], mesh.rest_positions[end, 2]
    ex, ey, ez = bx - ax, by - ay, bz - az
    length = math.sqrt(ex * ex + ey * ey + ez * ez)
    per_length = length if length > 0.0 else 1.0
    reach = _REACH * rules.shear_lag
    depth = 1
    stack[0] = seed
    while depth > 0:
        depth -= 1
        entered = stack[depth]
        f = entered // 3
        x, y, z = centre[f, 0], centre[f, 1], centre[f, 2]
        to_start = (x - ax) * (x - ax) + (y - ay) * (y - ay) + (z - az) * (z - az)
        to_end = (x - bx) * (x - bx) + (y - by) * (y - by) + (z - bz) * (z - bz)
        along = ((x - ax) * ex + (y - ay) * ey + (z - az) * ez) / per_length
        if length == 0.0 or along < 0.0:
            distance = math.sqrt(to_start)
        elif along > length:
            distance = math.sqrt(to_end)
        else:
            distance = math.sqrt(max(to_start - along * along, 0.0))
        # a nearer crack has left a lower cap for certain, which spares most exponentials
        if distance >= relief_distance[f] or (distance > reach and entered != seed):
            continue
        if length > 0.0 and (
            (tip_end and to_end > 0.0 and (along - length) / math.sqrt(to_end) > rules.direction_threshold)
            or (tip_start and to_start > 0.0 and -along / math.sqrt(to_start) > rules.direction_threshold)
        ):
            continue
        cap = 1.0 - math.exp(-distance / rules.shear_lag)
        if cap >= tension_cap[f] - _EQUAL:
            continue
        tension[f] = min(tension_of(tension, tension_age, tension_cap, rules, f, age), cap)
        tension_age[f] = age
        tension_cap[f] = cap
        relief_distance[f] = distance
        relief[f, 0], relief[f, 1], relief[f, 2] = ex / per_length, ey / per_length, ez / per_length
        for h in range(3 * f, 3 * f + 3):
            if is_tip[tail[h]]:  # where the direction of relief matters to the edges
                call_edge(edges, twin, h, next_step)
                call_edge(edges, twin, prev_of(h), next_step)
            if h != entered and twin[h] >= 0:
                stack[depth] = twin[h]
                depth += 1


@kernel
def relax_face(state: FilmState, rules: FilmRules, f: int, age: float) -> None:
    """Relax face f alone, as the paper has it: its tension falls by a factor and tends to the same."""
    state.tension[f] = rules.face_factor * face_tension(state, rules, f, age)
    state.tension_age[f] = age


@kernel
def rest_direction(mesh: HalfEdgeMesh, source: int, target: int, out: Vectors) -> float:
    """Unit vector at rest from one origin to another into out (3,), zero where they coincide; returns how far
    apart they are.
    """
    length = 0.0
    for axis in range(3):
        out[axis] = mesh.rest_positions[target, axis] - mesh.rest_positions[source, axis]
        length += out[axis] * out[axis]
    length = math.sqrt(length)
    if length > 0.0:
        out /= length
    return length


@kernel
def tension_until(state: FilmState, rules: FilmRules, f: int, age: float, later: float) -> float:
    """Tension of face f at an age; where `later` is later, no less than it is at any time between, as far as
    no event comes in.
    """
    tension = face_tension(state, rules, f, age)
    if later > age:
        return max(tension, face_tension(state, rules, f, later)) * (1.0 + SLACK) + SLACK
    return tension


@kernel
def tension_across(
    mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, f: int, a: int, b: int, age: float, later: float
) -> float:
    """Tension of face f that pulls across the edge from a to b; for the ages see `tension_until`.

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
        relieved += state.relief[f, axis] * state.relief[f, axis]
    tension = tension_until(state, rules, f, age, later)
    if relieved == 0.0 or length == 0.0:
        return tension
    full = drying_tension(rules, age)
    if later > age:
        full = max(full, drying_tension(rules, later)) * (1.0 + SLACK) + SLACK
    return tension + max(full - tension, 0.0) * max(1.0 - along * along / length, 0.0)
