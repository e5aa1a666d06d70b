"""Separation: a vertex lets go of the metal when the lift on it exceeds its adhesion (paper 5.1)."""

from __future__ import annotations

import numpy as np

from weathercoat.film.lift import disturb, find_overcome
from weathercoat.film.state import FilmParameters, FilmState, drying_tension
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Indices


def find_separating(mesh: HalfEdgeMesh, state: FilmState, parameters: FilmParameters, age: float) -> Indices:
    """The attached vertices whose lift exceeds their adhesion at an age, ascending, int32 (k,).

    By default the film's drying tension lifts, not the face's own, since the relaxed one would leave the
    pieces round a crack on the metal for ever. Tensions must have been evaluated at this age.
    """
    p = parameters
    is_uniform = p.lift_tension == "drying"
    scale = p.lift_coefficient * (drying_tension(p, age) if is_uniform else 1.0)
    weight = np.ones(len(mesh.alive)) if is_uniform else state.tension_now
    found = np.empty(len(state.adhesion), np.int32)
    count = find_overcome(
        mesh, state, p.lift_convexity, p.lift_sum == "per_valence", scale,
        p.adhesion_decay_rate * p.adhesion_base * age, weight, is_uniform, found,
    )  # fmt: skip
    return found[:count].copy()


def separate(mesh: HalfEdgeMesh, state: FilmState, vertices: Indices, age: float) -> None:
    """Let the vertices go."""
    state.separated[vertices] = True
    state.separation_age[vertices] = age
    disturb(mesh, state, vertices)
