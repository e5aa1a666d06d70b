"""Charts of texture coordinates: pieces of a surface whose coordinates are continuous, between seams."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Indices, Vectors
from weathercoat.mesh.topology import number_components

_SAME = 1e-9  # texture coordinates nearer than this are one, in widths of the texture


def find_seams(uv: Vectors, twin: Indices) -> NDArray[np.bool_]:
    """The half-edges (3 m,) across which texture coordinates uv (m, 3, 2) jump, or are mirrored.

    Where they are mirrored they agree along the edge, but turn back behind it. Boundaries are no seams.
    """
    seams = find_jumps(uv, twin, _SAME)
    side = np.sign(signed_areas(uv))
    inner = np.flatnonzero(twin >= 0)
    seams[inner] |= side[inner // 3] * side[twin[inner] // 3] < 0.0
    return seams


def find_jumps(values: Vectors, twin: Indices, tolerance: float) -> NDArray[np.bool_]:
    """The half-edges (3 m,) along which values at the corners of faces (m, 3, k) differ from their twins'."""
    inner = np.flatnonzero(twin >= 0)
    other = twin[inner]
    corner = values.reshape(len(twin), -1)
    ahead = 3 * (np.arange(len(twin)) // 3) + (np.arange(len(twin)) + 1) % 3
    begin = np.abs(corner[inner] - corner[ahead[other]]).max(axis=1)
    end = np.abs(corner[ahead[inner]] - corner[other]).max(axis=1)
    jumps = np.zeros(len(twin), np.bool_)
    jumps[inner] = (begin > tolerance) | (end > tolerance)
    return jumps


def signed_areas(uv: Vectors) -> Vectors:
    """Area of each face in the texture (m,), negative where it is mirrored."""
    one, two = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return 0.5 * (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])


def number_charts(faces: Indices, twin: Indices, seams: NDArray[np.bool_]) -> Indices:
    """The chart of each face, from 0 in the order of their first faces, (m,)."""
    return number_components(faces, np.where(seams, np.int32(-1), twin))
