"""Separation: an attached vertex lets go of the metal when the lift on it exceeds its adhesion (paper 5.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.film.lift import sum_lift
from weathercoat.film.state import FilmParameters, FilmState, adhesion_at, drying_tension
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Indices, Vectors


def find_separating(mesh: HalfEdgeMesh, state: FilmState, parameters: FilmParameters, age: float) -> Indices:
    """The attached vertices whose lift exceeds their adhesion at an age, ascending, int32 (k,).

    By default the film's drying tension lifts, not the face's own, since the relaxed one would leave the pieces round a
    crack on the metal for ever. Tensions must have been evaluated at this age.
    """
    p = parameters
    count = mesh.vertex_count
    tension = state.tension_now
    if p.lift_tension == "drying":
        tension = np.full(len(tension), drying_tension(p, age))
    total = np.empty(count)
    sum_lift(
        mesh, state, p.lift_convexity, tension, p.lift_sum == "per_valence", total, np.empty(count, np.int32)
    )
    attached: NDArray[np.bool_] = ~state.separated[:count] & (mesh.half_edge[:count] >= 0)
    adhesion = adhesion_at(state.adhesion, p, age)[mesh.origin[:count]]
    return np.flatnonzero(attached & (p.lift_coefficient * total > adhesion)).astype(np.int32)


def separate(state: FilmState, vertices: Indices, age: float) -> None:
    """Let the vertices go."""
    state.separated[vertices] = True
    state.separation_age[vertices] = age
