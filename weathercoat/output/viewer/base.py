"""What the film of a page shows before it ages: the model's own materials, at each vertex of the metal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Indices, Surface, Vectors
from weathercoat.output.materials import Material, film_materials, read_material
from weathercoat.output.shading import to_linear, to_srgb
from weathercoat.output.texels import Footprint


def base_colors(
    surface: Surface | None, look: str, paint: tuple[float, float, float]
) -> NDArray[np.uint8] | None:
    """The colour of the film over each vertex (n, 3), sRGB bytes; None where all of it shows its paint.

    A texture gives its mean over a face at the vertex, so detail finer than the mesh is not seen. look: as
    for `film_materials`; paint: sRGB, 0 to 1. Raises CorruptError where a picture cannot be decoded.
    """
    if surface is None or not surface.materials:
        return None
    shown = film_materials(surface, look)
    if not (shown >= 0).any():
        return None
    corner = np.zeros(len(surface.vertices), np.int64)
    corner[surface.faces.ravel()] = np.arange(surface.faces.size)
    material = shown[corner // 3]
    color = np.tile(np.asarray(to_linear(paint), np.float64), (len(corner), 1))
    for number in np.unique(material[material >= 0]).tolist():
        chosen = np.flatnonzero(material == number)
        own = read_material(surface.materials[number], only_color=True)
        color[chosen] = _colors(surface, own, corner[chosen])
        if surface.colors is not None:
            color[chosen] *= to_linear(surface.colors[chosen, :3])
    return to_srgb(color)


def _colors(surface: Surface, material: Material, corner: Indices | NDArray[np.int64]) -> Vectors:
    """Linear colours (k, 3) of a material at corners (k,) of faces."""
    color = np.tile(np.asarray(material.color, np.float64), (len(corner), 1))
    if material.base is None or surface.uv is None:
        return color
    flipped = surface.uv * (1.0, -1.0) + (0.0, 1.0)  # the footprint's origin is at the upper left
    span = 0.5 * np.ptp(flipped[corner // 3], axis=1)
    across, down = np.zeros((len(corner), 2)), np.zeros((len(corner), 2))
    across[:, 0], down[:, 1] = span[:, 0], span[:, 1]
    places = flipped.reshape(-1, 2)[corner]
    return color * material.base.at(Footprint(places, across, down))[:, :3]
