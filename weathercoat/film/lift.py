"""Lift: how strongly the film's tension peels each attached vertex off the metal (paper 3.1 and 5.1, after
Stoney).
"""

from __future__ import annotations

import math

from weathercoat.compile import kernel
from weathercoat.film.state import FilmRules, FilmState, face_tension
from weathercoat.mesh.dihedral import half_edge_bend
from weathercoat.mesh.halfedge import HalfEdgeMesh, next_of, prev_of
from weathercoat.mesh.surface import Vectors


@kernel
def sigmoid(bend: float, convexity: float) -> float:
    """1 / (1 + exp(-a (phi - pi))), by which a hinge lifts (eq. 1): a half where flat, more on a ridge."""
    return 1.0 / (1.0 + math.exp(-convexity * bend))


@kernel
def sigmoid_bound(sine: float, cosine: float, convexity: float) -> float:
    """No less than the sigmoid of the bend with this sine and cosine, which may have a common factor.

    Without transcendental functions. A ridge: the continued fraction of the arc tangent t / (1 + t^2 / (3 +
    4 t^2 / 5)) is above it, and the sigmoid is concave, so below its tangents at 0 and 1.5. A valley: 3 t /
    (3 + t^2) is below the arc tangent, and exp(y) above 1 + y + y^2 / 2.
    """
    if sine > 0.0:
        if cosine <= 0.0:
            return 1.0
        t = sine / cosine
        x = convexity * t * (15.0 + 4.0 * t * t) / (15.0 + 9.0 * t * t)
        return min(0.5 + 0.25 * x, 0.5940 + 0.1492 * x, 1.0)
    if cosine > 0.0:
        t = -sine / cosine
        y = convexity * 3.0 * t / (3.0 + t * t)
    else:
        y = convexity * 1.5  # a bend beyond a right angle
    return 1.0 / (2.0 + y + 0.5 * y * y)


@kernel
def lift_on(mesh: HalfEdgeMesh, state: FilmState, rules: FilmRules, v: int, age: float) -> float:
    """What lifts the attached vertex v, per lift coefficient and, unless the faces' own tension lifts, per
    drying tension.

    It is the sum over the half-edges opposite to the vertex of the sigmoid of their present bend, times the
    tension of their face where that lifts. A half-edge without a twin lifts as if flat, and a hinge whose
    corners are all attached has not moved since the start. The vertex's gain counts. `lift_per_valence`
    scales the sum to six half-edges, so that valence and rim do not matter.
    """
    positions, tail, twin, separated = mesh.positions, mesh.tail, mesh.twin, state.separated
    total = 0.0
    count = 0
    first = mesh.half_edge[v]
    leaving = first
    while leaving >= 0:
        h = next_of(leaving)
        g = twin[h]
        if g < 0:
            factor = 0.5
        elif not (separated[tail[h]] or separated[tail[next_of(h)]] or separated[tail[prev_of(g)]]):
            factor = state.lift_factor[h]
        else:
            factor = sigmoid(half_edge_bend(h, positions, tail, twin), rules.lift_convexity)
        if rules.lifts_by_face:
            factor *= state.stress[h // 3] * face_tension(state, rules, h // 3, age)
        total += factor
        count += 1
        leaving = twin[prev_of(leaving)]
        if leaving == first:
            break
    if rules.lift_per_valence and count > 0:
        total *= 6.0 / count
    return total * state.lift_gain[v]


@kernel
def sum_rest_lift(mesh: HalfEdgeMesh, rest_factor: Vectors, per_valence: bool, out: Vectors) -> None:
    """The sum of `lift_on` for each vertex of the film at rest, under a tension of 1, into out (n0,)."""
    for v in range(len(out)):
        total = 0.0
        count = 0
        first = mesh.half_edge[v]
        leaving = first
        while leaving >= 0:
            total += rest_factor[next_of(leaving)]
            count += 1
            leaving = mesh.twin[prev_of(leaving)]
            if leaving == first:
                break
        out[v] = total * (6.0 / count) if per_valence and count > 0 else total
