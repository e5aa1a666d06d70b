"""Lift: how strongly the film's tension peels each attached vertex off the metal (paper 3.1 and 5.1, after
Stoney).
"""

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
    """1 / (1 + exp(-a (phi - pi))) of half-edge h with its present dihedral; one without a twin lifts as if
    flat.

    The apex of h is attached. Where the other three corners of the hinge are too, it has not moved since the
    start.
    """
    g = twin[h]
    if g < 0:
        return 0.5
    if not (separated[tail[h]] or separated[tail[next_of(h)]] or separated[tail[prev_of(g)]]):
        return rest_factor[h]
    return 1.0 / (1.0 + math.exp(-convexity * half_edge_bend(h, positions, tail, twin)))


@kernel
def lift_on(
    first: int,
    positions: Vectors,
    tail: Indices,
    twin: Indices,
    separated: NDArray[np.bool_],
    rest_factor: Vectors,
    convexity: float,
    face_tension: Vectors,
    per_valence: bool,
) -> float:
    """Sum of tension times lift factor over the half-edges opposite to an attached vertex.

    first: the half-edge at which the vertex's fan begins.
    per_valence scales the sum to six half-edges, so that valence and rim do not matter.
    """
    total = 0.0
    count = 0
    leaving = first
    while leaving >= 0:
        h = next_of(leaving)
        total += face_tension[h // 3] * lift_factor_now(
            h, positions, tail, twin, separated, rest_factor, convexity
        )
        count += 1
        leaving = twin[prev_of(leaving)]
        if leaving == first:
            break
    if per_valence and count > 0:
        total *= 6.0 / count
    return total


@kernel
def sum_rest_lift(mesh: HalfEdgeMesh, rest_factor: Vectors, per_valence: bool, out: Vectors) -> None:
    """The sum of `lift_on` for each vertex of the film at rest, under a tension of 1, into out (n0,)."""
    attached = np.zeros(len(out), np.bool_)
    ones = np.ones(len(mesh.alive))
    for v in range(len(out)):
        out[v] = lift_on(
            mesh.half_edge[v],
            mesh.positions,
            mesh.tail,
            mesh.twin,
            attached,
            rest_factor,
            0.0,
            ones,
            per_valence,
        )


@kernel
def find_overcome(
    mesh: HalfEdgeMesh,
    state: FilmState,
    convexity: float,
    per_valence: bool,
    lift_scale: float,
    adhesion_loss: float,
    face_tension: Vectors,
    is_uniform: bool,
    out: Indices,
) -> int:
    """Collect in out the attached vertices with `lift_scale` times their sum above their adhesion; returns
    how many.

    Adhesion is that at the start less `adhesion_loss`, not below 0. Where the tension is the same everywhere,
    vertices round which nothing has moved keep the sum that they had at the start, `rest_lift`.
    """
    positions, tail, twin, half_edge, origin = (
        mesh.positions,
        mesh.tail,
        mesh.twin,
        mesh.half_edge,
        mesh.origin,
    )
    separated, disturbed, adhesion = state.separated, state.disturbed, state.adhesion
    rest_factor, rest_lift = state.lift_factor, state.rest_lift
    found = 0
    # vertices beyond the first ones are copies at cracks, which have all separated
    for v in range(len(adhesion)):
        if separated[v] or half_edge[v] < 0:
            continue
        if is_uniform and not disturbed[v]:
            total = rest_lift[v]
        else:
            total = lift_on(
                half_edge[v],
                positions,
                tail,
                twin,
                separated,
                rest_factor,
                convexity,
                face_tension,
                per_valence,
            )
        if lift_scale * total > max(adhesion[origin[v]] - adhesion_loss, 0.0):
            out[found] = v
            found += 1
    return found


@kernel
def disturb(mesh: HalfEdgeMesh, state: FilmState, vertices: Indices) -> None:
    """Mark the vertices whose lift depends on one of these, which move from now on."""
    tail, twin, half_edge, disturbed = mesh.tail, mesh.twin, mesh.half_edge, state.disturbed
    for v in vertices:
        leaving = half_edge[v]
        while leaving >= 0:
            h = next_of(leaving)
            disturbed[tail[h]] = True
            disturbed[tail[next_of(h)]] = True
            if twin[h] >= 0:
                disturbed[tail[prev_of(twin[h])]] = True
            leaving = twin[prev_of(leaving)]
            if leaving == half_edge[v]:
                break
