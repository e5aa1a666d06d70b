"""What the materials of the input show at texels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Indices, Surface, Vectors
from weathercoat.output.maps.film import FilmCover
from weathercoat.output.materials import Material, face_materials, film_materials, read_material
from weathercoat.output.shading import to_linear
from weathercoat.output.texels import Footprint, Texels

Floats = NDArray[np.float32]


class OwnLook:
    """The materials of a surface, decoded: what unpainted faces show, and paint that has their look.

    material int32 (m,): of each face, -1 for none; shows bool (m,): whether paint on it shows that, see
    `materials.film_materials` on `look`. Raises CorruptError where a texture cannot be decoded.
    """

    def __init__(self, surface: Surface, is_painted: NDArray[np.bool_], look: str) -> None:
        self.surface = surface
        self.material = face_materials(surface)
        self.shows = film_materials(surface, look) >= 0
        has_normals = np.array(["normalTexture" in each.entry for each in surface.materials] + [False])
        self._is_wanted = (self.shows | ~is_painted | has_normals[self.material]) & (self.material >= 0)
        used = np.unique(self.material[self._is_wanted])
        self._materials = {int(i): read_material(surface.materials[i]) for i in used}
        colors = surface.colors
        self._colors = None if colors is None else np.asarray(to_linear(colors[:, :3]), np.float64)

    def at(
        self,
        face: Indices,
        weights: Floats,
        texel: tuple[float, float],
        moved: tuple[NDArray[np.int64], Vectors] | None,
    ) -> tuple[Floats, Floats, Floats]:
        """Colour (k, 3), linear, occlusion, roughness and metalness (k, 3), and the tilt of the normal by
        tangent and bitangent (k, 2), at places on faces (k,) with `weights` (k, 2); white, open, rough, no
        metal and flat where a face has no material.

        texel: width and height of what a place covers in texture space. moved: places that show other
        texture coordinates than their own, and these (j, 2).
        """
        color = np.ones((len(face), 3), np.float32)
        orm = np.tile(np.array([1.0, 1.0, 0.0], np.float32), (len(face), 1))
        tilt = np.zeros((len(face), 2), np.float32)
        if self._materials:
            uv = interpolated(self.surface.uv, face, weights) if self.surface.uv is not None else None
            if uv is not None and moved is not None:
                uv[moved[0]] = moved[1]
            of_place = np.where(self._is_wanted, self.material, -1)[face]
            for number, material in self._materials.items():
                chosen = np.flatnonzero(of_place == number)
                if len(chosen) and uv is not None:
                    place = _footprint(uv[chosen], texel)
                    color[chosen], orm[chosen] = _shown(material, place)
                    tilt[chosen] = _tilt(material, place)
        if moved is not None:
            tilt[moved[0]] = 0.0
        if self._colors is not None:
            color *= interpolated(self._colors[self.surface.faces], face, weights).astype(np.float32)
        return color, orm, tilt


def moved_places(
    film: FilmCover, uv: Vectors | None, seen: Indices, seen_where: Floats
) -> tuple[NDArray[np.int64], Vectors] | None:
    """The texels, of those that show the film faces `seen` (k,), whose film has moved, and the texture
    coordinates of where it was, of the metal's `uv` (t, 3, 2); None where it has none.
    """
    if uv is None or len(film.faces) == 0:
        return None
    moved = np.flatnonzero((seen >= 0) & film.has_moved[seen])
    return moved, interpolated(uv, film.metal_face[seen[moved]], seen_where[moved])


def interpolated(values: Vectors, face: Indices, weights: Floats) -> Vectors:
    """Values of the corners of faces, (m, 3, j), at places (k,); (k, j)."""
    v, w = weights[:, :1].astype(np.float64), weights[:, 1:].astype(np.float64)
    result: Vectors = (1.0 - v - w) * values[face, 0] + v * values[face, 1] + w * values[face, 2]
    return result


def _footprint(uv: Vectors, texel: tuple[float, float]) -> Footprint:
    across, down = np.zeros_like(uv), np.zeros_like(uv)
    across[:, 0], down[:, 1] = texel
    return Footprint(uv * (1.0, -1.0) + (0.0, 1.0), across, down)


def _tilt(material: Material, place: Footprint) -> Floats | float:
    if material.normal is None:
        return 0.0
    normal = 2.0 * material.normal.at(place) - 1.0
    tilt: Floats = material.normal_scale * normal[:, :2] / np.maximum(normal[:, 2:], 0.1)
    return tilt


def _shown(material: Material, place: Footprint) -> tuple[Floats, Floats]:
    def means(texels: Texels | None) -> Floats | float:
        return 1.0 if texels is None else texels.at(place)

    count = len(place.uv)
    color = np.broadcast_to(np.asarray(material.color, np.float32) * means(material.base), (count, 3))
    orm = np.empty((count, 3), np.float32)
    occlusion, rest = means(material.occlusion), np.broadcast_to(means(material.orm), (count, 3))
    orm[:, 0] = 1.0
    if not isinstance(occlusion, float):
        orm[:, 0] = 1.0 - material.occlusion_strength * (1.0 - occlusion[:, 0])
    orm[:, 1], orm[:, 2] = material.roughness * rest[:, 1], material.metallic * rest[:, 2]
    return color.astype(np.float32), orm
