"""Projection on the input surface: the closest point, on the right side of thin parts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.closest import are_within, closest_on_triangle, find_closest, make_closest_tree
from weathercoat.mesh.surface import Indices, Vectors, face_normals
from weathercoat.mesh.topology import number_components

_FACING = 0.3  # least cosine between the normal where a point lands and that of its vertex
_FARTHEST_WALK = 200  # faces


class InputSurface:
    """A triangle mesh with a search tree.

    vertices (n, 3); faces, normals (m, 3); component (m,); twin, crease (3 m,).
    """

    def __init__(self, vertices: Vectors, faces: Indices, twin: Indices, crease: Indices) -> None:
        self.vertices, self.faces, self.twin, self.crease = vertices, faces, twin, crease
        normal = face_normals(vertices, faces)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        self.normals = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
        self.component = number_components(faces, twin)
        self._tree = make_closest_tree(vertices, faces)

    def closest(self, points: Vectors, hint: Indices) -> tuple[Indices, Vectors]:
        """The nearest face (k,) and point on it (k, 3) for points (k, 3); faces `hint` (k,) nearby."""
        return find_closest(self._tree, points, hint)

    def are_within(self, points: Vectors, faces: Indices, distance: float) -> NDArray[np.bool_]:
        """Whether each of the points (k, 3) is within `distance` of its own one of the `faces` (k,)."""
        return are_within(self._tree, points, faces, distance)

    def project(self, points: Vectors, normal: Vectors, hint: Indices) -> tuple[Indices, Vectors]:
        """Like `closest`, for points with the normals (k, 3) that belong near the faces `hint` (k,).

        Where the nearest point is on another component or faces elsewhere (the far side of a plate), a walk
        from the hint that crosses no feature finds a point on the right side.
        """
        face, point = self.closest(points, hint)
        facing = np.einsum("ij,ij->i", self.normals[face], normal)
        wrong = np.flatnonzero((facing < _FACING) | (self.component[face] != self.component[hint]))
        for i in wrong:
            face[i] = walk_to(points[i], hint[i], self.vertices, self.faces, self.twin, self.crease, point[i])
        return face, point


@kernel
def walk_to(
    goal: Vectors, start: int, vertices: Vectors, faces: Indices, twin: Indices, crease: Indices, out: Vectors
) -> int:
    """Go from face `start` to closer faces, across no feature; writes the nearest point to `out` (3,)."""
    best = start
    distance, out[0], out[1], out[2] = closest_on_face(goal, start, vertices, faces)
    for _ in range(_FARTHEST_WALK):
        here = best
        for h in range(3 * here, 3 * here + 3):
            if twin[h] < 0 or crease[h] >= 0:
                continue
            other = twin[h] // 3
            d, x, y, z = closest_on_face(goal, other, vertices, faces)
            if d < distance:
                best, distance = other, d
                out[0], out[1], out[2] = x, y, z
        if best == here:
            break
    return best


@kernel
def closest_on_face(
    goal: Vectors, f: int, vertices: Vectors, faces: Indices
) -> tuple[float, float, float, float]:
    """Squared distance of a goal (3,) from face f, and the nearest point on it."""
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    return closest_on_triangle(
        goal[0], goal[1], goal[2],
        vertices[a, 0], vertices[a, 1], vertices[a, 2],
        vertices[b, 0], vertices[b, 1], vertices[b, 2],
        vertices[c, 0], vertices[c, 1], vertices[c, 2],
    )  # fmt: skip


def barycentric_of(points: Vectors, corners: Vectors) -> Vectors:
    """Weights (k, 3), not negative, sum 1, of points (k, 3) in the triangles (k, 3, 3) that they lie on."""
    u, v, w = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    uu, uv, vv = (np.einsum("ij,ij->i", x, y) for x, y in ((u, u), (u, v), (v, v)))
    wu, wv = np.einsum("ij,ij->i", w, u), np.einsum("ij,ij->i", w, v)
    area = uu * vv - uv * uv
    safe = np.where(area > 0, area, 1.0)
    second = np.clip(np.where(area > 0, (vv * wu - uv * wv) / safe, 0.0), 0.0, 1.0)
    third = np.clip(np.where(area > 0, (uu * wv - uv * wu) / safe, 0.0), 0.0, 1.0 - second)
    return np.stack([1.0 - second - third, second, third], axis=1)
