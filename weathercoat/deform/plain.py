"""The same sweeps in plain form, one constraint after another, from the definition of what is active.

Nothing in a run uses it: tests hold the packed sweeps against it, bit for bit, and the benchmark times it
beside them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from weathercoat.compile import kernel
from weathercoat.deform.angle import (
    DIHEDRAL,
    FORMS,
    SPLIT,
    meet_arccos_angle,
    meet_dihedral,
    meet_split_angle,
)
from weathercoat.deform.constraints import Constraints
from weathercoat.deform.descending import Solved
from weathercoat.deform.length import meet_length
from weathercoat.deform.parameters import Aim, DeformParameters
from weathercoat.deform.substrate import depth_below
from weathercoat.deform.targets import half_tangent, wanted_bend
from weathercoat.mesh.halfedge import HalfEdgeMesh, next_of, prev_of
from weathercoat.mesh.surface import Indices, Vectors


class Active(NamedTuple):
    """What is active, in the order in which it is met.

    ends: int32 (l, 2), with rest_length (l,); hinges: int32 (a, 4), with their half-edges (a,); free: int32
    (v,), film vertices that may move, ascending.
    """

    ends: Indices
    rest_length: Vectors
    hinges: Indices
    hinge_edges: Indices
    free: Indices


def find_active(mesh: HalfEdgeMesh, constraints: Constraints) -> Active:
    """The active constraints by their definition, in the order of their slots."""
    tail, twin, mass = mesh.tail, mesh.twin, constraints.inverse_mass
    ends, edges, hinges, hinge_edges = [], [], [], []
    for h in constraints.lengths.half_edge.tolist():
        pair = tail[h], tail[next_of(h)]
        if mesh.alive[h // 3] and not 0 <= twin[h] < h and mass[pair[0]] + mass[pair[1]] > 0.0:
            ends.append(pair)
            edges.append(h)
    for h in constraints.angles.half_edge.tolist():
        g = twin[h]
        if mesh.alive[h // 3] and g >= 0 and not math.isnan(constraints.angle_start[h]):
            hinge = tail[h], tail[next_of(h)], tail[prev_of(h)], tail[prev_of(g)]
            if any(mass[v] > 0.0 for v in hinge):
                hinges.append(hinge)
                hinge_edges.append(h)
    used = np.arange(mesh.vertex_count)
    return Active(
        np.array(ends, np.int32).reshape(-1, 2),
        constraints.rest_length[edges],
        np.array(hinges, np.int32).reshape(-1, 4),
        np.array(hinge_edges, np.int32),
        used[(mass[used] > 0.0) & (mesh.half_edge[used] >= 0)].astype(np.int32),
    )


def deform_plainly(
    mesh: HalfEdgeMesh, constraints: Constraints, parameters: DeformParameters, age: float
) -> Solved:
    """What `deform` does with sweeps, from the definition of what is active."""
    active = find_active(mesh, constraints)
    target = bends_wanted(constraints, active.hinge_edges, parameters, age)
    form = FORMS[parameters.deformation_angle]
    if form == DIHEDRAL:
        half_tangents(target)
    for _ in range(parameters.deformation_sweeps):
        sweep_plainly(
            mesh, constraints.inverse_mass, active, form, target, parameters.deformation_angle_stiffness
        )
    return Solved(parameters.deformation_sweeps, None, 0)


def sweep_plainly(
    mesh: HalfEdgeMesh, inverse_mass: Vectors, active: Active, form: int, target: Vectors, stiffness: float
) -> None:
    """One sweep: lengths, angles, substrate; changes positions."""
    project_lengths(mesh.positions, inverse_mass, active.ends, active.rest_length)
    project_angles(form, mesh.positions, inverse_mass, active.hinges, target, stiffness)
    lift_to_substrate(mesh.positions, mesh.origin, mesh.rest_positions, mesh.rest_normals, active.free)


def bends_wanted(
    constraints: Constraints, half_edges: Indices, parameters: DeformParameters, age: float
) -> Vectors:
    """The bends that the hinges of half-edges (k,) are to have at an age [rad], (k,)."""
    bends = np.empty(len(half_edges))
    start, since = constraints.angle_start[half_edges], constraints.angle_age[half_edges]
    _bends_wanted(start, since, constraints.span[half_edges], parameters.aim_at(age), bends)
    return bends


@kernel
def _bends_wanted(start: Vectors, since: Vectors, span: Vectors, aim: Aim, out: Vectors) -> None:
    by_curvature, radius, rate, floor, age = aim.by_curvature, aim.radius, aim.rate, aim.floor, aim.age
    for i in range(len(out)):
        out[i] = wanted_bend(start[i], since[i], span[i], by_curvature, radius, rate, floor, age)


@kernel
def half_tangents(angles: Vectors) -> None:
    """Replace each angle by the tangent of its half."""
    for i in range(len(angles)):
        angles[i] = half_tangent(angles[i])


@kernel
def project_lengths(positions: Vectors, inverse_mass: Vectors, ends: Indices, rest_length: Vectors) -> None:
    """Meet each of the lengths (k,) of ends (k, 2), in order; changes positions."""
    for i in range(len(ends)):
        a, b = ends[i, 0], ends[i, 1]
        moved = meet_length(
            positions[a, 0], positions[a, 1], positions[a, 2],
            positions[b, 0], positions[b, 1], positions[b, 2],
            inverse_mass[a], inverse_mass[b], rest_length[i],
        )  # fmt: skip
        positions[a, 0], positions[a, 1], positions[a, 2] = moved[0], moved[1], moved[2]
        positions[b, 0], positions[b, 1], positions[b, 2] = moved[3], moved[4], moved[5]


@kernel
def project_angles(
    form: int, positions: Vectors, inverse_mass: Vectors, hinges: Indices, target: Vectors, stiffness: float
) -> None:
    """Bring each of the hinges (k, 4) towards its target (k,) by a form, in order; changes positions."""
    gradient = np.empty((4, 3))
    for i in range(len(hinges)):
        p1, p2, p3, p4 = hinges[i, 0], hinges[i, 1], hinges[i, 2], hinges[i, 3]
        w1, w2, w3, w4 = inverse_mass[p1], inverse_mass[p2], inverse_mass[p3], inverse_mass[p4]
        if form == DIHEDRAL:
            moved = meet_dihedral(
                positions[p1, 0], positions[p1, 1], positions[p1, 2],
                positions[p2, 0], positions[p2, 1], positions[p2, 2],
                positions[p3, 0], positions[p3, 1], positions[p3, 2],
                positions[p4, 0], positions[p4, 1], positions[p4, 2],
                w1, w2, w3, w4, target[i], stiffness,
            )  # fmt: skip
            positions[p1, 0], positions[p1, 1], positions[p1, 2] = moved[0], moved[1], moved[2]
            positions[p2, 0], positions[p2, 1], positions[p2, 2] = moved[3], moved[4], moved[5]
            positions[p3, 0], positions[p3, 1], positions[p3, 2] = moved[6], moved[7], moved[8]
            positions[p4, 0], positions[p4, 1], positions[p4, 2] = moved[9], moved[10], moved[11]
        elif form == SPLIT:
            meet_split_angle(positions, p1, p2, p3, p4, w1, w2, w3, w4, target[i], stiffness)
        else:
            meet_arccos_angle(positions, p1, p2, p3, p4, w1, w2, w3, w4, target[i], stiffness, gradient)


@kernel
def lift_to_substrate(
    positions: Vectors, origin: Indices, rest_positions: Vectors, rest_normals: Vectors, vertices: Indices
) -> None:
    """Put each of the vertices (k,) below its plane back on it; changes positions."""
    for v in vertices:
        o = origin[v]
        n, p = rest_normals[o], rest_positions[o]
        offset = n[0] * p[0] + n[1] * p[1] + n[2] * p[2]
        depth = depth_below(positions[v, 0], positions[v, 1], positions[v, 2], n[0], n[1], n[2], offset)
        if depth < 0.0:
            for axis in range(3):
                positions[v, axis] -= depth * n[axis]
