"""Meshes as sheets for glTF, which has one normal and one texture coordinate a vertex and linear colours."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from weathercoat.mesh.surface import Indices, Surface, Vectors
from weathercoat.output.glb import Material, Node, Sheet
from weathercoat.output.shell import corner_normals

# Metal that bends by more than this between two faces shows an edge.
METAL_CREASE = float(np.radians(40.0))


def make_sheet(
    material: Material,
    vertices: Vectors,
    faces: Indices,
    *,
    crease: float,
    colors: Vectors | None = None,
    uv: Vectors | None = None,
    scalars: Mapping[str, NDArray[Any]] | None = None,
    normals: Vectors | None = None,
    role: str = "",
    part: int = -1,
    piece: int = 0,
) -> Sheet:
    """A sheet with its normals: smooth, but split where faces meet by more than `crease` [rad].

    colors (n, 3), linear, and scalars (n,) belong to vertices; uv (m, 3, 2) to corners, and splits vertices
    at its seams; so do normals (m, 3, 3), where they are given.
    """
    values = corner_normals(vertices, faces, crease).astype(np.float64) if normals is None else normals
    if uv is not None:
        values = np.concatenate([values, uv], axis=2)
    faces, source, values = split_corners(faces, values, len(vertices))
    return Sheet(
        material,
        vertices[source],
        faces,
        normals=values[:, :3],
        colors=None if colors is None else colors[source],
        uv=None if uv is None else values[:, 3:],
        scalars={name: scalar[source] for name, scalar in (scalars or {}).items()},
        role=role,
        part=part,
        piece=piece,
    )


def split_corners(faces: Indices, values: Vectors, count: int) -> tuple[Indices, NDArray[np.intp], Vectors]:
    """Split `count` vertices so that each has one value, of those given for the corners of faces, (m, 3, j).

    Returns the faces (m, 3), the vertex that each of the k new vertices stems from (k,), and their values (k,
    j). The first `count` keep their numbers; most have one value only, so the search for equal ones takes but
    the rest.
    """
    corner = faces.reshape(-1).astype(np.intp)
    rows = values.reshape(len(corner), values.shape[2])
    kept = np.zeros((count, rows.shape[1]))
    kept[corner] = rows
    odd = np.flatnonzero((kept[corner] != rows).any(axis=1))
    extra, first, number = np.unique(
        np.column_stack([corner[odd], rows[odd]]), axis=0, return_index=True, return_inverse=True
    )
    source = np.concatenate([np.arange(count), corner[odd][first]])
    corner[odd] = count + number.reshape(-1)
    return corner.reshape(-1, 3).astype(np.int32), source, np.concatenate([kept, extra[:, 1:]])


def surface_nodes(surface: Surface) -> list[Node]:
    """One node for each group of the surface that has faces, in its vertex colours or else a neutral grey."""
    nodes = []
    for number, name in enumerate(surface.groups):
        chosen = surface.face_group == number
        if not chosen.any():
            continue
        group = surface.select_faces(chosen)
        colors = None if group.colors is None else srgb_to_linear(group.colors[:, :3])
        shade = 1.0 if colors is not None else 0.5
        material = Material(name, metallic=0.0, roughness=0.6, double_sided=True, base_color=(shade,) * 3)
        sheet = make_sheet(
            material, group.vertices, group.faces, crease=METAL_CREASE, colors=colors, uv=group.uv
        )
        nodes.append(Node(name, [sheet]))
    return nodes


def srgb_to_linear(colors: ArrayLike) -> Vectors:
    """Linear values of sRGB values 0 to 1 (IEC 61966-2-1)."""
    value = np.clip(np.asarray(colors, np.float64), 0.0, 1.0)
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
