"""Texture coordinates for a model that has none, or none that maps can be made on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from weathercoat.errors import UsageError
from weathercoat.mesh.surface import Surface


def make_atlas(surface: Surface, *, size: int, padding: int) -> Surface:
    """The surface with charts of its own in one square, `padding` texels apart in pictures of `size` texels;
    without materials, whose textures lie elsewhere.

    Raises UsageError where xatlas is not installed, or lays out nothing.
    """
    require_atlas()
    import xatlas

    atlas = xatlas.Atlas()
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    points = (surface.vertices - 0.5 * (low + high)) / (high - low).max()  # for its single precision
    atlas.add_mesh(points.astype(np.float32), surface.faces.astype(np.uint32))
    pack = xatlas.PackOptions()
    pack.resolution, pack.padding = size, padding
    pack.rotate_charts = False  # it turns charts by exchanging u and v, and so mirrors them
    atlas.generate(xatlas.ChartOptions(), pack, False)
    vertex, corner, uv = atlas[0]
    if not np.array_equal(vertex[corner], surface.faces):
        raise UsageError("no atlas could be laid out", file=surface.name, remedy="repair the model")
    placed = uv.astype(np.float64)[corner]
    parts = tuple(replace(part, material=-1) for part in surface.parts)
    return replace(surface, uv=placed, parts=parts, materials=())


def require_atlas() -> None:
    """Raise UsageError where no atlas can be laid out."""
    try:
        import xatlas  # noqa: F401
    except ImportError as error:
        raise UsageError(
            "an atlas needs the package xatlas", remedy="pip install 'weathercoat[atlas]'"
        ) from error
