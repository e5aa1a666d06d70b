"""The film as a shell with thickness: a front, a back and a rim along its open edges, for display."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Indices, Vectors, face_normals, vertex_normals


@dataclass(frozen=True)
class Shell:
    """A sheet of n vertices, thickened.

    vertices: float64 (2 n, 3), first the n vertices of the front, then those of the back, in the sheet's
    order. front, back: int32 (m, 3), counter-clockwise seen from outside of the shell. rim: int32 (2 b, 3),
    two faces for each of the b open edges; rim_face: int32 (2 b,), the face of the sheet beside each.
    """

    vertices: Vectors
    front: Indices
    back: Indices
    rim: Indices
    rim_face: Indices


def make_shell(
    vertices: Vectors, faces: Indices, thickness: float, *, gap: float = 0.0, bevel: float = 0.0
) -> Shell:
    """Thicken a sheet along its normals.

    The back lies `gap` above the sheet (negative: below it) and the front `thickness` above the back, in the
    units of `vertices`. `bevel` draws the open edges of the front inwards by up to that length, so that two
    pieces which meet along a closed crack show a groove; it never exceeds a quarter of the shortest edge at
    the vertex.
    """
    faces = np.asarray(faces, np.int32).reshape(-1, 3)
    count = len(vertices)
    normals = vertex_normals(vertices, faces)
    back = vertices + gap * normals
    front = back + thickness * normals
    tails, heads, owners = open_edges(faces)
    if bevel > 0.0 and len(tails):
        front = front + _inward(vertices, faces, tails, heads, owners, bevel)
    rim = np.empty((2 * len(tails), 3), np.int32)
    rim[0::2] = np.stack([heads, tails, tails + count], axis=1)
    rim[1::2] = np.stack([heads, tails + count, heads + count], axis=1)
    return Shell(
        np.concatenate([front, back]),
        faces,
        faces[:, ::-1] + np.int32(count),
        rim,
        np.repeat(owners, 2),
    )


def open_edges(faces: Indices) -> tuple[Indices, Indices, Indices]:
    """Tails, heads and faces, each int32 (b,), of the half-edges whose edge no other face has."""
    tails, heads = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    stride = np.int64(faces.max()) + 1 if len(faces) else 1
    edge = np.minimum(tails, heads) * stride + np.maximum(tails, heads)
    order = np.argsort(edge, kind="stable")
    repeated = edge[order[1:]] == edge[order[:-1]]
    single = np.ones(len(edge), np.bool_)
    single[order[1:][repeated]] = single[order[:-1][repeated]] = False
    owners = np.repeat(np.arange(len(faces), dtype=np.int32), 3)
    return tails[single], heads[single], owners[single]


def smooth_outline(
    vertices: Vectors, faces: Indices, fixed: NDArray[np.bool_], passes: int, *, sharpest: float = 0.3
) -> Vectors:
    """The vertices (n, 3) with the open edges of the sheet smoothed within its surface, except where `fixed`
    (n,).

    A crack that runs along the edges of random triangles zigzags. Each pass draws a vertex half way to the
    middle of its two neighbours along the outline and then a little more than half way back, which takes away
    the zigzag and keeps the form (Taubin, A signal processing approach to fair surface design, 1995). A
    vertex stays where that would leave the surface: where more than `sharpest` of the way leads along the
    normal, as across a crease.
    """
    tails, heads, _ = open_edges(faces)
    ends = np.bincount(tails, minlength=len(vertices)) + np.bincount(heads, minlength=len(vertices))
    free = (ends == 2) & ~fixed
    normals = vertex_normals(vertices, faces)
    for factor in (0.5, -0.53) * passes:
        total = np.zeros_like(vertices)
        for axis in range(3):
            total[:, axis] = np.bincount(heads, vertices[tails, axis], len(vertices))
            total[:, axis] += np.bincount(tails, vertices[heads, axis], len(vertices))
        way = np.where(free[:, None], factor * (0.5 * total - vertices), 0.0)
        along = np.einsum("ij,ij->i", way, normals)
        way[np.abs(along) > sharpest * np.linalg.norm(way, axis=1)] = 0.0
        vertices = vertices + way - np.einsum("ij,ij->i", way, normals)[:, None] * normals
    return vertices


def _inward(
    vertices: Vectors, faces: Indices, tails: Indices, heads: Indices, owners: Indices, length: float
) -> Vectors:
    """Shift of each vertex by which the open edges move inwards by `length`, mitred at corners; (n, 3)."""
    edge = vertices[heads] - vertices[tails]
    direction = np.cross(face_normals(vertices, faces)[owners], edge)
    norm = np.linalg.norm(direction, axis=1, keepdims=True)
    direction = np.divide(direction, norm, out=np.zeros_like(direction), where=norm > 0)
    total = np.zeros_like(vertices)
    ends = np.zeros(len(vertices))
    for end in (tails, heads):
        ends += np.bincount(end, minlength=len(vertices))
        for axis in range(3):
            total[:, axis] += np.bincount(end, direction[:, axis], len(vertices))
    squared = np.einsum("ij,ij->i", total, total)
    # The mitre of unit directions u, v is 2 (u + v) / |u + v|^2; it is held to four times |u + v| / 2.
    mitre = ends / np.maximum(squared, 0.25 * ends**2 + (ends == 0))
    shift = total * (length * mitre)[:, None]
    shortest = np.full(len(vertices), np.inf)
    for i in range(3):
        a, b = faces[:, i], faces[:, (i + 1) % 3]
        span = np.linalg.norm(vertices[b] - vertices[a], axis=1)
        np.minimum.at(shortest, a, span)
        np.minimum.at(shortest, b, span)
    norm = np.linalg.norm(shift, axis=1)
    allowed = np.where(np.isfinite(shortest), 0.25 * shortest, 0.0)
    scale = np.divide(allowed, norm, out=np.ones_like(norm), where=norm > allowed)
    return shift * scale[:, None]


def corner_normals(vertices: Vectors, faces: Indices, crease: float) -> NDArray[np.float32]:
    """Shading normal of each corner of each face, float32 (m, 3, 3).

    A corner averages the faces round its vertex, weighted by angle, whose normals lie within `crease` [rad]
    of its own face's, so that creases stay sharp and everything else is smooth.
    """
    faces = np.ascontiguousarray(faces, np.int32).reshape(-1, 3)
    order = np.argsort(faces.ravel(), kind="stable")
    start = np.zeros(len(vertices) + 1, np.int64)
    np.cumsum(np.bincount(faces.ravel(), minlength=len(vertices)), out=start[1:])
    normal = face_normals(vertices, faces)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    result = np.empty((len(faces), 3, 3), np.float32)
    _corner_normals(vertices, faces, normal, order, start, np.cos(crease), result)
    return result


@kernel
def _corner_normals(
    vertices: Vectors,
    faces: Indices,
    normal: Vectors,
    order: NDArray[np.int64],
    start: NDArray[np.int64],
    least_cosine: float,
    out: NDArray[np.float32],
) -> None:
    weight = np.empty(faces.size)
    for corner in range(faces.size):
        f, i = corner // 3, corner % 3
        p, q, r = faces[f, i], faces[f, (i + 1) % 3], faces[f, (i + 2) % 3]
        ax, ay, az = (
            vertices[q, 0] - vertices[p, 0],
            vertices[q, 1] - vertices[p, 1],
            vertices[q, 2] - vertices[p, 2],
        )
        bx, by, bz = (
            vertices[r, 0] - vertices[p, 0],
            vertices[r, 1] - vertices[p, 1],
            vertices[r, 2] - vertices[p, 2],
        )
        cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        weight[corner] = np.arctan2(np.sqrt(cx * cx + cy * cy + cz * cz), ax * bx + ay * by + az * bz)
    for corner in range(faces.size):
        f, i = corner // 3, corner % 3
        v = faces[f, i]
        x, y, z = 0.0, 0.0, 0.0
        for k in range(start[v], start[v + 1]):
            g = order[k] // 3
            cosine = normal[f, 0] * normal[g, 0] + normal[f, 1] * normal[g, 1] + normal[f, 2] * normal[g, 2]
            if cosine >= least_cosine:
                w = weight[order[k]]
                x += w * normal[g, 0]
                y += w * normal[g, 1]
                z += w * normal[g, 2]
        length = np.sqrt(x * x + y * y + z * z)
        if length > 0.0:
            out[f, i, 0], out[f, i, 1], out[f, i, 2] = x / length, y / length, z / length
        else:
            for axis in range(3):
                out[f, i, axis] = normal[f, axis]
