"""The substrate: no vertex goes below the tangent plane of the metal where it began (paper 5)."""

from __future__ import annotations

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Indices, Vectors


@kernel
def lift_to_substrate(
    positions: Vectors, origin: Indices, rest_positions: Vectors, rest_normals: Vectors, vertices: Indices
) -> None:
    """Put each of the vertices (k,) below its plane back on it along the normal; changes positions."""
    for v in vertices:
        o = origin[v]
        depth = 0.0
        for axis in range(3):
            depth += (positions[v, axis] - rest_positions[o, axis]) * rest_normals[o, axis]
        if depth < 0.0:
            for axis in range(3):
                positions[v, axis] -= depth * rest_normals[o, axis]
