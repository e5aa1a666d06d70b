"""What each texel shows, out of the state of film and metal there: colour, roughness, metalness, masks.

The look is that of pictures, by the same kernels at the same places, so that maps and pictures agree.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Indices, Vectors
from weathercoat.output.maps.planes import (
    AGE,
    BARE,
    CRACKED,
    DIRT,
    GROOVE,
    METALNESS,
    OCCLUSION,
    RED,
    ROUGHNESS,
    RUST,
    SEPARATED,
    SLOPE_X,
    Planes,
)  # fmt: skip
from weathercoat.output.shading import BACK, BARE_PART, DUST, FRONT, METAL, OWN_PART, material_of

# Columns of what belongs to film vertices, and to vertices of the metal.
STAIN, HAS_SEPARATED, SEPARATED_FOR = range(3)
METAL_DUST, METAL_RUST = range(2)

_CHALKY = 0.52  # the roughest clean paint, see `shading`: beyond it lie stains and dust
_CHALK = 0.95


@kernel
def dress(
    texels: NDArray[np.int64],
    face: Indices,
    is_painted: NDArray[np.bool_],
    has_material: NDArray[np.bool_],
    shows_own: NDArray[np.bool_],
    own_color: NDArray[np.float32],
    own_orm: NDArray[np.float32],
    ground: Indices,
    where: NDArray[np.float32],
    rest: Vectors,
    metal: Indices,
    metal_values: Vectors,
    seen: Indices,
    seen_where: NDArray[np.float32],
    is_back: NDArray[np.bool_],
    film_faces: Indices,
    metal_face: Indices,
    film_values: Vectors,
    age: float,
    paint: Vectors,
    palette: Vectors,
    up: Vectors,
    planes: Planes,
) -> None:
    """Fill the planes of colour, roughness, metalness, occlusion and masks at `texels` (k,), and add to the
    slopes that are there, see `relief.emboss`.

    is_painted, has_material (m,): of the input's faces; shows_own (m,): whether paint on them shows their
    material. own_color, own_orm (k, 3): what the materials show at the texels, linear. metal_values (n, 2),
    film_values (j, 3): by the columns above. paint (3,): the film's linear colour; palette: as in `shading`.
    The rest: of `raster`, `locate` and `film`, flat.
    """
    albedo, bump, slope, scratch = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    place, color, b = np.empty(3), np.empty(3), np.empty(3)
    for k in range(len(texels)):
        i = texels[k]
        f, g, s = face[i], ground[i], seen[i]
        for x in range(3):
            color[x], place[x] = own_color[k, x], 0.0
        dust, rust, stain, separated, since = 0.0, 0.0, 0.0, 0.0, 0.0
        is_own = True
        if is_painted[f]:
            kind = METAL if s < 0 else (BACK if is_back[i] else FRONT)
            t = g if s < 0 else metal_face[s]
            v, w = (where[i, 0], where[i, 1]) if s < 0 else (seen_where[i, 0], seen_where[i, 1])
            b[1], b[2] = np.float64(v), np.float64(w)
            b[0] = 1.0 - b[1] - b[2]
            for corner in range(3):
                at = metal[t, corner]
                dust += b[corner] * metal_values[at, METAL_DUST]
                rust += b[corner] * metal_values[at, METAL_RUST]
                for x in range(3):
                    place[x] += b[corner] * rest[at, x]
                if s >= 0:
                    at = film_faces[s, corner]
                    stain += b[corner] * film_values[at, STAIN]
                    separated += b[corner] * film_values[at, HAS_SEPARATED]
                    since += b[corner] * film_values[at, SEPARATED_FOR]
            if kind == METAL:
                separated, since = 1.0, age
            is_own = kind == FRONT and shows_own[f]
            if not is_own:
                for x in range(3):
                    color[x] = paint[x]
        else:
            kind = OWN_PART if has_material[f] else BARE_PART
        roughness, _, metalness = material_of(
            kind, place, up, stain, dust, rust, 1.0, color, is_own, own_orm[k, 1], own_orm[k, 2],
            palette, albedo, bump, slope, scratch,
        )  # fmt: skip
        if kind == FRONT and is_own:
            # the input's own under what lies on it
            veil = min(1.0, max(0.0, roughness - _CHALKY) / (_CHALK - _CHALKY))
            roughness = own_orm[k, 1] + veil * (_CHALK - own_orm[k, 1])
            metalness = own_orm[k, 2] * (1.0 - veil)
        groove = np.float64(planes[GROOVE, i])
        for c in range(3):
            planes[RED + c, i] = albedo[c] + 0.75 * groove * (0.35 * palette[DUST, c] - albedo[c])
            planes[SLOPE_X + c, i] += bump[c]
        planes[ROUGHNESS, i] = min(max(roughness + 0.6 * groove * (_CHALK - roughness), 0.0), 1.0)
        planes[METALNESS, i] = min(max(metalness, 0.0), 1.0)
        planes[OCCLUSION, i] = (own_orm[k, 0] if is_own else 1.0) * (1.0 - 0.5 * groove)
        planes[BARE, i] = 1.0 if kind == METAL and planes[CRACKED, i] == 0.0 else 0.0
        planes[RUST, i] = rust if kind == METAL else (0.6 * rust if kind == BACK else stain)
        planes[DIRT, i] = dust
        planes[SEPARATED, i] = separated
        planes[AGE, i] = min(1.0, since / age) if age > 0.0 else 0.0
