"""Projection on the input surface: the closest point, on the right side of thin parts."""

from __future__ import annotations

import numpy as np

from weathercoat.compile import kernel
from weathercoat.mesh.halfedge import next_of
from weathercoat.mesh.surface import Indices, Vectors, face_normals

_FACING = 0.3  # least cosine between the normal where a point lands and that of its vertex
_FARTHEST_WALK = 200  # faces


class InputSurface:
    """A triangle mesh with a search tree.

    vertices (n, 3); faces, normals (m, 3); component (m,); twin, crease (3 m,).
    """

    def __init__(self, vertices: Vectors, faces: Indices, twin: Indices, crease: Indices) -> None:
        import igl

        self.vertices, self.faces, self.twin, self.crease = vertices, faces, twin, crease
        normal = face_normals(vertices, faces)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        self.normals = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
        self._wide = faces.astype(np.int64)
        self.component = igl.facet_components(self._wide)[1]
        self._tree = igl.AABB()
        self._tree.init(vertices, self._wide)

    def closest(self, points: Vectors) -> tuple[Indices, Vectors]:
        """The nearest face (k,) and the nearest point on it (k, 3) for each of the points (k, 3)."""
        _, face, point = self._tree.squared_distance(self.vertices, self._wide, points)
        return face.astype(np.int32), point

    def project(self, points: Vectors, normal: Vectors, hint: Indices) -> tuple[Indices, Vectors]:
        """Like `closest`, for points with the normals (k, 3) that belong near the faces `hint` (k,).

        Where the nearest point is on another component or faces elsewhere (the far side of a plate), a walk
        from the hint that crosses no feature finds a point on the right side.
        """
        face, point = self.closest(points)
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
    trial = np.empty(3)
    distance = closest_on_face(goal, start, vertices, faces, out)
    for _ in range(_FARTHEST_WALK):
        here = best
        for h in range(3 * here, 3 * here + 3):
            if twin[h] < 0 or crease[h] >= 0:
                continue
            other = twin[h] // 3
            d = closest_on_face(goal, other, vertices, faces, trial)
            if d < distance:
                best, distance = other, d
                out[:] = trial
        if best == here:
            break
    return best


@kernel
def closest_on_face(goal: Vectors, f: int, vertices: Vectors, faces: Indices, out: Vectors) -> float:
    """Write the point of face f nearest to `goal` (3,) to `out` (3,); returns its squared distance.

    Source: Ericson, Real-Time Collision Detection, 2005, section 5.1.5, written as plane first, edges second.
    """
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    ux, uy, uz = (
        vertices[b, 0] - vertices[a, 0],
        vertices[b, 1] - vertices[a, 1],
        vertices[b, 2] - vertices[a, 2],
    )
    vx, vy, vz = (
        vertices[c, 0] - vertices[a, 0],
        vertices[c, 1] - vertices[a, 1],
        vertices[c, 2] - vertices[a, 2],
    )
    wx, wy, wz = goal[0] - vertices[a, 0], goal[1] - vertices[a, 1], goal[2] - vertices[a, 2]
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    wu, wv = wx * ux + wy * uy + wz * uz, wx * vx + wy * vy + wz * vz
    area = uu * vv - uv * uv
    s, t = vv * wu - uv * wv, uu * wv - uv * wu
    if area > 0 and s >= 0 and t >= 0 and s + t <= area:
        s, t = s / area, t / area
        best = 0.0
        for axis in range(3):
            p, q, r = vertices[a, axis], vertices[b, axis], vertices[c, axis]
            out[axis] = p + s * (q - p) + t * (r - p)
            best += (out[axis] - goal[axis]) ** 2
        return best
    best = np.inf
    for i in range(3):
        p, q = faces[f, i], faces[f, next_of(i)]
        along = length = 0.0
        for axis in range(3):
            step = vertices[q, axis] - vertices[p, axis]
            along += (goal[axis] - vertices[p, axis]) * step
            length += step * step
        r = min(max(along / length, 0.0), 1.0) if length > 0 else 0.0
        d = 0.0
        for axis in range(3):
            x = vertices[p, axis] + r * (vertices[q, axis] - vertices[p, axis])
            d += (x - goal[axis]) ** 2
        if d < best:
            best = d
            for axis in range(3):
                out[axis] = vertices[p, axis] + r * (vertices[q, axis] - vertices[p, axis])
    return best


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
