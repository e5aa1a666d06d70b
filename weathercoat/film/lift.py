"""Lift: how strongly the film's tension peels each attached vertex off the metal (paper 3.1 and 5.1, after Stoney)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.film.state import FilmState
from weathercoat.mesh.dihedral import half_edge_bend
from weathercoat.mesh.halfedge import HalfEdgeMesh, next_of, prev_of
from weathercoat.mesh.surface import Indices, Vectors


@kernel
def lift_factor_now(
    h: int,
    positions: Vectors,
    tail: Indices,
    twin: Indices,
    separated: NDArray[np.bool_],
    rest_factor: Vectors,
    convexity: float,
) -> float:
    """1 / (1 + exp(-a (phi - pi))) of half-edge h with its present dihedral; one without a twin lifts as if flat.

    The apex of h is attached. Where the other three corners of the hinge are too, it has not moved since the start.
    """
    g = twin[h]
    if g < 0:
        return 0.5
    if not (separated[tail[h]] or separated[tail[next_of(h)]] or separated[tail[prev_of(g)]]):
        return rest_factor[h]
    return 1.0 / (1.0 + math.exp(-convexity * half_edge_bend(h, positions, tail, twin)))


@kernel
def sum_lift(
    mesh: HalfEdgeMesh,
    state: FilmState,
    convexity: float,
    face_tension: Vectors,
    per_valence: bool,
    out: Vectors,
    opposite_count: Indices,
) -> None:
    """Sum over the half-edges opposite to each attached vertex of tension times lift factor, into out (n,).

    face_tension: (m,), the tension that lifts. per_valence scales the sum to six half-edges, so that valence and rim do
    not matter. opposite_count is scratch (n,). The lift itself is k times the result.
    """
    positions, tail, twin, alive = mesh.positions, mesh.tail, mesh.twin, mesh.alive
    separated, rest_factor = state.separated, state.lift_factor
    out[:] = 0.0
    opposite_count[:] = 0
    for f in range(len(alive)):
        if not alive[f]:
            continue
        for h in range(3 * f, 3 * f + 3):
            apex = tail[prev_of(h)]
            if not separated[apex]:
                factor = lift_factor_now(h, positions, tail, twin, separated, rest_factor, convexity)
                out[apex] += face_tension[f] * factor
                opposite_count[apex] += 1
    if per_valence:
        for v in range(len(out)):
            if opposite_count[v] > 0:
                out[v] *= 6.0 / opposite_count[v]
