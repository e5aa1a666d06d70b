"""Texels on the simulated mesh: which of its faces each lies on, and where.

Neighbouring texels lie on the same face or near it, so each walks from where the one before it was found,
across the sides that it lies beyond. The few that get nowhere, as at a new chart or over a sharp edge, are
looked up in a tree. Rows are walked from left to right and what is handed on never leaves its row, so that
the answers depend on no order of threads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.closest import ClosestTree, find_closest, make_closest_tree
from weathercoat.mesh.surface import Indices, Vectors

_STEPS = 24  # of a walk from the texel before; one from the middle of a face of the input may be longer
_FLAT = 0.1  # of the root of a face's area: how far off its plane a point on it may lie


class Ground(NamedTuple):
    """The simulated mesh as texels look it up: vertices (n, 3), faces and the neighbours across the sides
    from corner i to i + 1, int32 (t, 3), -1 for none; start: a face near each face of the input, int32 (m,).
    """

    vertices: Vectors
    faces: Indices
    neighbors: Indices
    start: Indices
    tree: ClosestTree


def make_ground(vertices: Vectors, faces: Indices, input_vertices: Vectors, input_faces: Indices) -> Ground:
    """The simulated mesh, and where to begin to look for points of each face of the input."""
    tree = make_closest_tree(vertices, faces)
    centres = input_vertices[input_faces].mean(axis=1)
    start, _ = find_closest(tree, centres, np.zeros(len(centres), np.int32))
    return Ground(vertices, np.ascontiguousarray(faces), face_neighbors(faces), start, tree)


def face_neighbors(faces: Indices) -> Indices:
    """The face across each side from corner i to i + 1, int32 (t, 3); -1 where there is none."""
    tails, heads = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel().astype(np.int64)
    stride = np.int64(faces.max()) + 1
    forward, backward = tails * stride + heads, heads * stride + tails
    order = np.argsort(forward, kind="stable")
    at = np.minimum(np.searchsorted(forward[order], backward), len(order) - 1)
    twin = order[at]
    found = forward[twin] == backward
    return np.where(found, twin // 3, -1).astype(np.int32).reshape(-1, 3)


def locate(
    ground: Ground, face: Indices, weights: NDArray[np.float32], vertices: Vectors, faces: Indices
) -> tuple[Indices, NDArray[np.float32]]:
    """Where texels lie on the ground: faces (r, w), -1 where `face` is, and weights (r, w, 2).

    face, weights: the input's, as `raster` gives them; vertices (n, 3), faces (m, 3): of the input.
    """
    found = np.full(face.shape, -1, np.int32)
    where = np.zeros(weights.shape, np.float32)
    _walk(
        face, weights, vertices, faces, ground.start, ground.vertices, ground.faces, ground.neighbors,
        found, where,
    )  # fmt: skip
    lost = np.flatnonzero(found.ravel() < -1)
    if len(lost):
        points = np.empty((len(lost), 3))
        _points_at(lost, face.ravel(), weights.reshape(-1, 2), vertices, faces, points)
        nearest, place = find_closest(ground.tree, points, -2 - found.ravel()[lost])
        found.ravel()[lost] = nearest
        _weights_at(lost, nearest, place, ground.vertices, ground.faces, where.reshape(-1, 2))
    return found, where


@kernel
def _weights_on(
    vertices: Vectors, a: int, b: int, c: int, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Weights of corners b and c of a point's foot on a triangle's plane, its distance and twice the area."""
    ax, ay, az = vertices[a, 0], vertices[a, 1], vertices[a, 2]
    ux, uy, uz = vertices[b, 0] - ax, vertices[b, 1] - ay, vertices[b, 2] - az
    vx, vy, vz = vertices[c, 0] - ax, vertices[c, 1] - ay, vertices[c, 2] - az
    wx, wy, wz = x - ax, y - ay, z - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    squared = nx * nx + ny * ny + nz * nz
    if squared == 0.0:
        return 0.0, 0.0, np.inf, 0.0
    v = ((wy * vz - wz * vy) * nx + (wz * vx - wx * vz) * ny + (wx * vy - wy * vx) * nz) / squared
    w = ((uy * wz - uz * wy) * nx + (uz * wx - ux * wz) * ny + (ux * wy - uy * wx) * nz) / squared
    area = np.sqrt(squared)
    return v, w, abs(wx * nx + wy * ny + wz * nz) / area, area


@kernel
def _walk(
    face: Indices,
    weights: NDArray[np.float32],
    vertices: Vectors,
    faces: Indices,
    start: Indices,
    ground: Vectors,
    ground_faces: Indices,
    neighbors: Indices,
    found: Indices,
    where: NDArray[np.float32],
) -> None:
    """Walk to each texel; one that is not reached gets -2 - the face where the walk began."""
    rows, columns = face.shape
    most = _STEPS + 4 * int(np.sqrt(len(ground_faces)))
    for row in range(rows):
        last_face, last_found = -1, -1
        for column in range(columns):
            f = face[row, column]
            if f < 0:
                continue
            v, w = np.float64(weights[row, column, 0]), np.float64(weights[row, column, 1])
            u = 1.0 - v - w
            a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
            x = u * vertices[a, 0] + v * vertices[b, 0] + w * vertices[c, 0]
            y = u * vertices[a, 1] + v * vertices[b, 1] + w * vertices[c, 1]
            z = u * vertices[a, 2] + v * vertices[b, 2] + w * vertices[c, 2]
            begin, steps = start[f], most
            if f == last_face:
                begin, steps = last_found, _STEPS
            g, is_found = begin, False
            for _ in range(steps):
                p, q, distance, area = _weights_on(
                    ground, ground_faces[g, 0], ground_faces[g, 1], ground_faces[g, 2], x, y, z
                )
                o = 1.0 - p - q
                least = min(o, p, q)
                if least >= -1e-6:
                    is_found = distance <= _FLAT * np.sqrt(area)
                    break
                # across the side opposite to the corner with the least weight
                side = 1 if least == o else (2 if least == p else 0)
                g = neighbors[g, side]
                if g < 0:
                    break
            if is_found:
                found[row, column] = g
                where[row, column, 0], where[row, column, 1] = p, q
                last_face, last_found = f, g
            else:
                found[row, column] = -2 - begin


@kernel
def _points_at(
    texels: NDArray[np.int64],
    face: Indices,
    weights: NDArray[np.float32],
    vertices: Vectors,
    faces: Indices,
    out: Vectors,
) -> None:
    for i in range(len(texels)):
        f = face[texels[i]]
        v, w = np.float64(weights[texels[i], 0]), np.float64(weights[texels[i], 1])
        for axis in range(3):
            out[i, axis] = (
                (1.0 - v - w) * vertices[faces[f, 0], axis]
                + v * vertices[faces[f, 1], axis]
                + w * vertices[faces[f, 2], axis]
            )


@kernel
def _weights_at(
    texels: NDArray[np.int64],
    nearest: Indices,
    points: Vectors,
    ground: Vectors,
    faces: Indices,
    where: NDArray[np.float32],
) -> None:
    for i in range(len(texels)):
        g = nearest[i]
        p, q, _, _ = _weights_on(
            ground, faces[g, 0], faces[g, 1], faces[g, 2], points[i, 0], points[i, 1], points[i, 2]
        )
        p = min(max(p, 0.0), 1.0)
        where[texels[i], 0], where[texels[i], 1] = p, min(max(q, 0.0), 1.0 - p)
