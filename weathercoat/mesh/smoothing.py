"""Tangential smoothing of an `EditableMesh`, and projection of its vertices on the input surface."""

from __future__ import annotations

import numpy as np

from weathercoat.compile import kernel
from weathercoat.mesh.connectivity import FREE, EditableMesh
from weathercoat.mesh.creases import Features, place_on_chain
from weathercoat.mesh.edits import arc_on, may_move
from weathercoat.mesh.halfedge import next_of, prev_of
from weathercoat.mesh.surface import Vectors


@kernel
def fan_normals(mesh: EditableMesh) -> Vectors:
    """Area-weighted unit normal of each vertex, (n, 3)."""
    p, tail = mesh.position, mesh.tail
    normal = np.zeros((mesh.count[0], 3))
    for f in range(mesh.count[1]):
        a, b, c = tail[3 * f], tail[3 * f + 1], tail[3 * f + 2]
        ux, uy, uz = p[b, 0] - p[a, 0], p[b, 1] - p[a, 1], p[b, 2] - p[a, 2]
        vx, vy, vz = p[c, 0] - p[a, 0], p[c, 1] - p[a, 1], p[c, 2] - p[a, 2]
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for v in (a, b, c):
            normal[v, 0] += x
            normal[v, 1] += y
            normal[v, 2] += z
    for v in range(len(normal)):
        size = np.sqrt(normal[v, 0] ** 2 + normal[v, 1] ** 2 + normal[v, 2] ** 2)
        if size > 0:
            normal[v] /= size
    return normal


@kernel
def arcs_beside(v: int, mesh: EditableMesh, features: Features) -> tuple[float, float]:
    """Arc lengths of the two neighbours of v along the chain that it is on, the smaller one first."""
    chain = mesh.chain[v]
    low, high = np.inf, -np.inf
    first = mesh.half_edge[v]
    h = first
    while True:
        if mesh.crease[h] == chain:
            s = arc_on(mesh.tail[next_of(h)], chain, mesh, features)
            low, high = min(low, s), max(high, s)
        q = prev_of(h)
        h = mesh.twin[q]
        if h < 0 and mesh.crease[q] == chain:
            s = arc_on(mesh.tail[q], chain, mesh, features)
            low, high = min(low, s), max(high, s)
        if h < 0 or h == first:
            return low, high


@kernel
def smooth(
    mesh: EditableMesh,
    features: Features,
    normal: Vectors,
    edge_length: float,
    spring: float,
    goal: Vectors,
    arc: Vectors,
) -> None:
    """Write to `goal` (n, 3) where free vertices should go in their tangent planes, to `arc` those on chains.

    A mix of the mean of its neighbours and of springs of the length `edge_length`, with the weight `spring`.
    """
    p, tail, twin, start, chains = mesh.position, mesh.tail, mesh.twin, mesh.half_edge, mesh.chain
    move = np.empty(3)
    for v in range(mesh.count[0]):
        chain = chains[v]
        if chain < FREE:
            continue
        if chain >= 0:
            before, after = arcs_beside(v, mesh, features)
            arc[v] = 0.5 * (before + after)
            continue
        first = start[v]
        h = first
        move[:] = 0.0
        count = 0
        while True:
            u = tail[next_of(h)]
            dx, dy, dz = p[u, 0] - p[v, 0], p[u, 1] - p[v, 1], p[u, 2] - p[v, 2]
            length = np.sqrt(dx * dx + dy * dy + dz * dz)
            pull = 1.0 - spring + spring * (1.0 - edge_length / max(length, 0.1 * edge_length))
            move[0] += pull * dx
            move[1] += pull * dy
            move[2] += pull * dz
            count += 1
            h = twin[prev_of(h)]
            if h == first:
                break
        lift = move[0] * normal[v, 0] + move[1] * normal[v, 1] + move[2] * normal[v, 2]
        for axis in range(3):
            goal[v, axis] = p[v, axis] + (move[axis] - lift * normal[v, axis]) / count


@kernel
def apply_moves(
    mesh: EditableMesh, features: Features, normals: Vectors, goal: Vectors, arc: Vectors
) -> None:
    """Move each vertex to its goal, where that turns no face over and keeps the order along its chain."""
    p, chains = mesh.position, mesh.chain
    target = np.empty(3)
    for v in range(mesh.count[0]):
        chain = chains[v]
        if chain < FREE:
            continue
        if chain >= 0:
            before, after = arcs_beside(v, mesh, features)
            if not before < arc[v] < after:
                continue
            place_on_chain(chain, arc[v], features.offset, features.arc, features.point, target)
        else:
            for axis in range(3):
                target[axis] = goal[v, axis]
        if may_move(v, -1, target, mesh, normals):
            for axis in range(3):
                p[v, axis] = target[axis]
            if chain >= 0:
                mesh.arc[v] = arc[v]
