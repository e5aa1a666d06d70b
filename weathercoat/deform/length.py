"""Length constraints: C = |p1 - p2| - L (paper 4.2)."""

from __future__ import annotations

import math

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Indices, Vectors


@kernel
def project_lengths(positions: Vectors, inverse_mass: Vectors, ends: Indices, rest_length: Vectors) -> None:
    """Move the ends of each edge, in order, to its rest length, shared by inverse mass; changes positions.

    ends: int32 (k, 2), at least one end of each with an inverse mass; rest_length: (k,). Edges of no length
    stay.
    """
    for i in range(len(ends)):
        a, b = ends[i, 0], ends[i, 1]
        wa, wb = inverse_mass[a], inverse_mass[b]
        dx = positions[a, 0] - positions[b, 0]
        dy = positions[a, 1] - positions[b, 1]
        dz = positions[a, 2] - positions[b, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        if length > 0.0:
            scale = (length - rest_length[i]) / (length * (wa + wb))
            positions[a, 0] -= wa * scale * dx
            positions[a, 1] -= wa * scale * dy
            positions[a, 2] -= wa * scale * dz
            positions[b, 0] += wb * scale * dx
            positions[b, 1] += wb * scale * dy
            positions[b, 2] += wb * scale * dz
