"""The film at age 0: attached, with its adhesion, cohesion and defects laid out by named random streams."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from weathercoat.film.lift import sum_rest_lift
from weathercoat.film.noise import fractal_noise, hash_bits, hash_uniform, stream_key
from weathercoat.film.state import FilmParameters, FilmState
from weathercoat.mesh.dihedral import all_bends
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Vectors


class FilmLayout(NamedTuple):
    """What the film holds with at age 0: adhesion (n0,) of the vertices, cohesion (3 m,) of the half-edges,
    the same for both of a pair.
    """

    adhesion: Vectors
    cohesion: Vectors


def lay_out_film(mesh: HalfEdgeMesh, parameters: FilmParameters, seed: int) -> FilmLayout:
    """Adhesion by noise, cohesion equal but for scatter and a few defects."""
    p = parameters
    midpoint, _, edge_area = _edge_geometry(mesh)
    noise = fractal_noise(
        mesh.rest_positions,
        wavelength=p.adhesion_wavelength,
        octaves=p.adhesion_octaves,
        gain=p.adhesion_gain,
        key=stream_key(seed, "adhesion"),
    )
    scatter = hash_uniform(midpoint, stream_key(seed, "cohesion"))
    cohesion = p.cohesion_base * (1.0 + p.cohesion_scatter * (2.0 * scatter - 1.0))
    share = p.defects_density * edge_area if p.defects_rule == "per_area" else p.defects_share
    cohesion[hash_uniform(midpoint, stream_key(seed, "defects")) < share] *= p.defects_strength
    return FilmLayout(p.adhesion_base + p.adhesion_amplitude * noise, cohesion)


def make_film_state(
    mesh: HalfEdgeMesh, parameters: FilmParameters, seed: int, layout: FilmLayout | None = None
) -> FilmState:
    """The film at age 0, attached; its adhesion and cohesion are those of `lay_out_film` unless given."""
    p = parameters
    layout = layout or lay_out_film(mesh, p, seed)
    face_count = len(mesh.faces)
    capacity = 3 * face_count
    midpoint, edge_length, _ = _edge_geometry(mesh)
    lift_factor, rest_lift = lift_at_rest(mesh, p)
    return FilmState(
        adhesion=layout.adhesion,
        adhesion_loss=np.full(mesh.vertex_count, p.adhesion_decay_rate * p.adhesion_base),
        lift_gain=np.ones(mesh.vertex_count),
        separated=np.zeros(capacity, np.bool_),
        separation_age=np.full(capacity, np.inf),
        is_tip=np.zeros(capacity, np.bool_),
        crack_direction=np.zeros((capacity, 3)),
        tension=np.full(face_count, p.tension_initial),
        tension_age=np.zeros(face_count),
        tension_cap=np.ones(face_count),
        relief=np.zeros((face_count, 3)),
        stress=np.ones(face_count),
        fray_age=np.full(face_count, np.inf),
        cohesion=layout.cohesion,
        lift_factor=lift_factor,
        tie=hash_bits(midpoint, stream_key(seed, "ties")),
        crack_budget=np.zeros(1),
        mean_edge=float(edge_length.mean()),
        rest_lift=rest_lift,
        disturbed=np.zeros(capacity, np.bool_),
    )


def lift_at_rest(mesh: HalfEdgeMesh, parameters: FilmParameters) -> tuple[Vectors, Vectors]:
    """The sigmoid of the dihedral of each half-edge (3 m,), and what lifts each vertex at tension 1 (n0,),
    before anything has moved.
    """
    bends = np.empty(3 * len(mesh.faces))
    all_bends(mesh.positions, mesh.tail, mesh.twin, bends)
    lift_factor = 1.0 / (1.0 + np.exp(-parameters.lift_convexity * bends))
    rest_lift = np.empty(mesh.vertex_count)
    sum_rest_lift(mesh, lift_factor, parameters.lift_sum == "per_valence", rest_lift)
    return lift_factor, rest_lift


def _edge_geometry(mesh: HalfEdgeMesh) -> tuple[Vectors, Vectors, Vectors]:
    """Rest midpoint (3 m, 3), length and area (a third of its faces') of the edge of each half-edge."""
    corner = mesh.rest_positions[mesh.faces]
    start = corner.reshape(-1, 3)
    end = np.roll(corner, -1, axis=1).reshape(-1, 3)
    area = np.repeat(
        0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1), 3
    )
    paired = mesh.twin >= 0
    edge_area = area / 3.0
    edge_area[paired] += area[mesh.twin[paired]] / 3.0
    return 0.5 * (start + end), np.linalg.norm(end - start, axis=1), edge_area
