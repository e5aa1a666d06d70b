"""Which faces become which square of texture space: sets of maps by material, tiles of UDIM, and what is odd
about the texture coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import TextureCoordinatesError
from weathercoat.mesh.surface import Indices, Surface, Vectors
from weathercoat.output.maps.raster import rasterise, texel_corners
from weathercoat.output.materials import face_materials

FIRST_TILE = 1001
_COLUMNS = 10  # of UDIM
_BEYOND = 1e-3  # how far a face may reach over the edge of its tile: exporters round
_PROBE = 256  # texels of a side, to see whether materials share texture space
_SHARED = 0.02  # share of texels in common from which materials get maps of their own


@dataclass(frozen=True)
class Tile:
    """A square of texture space: one picture of each map.

    name: of the set it belongs to, empty where there is one set; number: by UDIM, 1001 + u + 10 v. faces:
    int32 (k,), of the surface, rising; uv (k, 3, 2): their texture coordinates within the square, v upwards.
    """

    name: str
    number: int
    faces: Indices
    uv: Vectors


@dataclass(frozen=True)
class Layout:
    """All tiles of a surface; is_udim: whether there are others than the first."""

    tiles: tuple[Tile, ...]
    is_udim: bool


def make_layout(surface: Surface) -> Layout:
    """The tiles of a surface.

    Materials that show the same square of texture space, each with its own picture, get a set of maps each.
    Raises TextureCoordinatesError where there are none, or a face lies in several tiles or beyond UDIM's.
    """
    if surface.uv is None:
        raise TextureCoordinatesError("the model has no texture coordinates", file=surface.name)
    low = np.floor(surface.uv.mean(axis=1))
    local = surface.uv - low[:, None]
    crossing = np.flatnonzero(((local < -_BEYOND) | (local > 1.0 + _BEYOND)).any(axis=(1, 2)))
    if len(crossing):
        raise TextureCoordinatesError(
            f"{len(crossing):,} faces show more than one tile of texture space: their texture repeats",
            file=surface.name,
        )
    if (low < 0).any() or (low[:, 0] >= _COLUMNS).any():
        u, v = low[((low < 0).any(axis=1) | (low[:, 0] >= _COLUMNS)).argmax()].astype(int)
        raise TextureCoordinatesError(
            f"faces lie in the square {u}, {v} of texture space; tiles are in columns 0 to 9, rows from 0",
            file=surface.name,
        )
    number = (FIRST_TILE + low[:, 0] + _COLUMNS * low[:, 1]).astype(np.int64)
    local = np.clip(local, 0.0, 1.0)
    sets = _face_sets(surface, number, local)
    tiles = []
    for name, chosen in sets:
        for tile in np.unique(number[chosen]):
            faces = np.flatnonzero(chosen & (number == tile)).astype(np.int32)
            tiles.append(Tile(name, int(tile), faces, np.ascontiguousarray(local[faces])))
    return Layout(tuple(tiles), bool((number != FIRST_TILE).any()))


def _face_sets(
    surface: Surface, number: NDArray[np.int64], uv: Vectors
) -> list[tuple[str, NDArray[np.bool_]]]:
    """The faces (m,) of each set of maps, with its name."""
    material = face_materials(surface)
    used = np.unique(material)
    everything = [("", np.ones(len(material), np.bool_))]
    if len(used) < 2 or not _share_space(material, number, uv):
        return everything
    names: list[str] = []
    for i in used:
        given = surface.materials[i].name if i >= 0 else ""
        name = (
            "".join(c if c.isalnum() or c in "-+" else "_" for c in given).strip("_") or f"material_{i + 1}"
        )
        names.append(name if name.lower() not in [n.lower() for n in names] else f"{name}_{i + 1}")
    return [(name, material == i) for name, i in zip(names, used, strict=True)]


def _share_space(material: Indices, number: NDArray[np.int64], uv: Vectors) -> bool:
    """Whether texels are claimed by faces of several materials, beyond what lies at the edges of charts."""
    shared, claimed = 0, 0
    for tile in np.unique(number):
        count = np.zeros((_PROBE, _PROBE), np.int64)
        for i in np.unique(material[number == tile]):
            corner = texel_corners(uv[(number == tile) & (material == i)], _PROBE, _PROBE)
            face = np.full((_PROBE, _PROBE), -1, np.int32)
            weights = np.empty((_PROBE, _PROBE, 2), np.float32)
            rasterise(corner, 0, face, weights, np.zeros((_PROBE, _PROBE), np.uint8))
            count += face >= 0
        shared += int((count > 1).sum())
        claimed += int((count > 0).sum())
    return shared > _SHARED * claimed


def uv_areas(uv: Vectors) -> Vectors:
    """Signed area of faces in texture space, (k,); negative where the texture is shown mirrored."""
    p, q = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return 0.5 * (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])


def describe(surface: Surface, layout: Layout) -> dict[str, Any]:
    """What is odd about the texture coordinates, as counts and shares of faces."""
    areas = np.concatenate([uv_areas(tile.uv) for tile in layout.tiles])
    return {
        "faces": len(areas),
        "mirrored_faces": int((areas < 0).sum()),
        "faces_without_area": int((areas == 0).sum()),
    }
