"""The fringe: attached vertices round which something has moved, whose lift is bounded anew in every step.

A bound without transcendental functions settles nearly all of them. The hinges round each vertex that move
are packed for it, since going round the vertex through the half-edges costs more than the arithmetic;
whatever changes what is round a vertex calls for packing it again.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.film.agenda import FRINGE, PACKED, PACKED_HINGES, SLACK, TO_PACK, Agenda, join_fringe
from weathercoat.film.lift import lift_on, sigmoid_bound
from weathercoat.film.state import FilmRules, FilmState, drying_tension
from weathercoat.mesh.dihedral import bend_direction
from weathercoat.mesh.halfedge import HalfEdgeMesh, next_of, prev_of
from weathercoat.mesh.surface import Indices, Vectors


@kernel
def find_in_fringe(
    mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, agenda: Agenda, age: float, found: int
) -> int:
    """Append to the `found` vertices in agenda.found those of the fringe that separate at an age; returns how
    many there are then.
    """
    positions, tail, twin, half_edge = mesh.positions, mesh.tail, mesh.twin, mesh.half_edge
    separated, adhesion, rest_factor = state.separated, state.adhesion, state.lift_factor
    adhesion_loss, gain = state.adhesion_loss, state.lift_gain
    fringe, membership, hinges, sums = agenda.fringe, agenda.membership, agenda.hinges, agenda.sums
    scale = rules.lift_coefficient * (1.0 if rules.lifts_by_face else drying_tension(rules, age))
    per_scale = 1.0 / (scale * (1.0 + SLACK)) if scale > 0.0 else math.inf
    count = agenda.counts[FRINGE]
    i = 0
    while i < count:
        v = fringe[i]
        if membership[v] == TO_PACK and not separated[v] and not rules.lifts_by_face:
            pack_hinges(
                half_edge[v], tail, twin, separated, rest_factor, rules.lift_per_valence, i, hinges, sums
            )
            sums[i, 1] *= gain[v]
            sums[i, 2] = adhesion[v]
            sums[i, 3] = adhesion_loss[v]
            membership[v] = PACKED
        if membership[v] == PACKED:
            enough = max(sums[i, 2] - sums[i, 3] * age, 0.0) * per_scale
            if bound_lift(positions, hinges, sums, i, rules.lift_convexity, enough) <= enough:
                i += 1
                continue
        if separated[v] or half_edge[v] < 0:
            count -= 1
            fringe[i] = fringe[count]
            hinges[i] = hinges[count]
            sums[i] = sums[count]
            continue
        i += 1
        if scale * lift_on(mesh, state, rules, v, age) > max(adhesion[v] - adhesion_loss[v] * age, 0.0):
            agenda.found[found] = v
            found += 1
    agenda.counts[FRINGE] = count
    return found


@kernel
def bound_lift(
    positions: Vectors, hinges: Indices, sums: Vectors, i: int, convexity: float, enough: float
) -> float:
    """No less than `lift_on` a vertex by the drying tension, but for round-off, from what `pack_hinges` has
    packed in row i; no closer once it is not above `enough`.
    """
    most, factor = sums[i, 0], sums[i, 1]
    for k in range(PACKED_HINGES):
        if most * factor <= enough or hinges[i, k, 0] < 0:
            break
        sine, cosine = bend_direction(
            positions, hinges[i, k, 0], hinges[i, k, 1], hinges[i, k, 2], hinges[i, k, 3]
        )
        most -= 1.0 - sigmoid_bound(sine, cosine, convexity)
    return most * factor


@kernel
def pack_hinges(
    first: int,
    tail: Indices,
    twin: Indices,
    separated: NDArray[np.bool_],
    rest_factor: Vectors,
    per_valence: bool,
    i: int,
    hinges: Indices,
    sums: Vectors,
) -> None:
    """Pack what `bound_lift` needs of an attached vertex in row i: the corners of the hinges opposite to it
    that move, the sum of the sigmoids where those are 1, and the factor that makes it one of six half-edges.

    first: the half-edge at which the vertex's fan begins; rest_factor: (3 m,), the sigmoids at rest.
    """
    most = 0.0
    packed = 0
    count = 0
    leaving = first
    while leaving >= 0:
        h = next_of(leaving)
        g = twin[h]
        count += 1
        if g < 0:
            most += 0.5
        elif not (separated[tail[h]] or separated[tail[next_of(h)]] or separated[tail[prev_of(g)]]):
            most += rest_factor[h]
        else:
            most += 1.0
            if packed < PACKED_HINGES:
                hinges[i, packed, 0] = tail[h]
                hinges[i, packed, 1] = tail[next_of(h)]
                hinges[i, packed, 2] = tail[prev_of(h)]
                hinges[i, packed, 3] = tail[prev_of(g)]
                packed += 1
        leaving = twin[prev_of(leaving)]
        if leaving == first:
            break
    if packed < PACKED_HINGES:
        hinges[i, packed, 0] = -1
    sums[i, 0] = most
    sums[i, 1] = 6.0 / count if per_valence and count > 0 else 1.0


@kernel
def disturb_round(
    first: int,
    tail: Indices,
    twin: Indices,
    separated: NDArray[np.bool_],
    disturbed: NDArray[np.bool_],
    fringe: Indices,
    membership: NDArray[np.int8],
    counts: NDArray[np.int64],
) -> None:
    """Take the attached vertices to the fringe whose lift depends on a vertex that moves or was split: all
    the corners of the hinges opposite to it. first: the half-edge at which its fan begins.
    """
    leaving = first
    while leaving >= 0:
        h = next_of(leaving)
        for corner in range(3):
            if corner == 2 and twin[h] < 0:
                continue
            v = tail[h] if corner == 0 else tail[next_of(h)] if corner == 1 else tail[prev_of(twin[h])]
            if not separated[v]:
                disturbed[v] = True
                join_fringe(v, fringe, membership, counts)
        leaving = twin[prev_of(leaving)]
        if leaving == first:
            break
