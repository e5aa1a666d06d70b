"""Relaxation: how a broken edge unloads the film beside it, and what tension is left across another edge."""

from __future__ import annotations

import math

from weathercoat.compile import kernel
from weathercoat.film.state import FilmRules, FilmState, tension_at
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Indices, Vectors

_REACH = 3.0  # shear lags beyond which a crack no longer unloads the film: exp(-3) is 5 %
_EQUAL = 1e-9  # caps that differ by less are equal: on a grid last bits would decide


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
