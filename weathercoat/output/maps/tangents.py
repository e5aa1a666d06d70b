"""Tangent frames of the input, in which its normal maps are written, as viewers rebuild them.

The frame is that of MikkTSpace, which glTF asks for: at each corner the normal that the mesh is shown with,
and the direction of growing u, the mean of the faces round the corner that go on in texture space without a
seam, with the same handedness. The third axis is sign * (normal x tangent), the direction of growing v, so
that green is up (OpenGL's convention). Source: Mikkelsen, Simulation of wrinkled surfaces revisited, 2008.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Surface, Vectors
from weathercoat.output.maps.layout import uv_areas
from weathercoat.output.sheets import METAL_CREASE, split_corners
from weathercoat.output.shell import corner_normals


class Frames(NamedTuple):
    """normals, tangents float32 (m, 3, 3): of corners; signs float32 (m,): -1 where the texture is mirrored;
    along_u, along_v (m, 3): change of position by u and by v; chart int32 (m,): the same for faces that are
    joined in texture space.
    """

    normals: NDArray[np.float32]
    tangents: NDArray[np.float32]
    signs: NDArray[np.float32]
    along_u: Vectors
    along_v: Vectors
    chart: NDArray[np.int32]


def shading_normals(surface: Surface) -> Vectors:
    """The normals (m, 3, 3) that the surface is shown with: its own, or smooth but for sharp edges."""
    if surface.normals is not None:
        return surface.normals
    return corner_normals(surface.vertices, surface.faces, METAL_CREASE).astype(np.float64)


def make_frames(surface: Surface, vertices: Vectors) -> Frames:
    """The frames of a surface that has texture coordinates, with its vertices at `vertices` (n, 3)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    uv, faces = surface.uv, surface.faces
    assert uv is not None
    normals = shading_normals(surface)
    corner = vertices[faces]
    e, f = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    p, q = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    twice = 2.0 * uv_areas(uv)
    inverse = np.divide(1.0, twice, out=np.zeros_like(twice), where=twice != 0.0)[:, None]
    along_u = (e * q[:, 1:] - f * p[:, 1:]) * inverse
    along_v = (f * p[:, :1] - e * q[:, :1]) * inverse
    signs = np.where(twice < 0.0, -1.0, 1.0)

    key = np.concatenate([normals, uv, np.repeat(signs, 3).reshape(-1, 3, 1)], axis=2)
    shared, _, _ = split_corners(faces, key, len(vertices))
    total = np.zeros((int(shared.max()) + 1, 3))
    unit_u = _unit(along_u)
    for i in range(3):
        a, b = _unit(corner[:, (i + 1) % 3] - corner[:, i]), _unit(corner[:, i - 1] - corner[:, i])
        angle = np.arccos(np.clip(np.einsum("ij,ij->i", a, b), -1.0, 1.0))
        n = normals[:, i]
        flat = _unit(unit_u - np.einsum("ij,ij->i", unit_u, n)[:, None] * n)
        for axis in range(3):
            total[:, axis] += np.bincount(shared[:, i], angle * flat[:, axis], len(total))

    by_uv, _, _ = split_corners(faces, uv, len(vertices))
    ends = np.concatenate([by_uv[:, [0, 1]], by_uv[:, [1, 2]]])
    count = int(by_uv.max()) + 1
    graph = coo_array((np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), shape=(count, count))
    _, of_vertex = connected_components(graph, directed=False)
    return Frames(
        normals.astype(np.float32),
        _unit(total)[shared].astype(np.float32),
        signs.astype(np.float32),
        along_u,
        along_v,
        of_vertex[by_uv[:, 0]].astype(np.int32),
    )


def _unit(vectors: Vectors) -> Vectors:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0)
