"""Tangent-space normals and occlusion out of what texels and their neighbours show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Indices, Vectors
from weathercoat.output.maps.dress import (
    HEIGHT,
    NORMAL_X,
    OCCLUSION,
    SLOPE_X,
    Planes,
)

REACH = 8  # rows that a texel looks at on each side
_STEP = 0.35  # a fall to the neighbour by more than this, beyond the slope there, is an edge
_STEEPEST = 1.2
_RINGS = np.array([1, 3, REACH])
_AROUND = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)])


@kernel
def carve(
    texels: NDArray[np.int64],
    face: Indices,
    weights: NDArray[np.float32],
    chart: Indices,
    normals: NDArray[np.float32],
    tangents: NDArray[np.float32],
    signs: NDArray[np.float32],
    along_column: Vectors,
    along_row: Vectors,
    planes: Planes,
) -> None:
    """Fill the normals at `texels` (k,) of a band, and lower its occlusion.

    face (r, w), weights (r, w, 2): of `raster`; chart (m,), normals, tangents (m, 3, 3), signs (m,): of
    `tangents`; along_column, along_row (m, 3): from one texel to the next to the right and below, in sizes.

    Where a surface falls off beside a texel, as at the edge of film, the texel leans towards it. Occlusion is
    one minus the mean over eight directions of the squared sine of the horizon.
    """
    rows, columns = face.shape
    lean, n, t = np.empty(3), np.empty(3), np.empty(3)
    for k in range(len(texels)):
        i = texels[k]
        row, column = i // columns, i % columns
        f = face[row, column]
        here = np.float64(planes[HEIGHT, i])
        for x in range(3):
            lean[x] = planes[SLOPE_X + x, i]
        for side in range(4):
            dr, dc = (0, 0, 1, -1)[side], (1, -1, 0, 0)[side]
            r, c = row + dr, column + dc
            if r < 0 or r >= rows or c < 0 or c >= columns:
                continue
            other = face[r, c]
            if other < 0 or chart[other] != chart[f]:
                continue
            squared, rise = 0.0, 0.0
            for x in range(3):
                way = dc * along_column[f, x] + dr * along_row[f, x]
                squared += way * way
                rise += way * planes[SLOPE_X + x, i]
            if squared == 0.0:
                continue
            length = np.sqrt(squared)
            fall = (planes[HEIGHT, r * columns + c] - here - rise) / length
            if fall < -_STEP:
                for x in range(3):
                    way = dc * along_column[f, x] + dr * along_row[f, x]
                    lean[x] += 0.5 * max(fall, -_STEEPEST) * way / length
        v, w = np.float64(weights[row, column, 0]), np.float64(weights[row, column, 1])
        u = 1.0 - v - w
        squared, along = 0.0, 0.0
        for x in range(3):
            n[x] = u * normals[f, 0, x] + v * normals[f, 1, x] + w * normals[f, 2, x]
            t[x] = u * tangents[f, 0, x] + v * tangents[f, 1, x] + w * tangents[f, 2, x]
            squared += n[x] * n[x]
        squared = np.sqrt(max(squared, 1e-300))
        for x in range(3):
            n[x] /= squared
            along += n[x] * t[x]
        squared = 0.0
        for x in range(3):
            t[x] -= along * n[x]
            squared += t[x] * t[x]
        squared = np.sqrt(max(squared, 1e-300))
        east, north = 0.0, 0.0
        for x in range(3):
            y, z = (x + 1) % 3, (x + 2) % 3
            east -= lean[x] * t[x] / squared
            north -= lean[x] * signs[f] * (n[y] * t[z] - n[z] * t[y]) / squared
        length = np.sqrt(1.0 + east * east + north * north)
        planes[NORMAL_X, i] = east / length
        planes[NORMAL_X + 1, i] = north / length
        planes[NORMAL_X + 2, i] = 1.0 / length
        planes[OCCLUSION, i] *= 1.0 - _hidden(
            row, column, face, chart, along_column[f], along_row[f], here, planes
        )


@kernel
def _hidden(
    row: int,
    column: int,
    face: Indices,
    chart: Indices,
    along_column: Vectors,
    along_row: Vectors,
    here: float,
    planes: Planes,
) -> float:
    """The share of the sky that what stands higher round a texel takes away."""
    rows, columns = face.shape
    f = face[row, column]
    total = 0.0
    for side in range(len(_AROUND)):
        dc, dr = _AROUND[side, 0], _AROUND[side, 1]
        most = 0.0
        for ring in range(len(_RINGS)):
            r, c = row + dr * _RINGS[ring], column + dc * _RINGS[ring]
            if r < 0 or r >= rows or c < 0 or c >= columns:
                break
            other = face[r, c]
            if other < 0 or chart[other] != chart[f]:
                break
            rise = planes[HEIGHT, r * columns + c] - here
            if rise <= 0.0:
                continue
            squared = 0.0
            for x in range(3):
                squared += (_RINGS[ring] * (dc * along_column[x] + dr * along_row[x])) ** 2
            most = max(most, rise * rise / (rise * rise + squared))
        total += most
    return 0.8 * total / len(_AROUND)
