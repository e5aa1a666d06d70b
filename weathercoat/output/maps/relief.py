"""The relief of what texels show: heights and slopes of film and metal, and out of these, and what is beside
them, tangent-space normals and occlusion.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Indices, Vectors
from weathercoat.output.maps.film import CRACK, END
from weathercoat.output.maps.planes import (
    CRACKED,
    GROOVE,
    HEIGHT,
    LIFT,
    NORMAL_X,
    OCCLUSION,
    SLOPE_X,
    Planes,
)  # fmt: skip

REACH = 8  # rows that a texel looks at on each side
_STEP = 0.35  # a fall to the neighbour by more than this, beyond the slope there, is an edge
_STEEPEST = 1.2
_RINGS = np.array([1, 3, REACH])
_LEAST_GROOVE = 0.6  # texels: half the width of the finest crack that a map can show
_LEAST_COSINE = 0.3  # of the slope of film beyond which a normal map shows no more
_AROUND = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)])


@kernel
def emboss(
    texels: NDArray[np.int64],
    face: Indices,
    weights: NDArray[np.float32],
    is_painted: NDArray[np.bool_],
    normals: NDArray[np.float32],
    texel_size: Vectors,
    ground: Indices,
    rest: Vectors,
    metal: Indices,
    seen: Indices,
    seen_where: NDArray[np.float32],
    height: NDArray[np.float32],
    is_back: NDArray[np.bool_],
    covering: Indices,
    metal_face: Indices,
    film_normals: NDArray[np.float32],
    sides: NDArray[np.uint8],
    thickness: float,
    groove: float,
    highest: float,
    planes: Planes,
) -> None:
    """Fill the planes of heights, grooves, cracks, lift and slopes at `texels` (k,).

    normals (m, 3, 3): the input's; texel_size (m,): the side of a texel in sizes. thickness of the film and
    groove, half the width that a closed crack is drawn with, in sizes; highest: what a lift of 1 is. The
    rest: of `raster`, `locate` and `film`, flat.
    """
    b, n, normal, slope = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for i in texels:
        f, s = face[i], seen[i]
        level, deep, crack = 0.0, 0.0, 0.0
        slope[0] = slope[1] = slope[2] = 0.0
        if is_painted[f] and s >= 0:
            level = np.float64(height[i])
            b[1], b[2] = np.float64(seen_where[i, 0]), np.float64(seen_where[i, 1])
            b[0] = 1.0 - b[1] - b[2]
            edge, is_crack = _edge_distance(rest, metal, metal_face[s], b, sides, s)
            width = max(groove, _LEAST_GROOVE * texel_size[f])
            if edge < width:
                deep = (1.0 - edge / width) * groove / width
                crack = deep if is_crack else 0.0
            weight = min(1.0, level / thickness)
            if weight > 0.0:
                _add_slope(f, weights[i], normals, film_normals[s], b, weight, is_back[i], n, normal, slope)
        elif is_painted[f]:
            level = -thickness
            over = covering[ground[i]]
            # seen past film that is still there, but for what the smoothed outline leaves free
            if over >= 0 and (has_beyond(sides, over, CRACK) or not has_beyond(sides, over, END)):
                crack = 1.0
        planes[LIFT, i] = max(level, 0.0) / highest
        planes[HEIGHT, i] = level - thickness * deep
        planes[GROOVE, i] = deep
        planes[CRACKED, i] = crack
        for x in range(3):
            planes[SLOPE_X + x, i] = slope[x]


@kernel
def has_beyond(sides: NDArray[np.uint8], f: int, what: int) -> bool:
    """Whether `what`, as `film` names it, is beyond any side of the film face f."""
    return sides[f, 0] == what or sides[f, 1] == what or sides[f, 2] == what


@kernel
def _edge_distance(
    rest: Vectors, metal: Indices, t: int, b: Vectors, sides: NDArray[np.uint8], s: int
) -> tuple[float, bool]:
    """Distance, at rest, to the nearest open side of the film face s, and whether it is a crack's."""
    nearest, is_crack = np.inf, False
    if sides[s, 0] == 0 and sides[s, 1] == 0 and sides[s, 2] == 0:
        return nearest, is_crack
    p, q, r = metal[t, 0], metal[t, 1], metal[t, 2]
    ux, uy, uz = rest[q, 0] - rest[p, 0], rest[q, 1] - rest[p, 1], rest[q, 2] - rest[p, 2]
    vx, vy, vz = rest[r, 0] - rest[p, 0], rest[r, 1] - rest[p, 1], rest[r, 2] - rest[p, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    area = np.sqrt(nx * nx + ny * ny + nz * nz)
    for i in range(3):
        if sides[s, i] == 0:
            continue
        tail, head = metal[t, i], metal[t, (i + 1) % 3]
        length = np.sqrt(
            (rest[head, 0] - rest[tail, 0]) ** 2
            + (rest[head, 1] - rest[tail, 1]) ** 2
            + (rest[head, 2] - rest[tail, 2]) ** 2
        )
        distance = b[(i + 2) % 3] * area / max(length, 1e-300)
        if distance < nearest:
            nearest, is_crack = distance, sides[s, i] == CRACK
    return nearest, is_crack


@kernel
def _add_slope(
    f: int,
    weights: NDArray[np.float32],
    normals: NDArray[np.float32],
    film_normals: NDArray[np.float32],
    b: Vectors,
    weight: float,
    is_back: bool,
    n: Vectors,
    normal: Vectors,
    slope: Vectors,
) -> None:
    """Add the slope of lifted film against the input's normal, as a gradient, to `slope` (3,)."""
    v, w = np.float64(weights[0]), np.float64(weights[1])
    along, length, squared = 0.0, 0.0, 0.0
    for x in range(3):
        n[x] = (1.0 - v - w) * normals[f, 0, x] + v * normals[f, 1, x] + w * normals[f, 2, x]
        normal[x] = b[0] * film_normals[0, x] + b[1] * film_normals[1, x] + b[2] * film_normals[2, x]
        length += n[x] * n[x]
        squared += normal[x] * normal[x]
    length, squared = np.sqrt(max(length, 1e-300)), np.sqrt(max(squared, 1e-300))
    sign = -1.0 if is_back else 1.0
    for x in range(3):
        n[x] /= length
        normal[x] *= sign / squared
        along += n[x] * normal[x]
    steep = max(along, _LEAST_COSINE)
    for x in range(3):
        slope[x] -= weight * (normal[x] - along * n[x]) / steep


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
    tilt: NDArray[np.float32],
    planes: Planes,
) -> None:
    """Fill the normals at `texels` (k,) of a band, and lower its occlusion.

    face (r, w), weights (r, w, 2): of `raster`; chart (m,), normals, tangents (m, 3, 3), signs (m,): of
    `tangents`; along_column, along_row (m, 3): from one texel to the next to the right and
    below, in sizes; tilt (k, 2): of the input's own normals, by tangent and bitangent.

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
        east, north = np.float64(tilt[k, 0]), np.float64(tilt[k, 1])
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
