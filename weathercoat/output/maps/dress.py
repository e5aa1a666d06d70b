"""What each texel shows, out of the state of film and metal there: colour, roughness, metalness, masks.

The look is that of pictures, by the same kernels at the same places, so that maps and pictures agree.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Indices, Vectors
from weathercoat.output.maps.film import CRACK, END
from weathercoat.output.shading import BACK, BARE_PART, DUST, FRONT, METAL, OWN_PART, material_of

Planes = NDArray[np.float32]

# Planes of what texels show, (N_PLANES, texels): linear colour, and what it says.
(
    RED, GREEN, BLUE, ROUGHNESS, METALNESS, OCCLUSION,
    BARE, RUST, DIRT, CRACKED, LIFT, SEPARATED, AGE,
    HEIGHT, SLOPE_X, SLOPE_Y, SLOPE_Z, NORMAL_X, NORMAL_Y, NORMAL_Z,
) = range(20)  # fmt: skip
N_PLANES = 20
# Columns of what belongs to film vertices, and to vertices of the metal.
STAIN, HAS_SEPARATED, SEPARATED_FOR = range(3)
METAL_DUST, METAL_RUST = range(2)

_LEAST_GROOVE = 0.6  # texels: half the width of the finest crack that a map can show
_CHALKY = 0.52  # the roughest clean paint, see `shading`: beyond it lie stains and dust
_STEEPEST = 0.3  # cosine of the slope of film beyond which a normal map shows no more


@kernel
def dress(
    texels: NDArray[np.int64],
    face: Indices,
    weights: NDArray[np.float32],
    is_painted: NDArray[np.bool_],
    has_material: NDArray[np.bool_],
    own_color: NDArray[np.float32],
    own_orm: NDArray[np.float32],
    shows_own: NDArray[np.bool_],
    normals: NDArray[np.float32],
    texel_size: Vectors,
    ground: Indices,
    where: NDArray[np.float32],
    rest: Vectors,
    metal: Indices,
    metal_values: Vectors,
    seen: Indices,
    seen_where: NDArray[np.float32],
    height: NDArray[np.float32],
    is_back: NDArray[np.bool_],
    covering: Indices,
    film_faces: Indices,
    metal_face: Indices,
    film_values: Vectors,
    film_normals: NDArray[np.float32],
    sides: NDArray[np.uint8],
    thickness: float,
    groove: float,
    age: float,
    highest: float,
    paint: Vectors,
    palette: Vectors,
    up: Vectors,
    planes: Planes,
) -> None:
    """Fill the planes (N_PLANES, r w) at `texels` (k,), but for normals and occlusion.

    own_color (k, 3), own_orm (k, 3): of the input's materials at the texels, linear; shows_own (m,):
    whether paint on a face of the input shows them; has_material (m,), is_painted (m,): of its faces, as
    texel_size (m,), the side of a texel in sizes. thickness of the film and groove, half the width that a
    closed crack is drawn with, in sizes; paint (3,): the film's linear colour; palette: as in `shading`.
    The rest: of `raster`, `locate` and `film`, flat.
    """
    albedo, bump, slope, scratch = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    place, color, n, normal = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    b = np.empty(3)
    for k in range(len(texels)):
        i = texels[k]
        f, g, s = face[i], ground[i], seen[i]
        for x in range(3):
            color[x] = own_color[k, x]
        if not is_painted[f]:
            kind = OWN_PART if has_material[f] else BARE_PART
            for x in range(3):
                place[x] = 0.0
            roughness, _, metalness = material_of(
                kind, place, up, 0.0, 0.0, 0.0, 0.0, color, True, own_orm[k, 1], own_orm[k, 2],
                palette, albedo, bump, slope, scratch,
            )  # fmt: skip
            for c in range(N_PLANES):
                planes[c, i] = 0.0
            for c in range(3):
                planes[RED + c, i] = albedo[c]
            planes[ROUGHNESS, i], planes[METALNESS, i] = roughness, metalness
            planes[OCCLUSION, i] = own_orm[k, 0]
            continue
        is_film = s >= 0
        t = metal_face[s] if is_film else g
        if is_film:
            b[1], b[2] = np.float64(seen_where[i, 0]), np.float64(seen_where[i, 1])
        else:
            b[1], b[2] = np.float64(where[i, 0]), np.float64(where[i, 1])
        b[0] = 1.0 - b[1] - b[2]
        dust, rust = 0.0, 0.0
        for x in range(3):
            place[x] = 0.0
        for corner in range(3):
            v = metal[t, corner]
            dust += b[corner] * metal_values[v, METAL_DUST]
            rust += b[corner] * metal_values[v, METAL_RUST]
            for x in range(3):
                place[x] += b[corner] * rest[v, x]
        stain, separated, since = 0.0, 1.0, age
        kind = METAL
        is_own = False
        if is_film:
            separated, since = 0.0, 0.0
            for corner in range(3):
                v = film_faces[s, corner]
                stain += b[corner] * film_values[v, STAIN]
                separated += b[corner] * film_values[v, HAS_SEPARATED]
                since += b[corner] * film_values[v, SEPARATED_FOR]
            kind = BACK if is_back[i] else FRONT
            is_own = kind == FRONT and shows_own[f]
            if not is_own:
                for x in range(3):
                    color[x] = paint[x]
        roughness, _, metalness = material_of(
            kind, place, up, stain, dust, rust, 1.0, color, is_own, own_orm[k, 1], own_orm[k, 2],
            palette, albedo, bump, slope, scratch,
        )  # fmt: skip
        occlusion = 1.0
        if is_own:
            veil = max(0.0, roughness - _CHALKY) / (0.95 - _CHALKY)
            roughness = own_orm[k, 1] + veil * (0.95 - own_orm[k, 1])
            metalness = own_orm[k, 2] * (1.0 - veil)
            occlusion = own_orm[k, 0]

        level, crack = -thickness, 0.0
        if is_film:
            level = np.float64(height[i])
            # the grooves of closed cracks, and the rounded edge towards bare metal
            edge, is_crack = _edge_distance(rest, metal, t, b, sides, s)
            width = max(groove, _LEAST_GROOVE * texel_size[f])
            if edge < width:
                depth = (1.0 - edge / width) * groove / width
                level -= thickness * depth
                if is_crack:
                    crack = depth
                for c in range(3):
                    albedo[c] += 0.75 * depth * (0.35 * palette[DUST, c] - albedo[c])
                occlusion *= 1.0 - 0.5 * depth
                roughness += 0.6 * depth * (0.95 - roughness)
            weight = min(1.0, np.float64(height[i]) / thickness)
            if weight > 0.0:
                _add_slope(f, weights[i], normals, film_normals[s], b, weight, is_back[i], n, normal, bump)
        elif covering[g] >= 0:
            # seen past film that is still there, but for what the smoothed outline leaves free
            over = covering[g]
            is_end = sides[over, 0] == END or sides[over, 1] == END or sides[over, 2] == END
            is_crack = sides[over, 0] == CRACK or sides[over, 1] == CRACK or sides[over, 2] == CRACK
            if is_crack or not is_end:
                crack = 1.0
        for c in range(3):
            planes[RED + c, i] = albedo[c]
            planes[SLOPE_X + c, i] = bump[c]
        planes[ROUGHNESS, i] = min(max(roughness, 0.0), 1.0)
        planes[METALNESS, i] = min(max(metalness, 0.0), 1.0)
        planes[OCCLUSION, i] = occlusion
        planes[BARE, i] = 0.0 if is_film or crack > 0.0 else 1.0
        planes[RUST, i] = rust if kind == METAL else (0.6 * rust if kind == BACK else stain)
        planes[DIRT, i] = dust
        planes[CRACKED, i] = crack
        planes[LIFT, i] = height[i] / highest if is_film and highest > 0.0 else 0.0
        planes[SEPARATED, i] = separated
        planes[AGE, i] = min(1.0, since / age) if age > 0.0 else 0.0
        planes[HEIGHT, i] = level


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
    steep = max(along, _STEEPEST)
    for x in range(3):
        slope[x] -= weight * (normal[x] - along * n[x]) / steep
