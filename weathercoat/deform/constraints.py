"""What holds the separated film in shape: which lengths and angles are active, and what they aim at."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from weathercoat.compile import kernel
from weathercoat.deform.runs import Runs, activate, deactivate, make_runs
from weathercoat.deform.substrate import Planes, forget, let_move, make_planes
from weathercoat.mesh.dihedral import half_edge_bend
from weathercoat.mesh.halfedge import EventLog, HalfEdgeMesh, next_of, prev_of
from weathercoat.mesh.surface import Indices, Vectors


@dataclass(frozen=True)
class Constraints:
    """The state of the constraints and, derived from it and from the mesh, the packed active ones.

    Half-edges, by the smaller one of a pair: rest_length (3 m,) [sizes]; span (3 m,), the distance between
    the centres of the two faces at rest; angle_start (3 m,), the bend when the angle constraint was made, NaN
    without one; angle_age (3 m,). Vertices: inverse_mass (3 m,), 1 once separated.
    """

    rest_length: Vectors
    span: Vectors
    angle_start: Vectors
    angle_age: Vectors
    inverse_mass: Vectors
    lengths: Runs
    angles: Runs
    planes: Planes


def make_constraints(mesh: HalfEdgeMesh) -> Constraints:
    """No constraint yet, with all that they will need from the rest surface; of an unbroken mesh."""
    corner = mesh.rest_positions[mesh.faces]
    rest_length = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2).reshape(-1)
    centre = np.repeat(corner.mean(axis=1), 3, axis=0)
    twin = mesh.twin
    paired = twin >= 0
    span = np.zeros(len(twin))
    span[paired] = np.linalg.norm(centre[paired] - centre[twin[paired]], axis=1)
    half_edges = np.arange(len(twin), dtype=np.int32)
    tail = mesh.faces.reshape(-1)
    head = np.roll(mesh.faces, -1, axis=1).reshape(-1)
    apex = np.roll(mesh.faces, -2, axis=1).reshape(-1)
    hinges = np.flatnonzero(paired & (half_edges < twin)).astype(np.int32)
    hinge_of = np.full(len(twin), -1, np.int32)
    hinge_of[hinges] = hinge_of[twin[hinges]] = np.arange(len(hinges), dtype=np.int32)
    corners = np.stack([tail[hinges], head[hinges], apex[hinges], apex[twin[hinges]]], axis=1)
    rest_count = len(mesh.rest_positions)
    return Constraints(
        rest_length=rest_length,
        span=span,
        angle_start=np.full(len(twin), np.nan),
        angle_age=np.zeros(len(twin)),
        inverse_mass=np.zeros(len(twin)),
        lengths=make_runs(half_edges, np.stack([tail, head], axis=1), half_edges, rest_count, 0),
        angles=make_runs(hinges, corners, hinge_of, rest_count, 3),
        planes=make_planes(mesh),
    )


def release(mesh: HalfEdgeMesh, constraints: Constraints, vertices: Indices, age: float) -> None:
    """Let vertices move that have separated: angle constraints on the edges opposite to them, from their
    present bend.

    The lengths of their edges are held from now on; no end of such an edge had moved before, so that is the
    rest length. A constraint that exists already keeps its start.
    """
    if len(vertices) == 0:
        return
    c = constraints
    _release(
        mesh, vertices, age, c.rest_length, c.span, c.angle_start, c.angle_age, c.inverse_mass,
        c.lengths, c.angles, c.planes,
    )  # fmt: skip


def follow_events(mesh: HalfEdgeMesh, constraints: Constraints, log: EventLog) -> None:
    """Bring the constraints up to date with a step's log.

    A broken edge loses its angle constraint, and each half-edge keeps a length constraint of its own. Parents
    of copies may be copies of the same step, but all of them have separated.
    """
    if not log.counts.any():
        return
    c = constraints
    _follow_events(
        mesh, log, c.rest_length, c.span, c.angle_start, c.angle_age, c.inverse_mass,
        c.lengths, c.angles, c.planes,
    )  # fmt: skip


@kernel
def _release(
    mesh: HalfEdgeMesh, vertices: Indices, age: float, rest_length: Vectors, span: Vectors,
    angle_start: Vectors, angle_age: Vectors, inverse_mass: Vectors,
    lengths: Runs, angles: Runs, planes: Planes,
) -> None:  # fmt: skip
    for v in vertices:
        inverse_mass[v] = 1.0
        let_move(mesh, planes, v)
        first = mesh.half_edge[v]
        leaving = first
        while leaving >= 0:
            h = next_of(leaving)
            g = mesh.twin[h]
            edge = min(h, g)
            if g >= 0 and math.isnan(angle_start[edge]):
                angle_start[edge] = half_edge_bend(h, mesh.positions, mesh.tail, mesh.twin)
                angle_age[edge] = age
            leaving = mesh.twin[prev_of(leaving)]
            if leaving == first:
                break
    for v in vertices:
        _refresh_round(
            mesh, v, rest_length, span, angle_start, angle_age, inverse_mass, lengths, angles
        )  # fmt: skip


@kernel
def _follow_events(
    mesh: HalfEdgeMesh, log: EventLog, rest_length: Vectors, span: Vectors,
    angle_start: Vectors, angle_age: Vectors, inverse_mass: Vectors,
    lengths: Runs, angles: Runs, planes: Planes,
) -> None:  # fmt: skip
    for i in range(log.counts[1]):
        h, g = log.breaks[i, 0], log.breaks[i, 1]
        angle_start[min(h, g)] = np.nan
        deactivate(angles, angles.slot[h])
    for i in range(log.counts[0]):
        new = log.splits[i, 0]
        inverse_mass[new] = 1.0
        if mesh.half_edge[new] >= 0:
            let_move(mesh, planes, new)
    for i in range(log.counts[0]):
        for side in range(2):
            _refresh_round(
                mesh, log.splits[i, side], rest_length, span, angle_start, angle_age, inverse_mass,
                lengths, angles,
            )  # fmt: skip
    for i in range(log.counts[1]):
        for side in range(2):
            _refresh(
                mesh, log.breaks[i, side], rest_length, span, angle_start, angle_age, inverse_mass,
                lengths, angles,
            )  # fmt: skip
    for i in range(log.counts[2]):
        for h in range(3 * log.falls[i], 3 * log.falls[i] + 3):
            deactivate(lengths, lengths.slot[h])
            if angles.slot[h] >= 0:
                deactivate(angles, angles.slot[h])
            if mesh.half_edge[mesh.tail[h]] < 0:
                forget(mesh, planes, mesh.tail[h])


@kernel
def _refresh_round(
    mesh: HalfEdgeMesh, v: int, rest_length: Vectors, span: Vectors,
    angle_start: Vectors, angle_age: Vectors, inverse_mass: Vectors, lengths: Runs, angles: Runs,
) -> None:  # fmt: skip
    """Pack anew every constraint that a vertex takes part in."""
    first = mesh.half_edge[v]
    leaving = first
    while leaving >= 0:
        arriving = prev_of(leaving)
        _refresh(
            mesh, leaving, rest_length, span, angle_start, angle_age, inverse_mass, lengths, angles
        )  # fmt: skip
        _refresh(
            mesh, next_of(leaving), rest_length, span, angle_start, angle_age, inverse_mass, lengths, angles
        )  # fmt: skip
        if mesh.twin[arriving] < 0:
            _refresh(
                mesh, arriving, rest_length, span, angle_start, angle_age, inverse_mass, lengths, angles
            )  # fmt: skip
        leaving = mesh.twin[arriving]
        if leaving == first:
            break


@kernel
def _refresh(
    mesh: HalfEdgeMesh, h: int, rest_length: Vectors, span: Vectors,
    angle_start: Vectors, angle_age: Vectors, inverse_mass: Vectors, lengths: Runs, angles: Runs,
) -> None:  # fmt: skip
    """Pack the length of an edge, which any of its half-edges names, and its angle, where they are active."""
    if not mesh.alive[h // 3]:
        return
    g = mesh.twin[h]
    if 0 <= g < h:
        h, g = g, h
    a, b = mesh.tail[h], mesh.tail[next_of(h)]
    if inverse_mass[a] + inverse_mass[b] > 0.0:
        block, i = activate(lengths, lengths.slot[h])
        _set_corner(lengths, block, 0, i, a, inverse_mass)
        _set_corner(lengths, block, 1, i, b, inverse_mass)
        lengths.target[block, i] = rest_length[h]
    if g >= 0 and not math.isnan(angle_start[h]):
        block, i = activate(angles, angles.slot[h])
        _set_corner(angles, block, 0, i, a, inverse_mass)
        _set_corner(angles, block, 1, i, b, inverse_mass)
        _set_corner(angles, block, 2, i, mesh.tail[prev_of(h)], inverse_mass)
        _set_corner(angles, block, 3, i, mesh.tail[prev_of(g)], inverse_mass)
        angles.data[block, 0, i] = angle_start[h]
        angles.data[block, 1, i] = angle_age[h]
        angles.data[block, 2, i] = span[h]


@kernel
def _set_corner(runs: Runs, block: int, corner: int, i: int, v: int, inverse_mass: Vectors) -> None:
    runs.vertices[block, corner, i] = v
    runs.moves[block, corner, i] = 1 if inverse_mass[v] > 0.0 else 0
