"""An order of vertices and faces that belongs to the shape, not to the file: along a space-filling curve.

Neighbours on the surface come to lie near each other in memory, and renumbering the input changes nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.buckets import order_codes, order_rows
from weathercoat.mesh.surface import Indices, Place, Surface, Vectors


def morton_codes(points: Vectors) -> NDArray[np.uint64]:
    """Position of each of the points (n, 3) along the Morton curve through their bounding cube, 21 bits an
    axis.
    """
    low = points.min(axis=0)
    extent = float((points.max(axis=0) - low).max()) or 1.0
    # rounded, not floored: grids and symmetric shapes have vertices on the bounds of halves, quarters and so
    # on, where a last bit would decide
    cell = np.minimum(np.rint((points - low) / extent * 2**21).astype(np.uint64), np.uint64(2**21 - 1))
    code = np.zeros(len(points), np.uint64)
    for axis in range(3):
        bits = cell[:, axis]
        for shift, mask in (
            (32, 0x1F00000000FFFF),
            (16, 0x1F0000FF0000FF),
            (8, 0x100F00F00F00F00F),
            (4, 0x10C30C30C30C30C3),
            (2, 0x1249249249249249),
        ):
            bits = (bits | (bits << np.uint64(shift))) & np.uint64(mask)
        code |= bits << np.uint64(axis)
    return code


def order_surface(surface: Surface, points: Vectors) -> tuple[Surface, Indices]:
    """The same surface with vertices and faces along the Morton curve of `points`, its vertices in any frame
    (n, 3).

    Faces begin with their smallest vertex. Also returned: for each new face the old one, int32 (m,).
    """
    order = order_points(points)
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    faces, turn = rank[surface.faces], np.empty(len(surface.faces), np.int8)
    _begin_with_smallest(faces, turn)
    turned = (turn[:, None, None] + np.arange(3)[:, None]) % 3
    face_order = order_rows(faces, len(points))
    place, face_part = surface.place, surface.face_part

    def corners(values: Vectors | None) -> Vectors | None:
        return None if values is None else np.take_along_axis(values, turned, axis=1)[face_order]

    ordered = replace(
        surface,
        vertices=surface.vertices[order],
        faces=faces[face_order],
        face_group=surface.face_group[face_order],
        uv=corners(surface.uv),
        normals=corners(surface.normals),
        face_part=None if face_part is None else face_part[face_order],
        colors=None if surface.colors is None else surface.colors[order],
        place=None if place is None else Place(place.face[order], place.barycentric[order]),
    )
    return ordered, face_order


@kernel
def _begin_with_smallest(faces: Indices, turn: NDArray[np.int8]) -> None:
    """Turn each of the faces (m, 3) so that it begins with its smallest vertex, by `turn` (m,) corners."""
    for f in range(len(faces)):
        a, b, c = faces[f]
        turn[f] = 0 if a <= b and a <= c else (1 if b <= c else 2)
        if turn[f] == 1:
            faces[f, 0], faces[f, 1], faces[f, 2] = b, c, a
        elif turn[f] == 2:
            faces[f, 0], faces[f, 1], faces[f, 2] = c, a, b


def order_points(points: Vectors) -> Indices:
    """Points (n, 3) along the curve, those of one code by their coordinates, and then as they come; (n,)."""
    code = morton_codes(points)
    order = order_codes(code)
    same = code[order[1:]] == code[order[:-1]]
    tied = np.flatnonzero(np.append(same, False) | np.append(False, same))
    if len(tied):
        chosen = order[tied]
        x, y, z = points[chosen].T
        order[tied] = chosen[np.lexsort((z, y, x, code[chosen]))]
    return order
