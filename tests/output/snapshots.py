"""Small snapshots and surfaces made for the tests of this room."""

from __future__ import annotations

import numpy as np

from weathercoat.mesh.surface import Surface, make_surface, vertex_normals
from weathercoat.sim.snapshot import Snapshot

CELLS = 4


def make_sheet(cells: int = CELLS) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of the square from 0 to 1 in x and z, facing +y, in 2 · cells² triangles."""
    line = np.linspace(0.0, 1.0, cells + 1)
    x, z = np.meshgrid(line, line, indexing="ij")
    vertices = np.column_stack([x.ravel(), np.zeros(x.size), z.ravel()])
    corner = np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)[None, :]
    a, b, c, d = (part.ravel() for part in (corner, corner + 1, corner + cells + 2, corner + cells + 1))
    return vertices, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]).astype(np.int32)


def make_snapshot(
    *,
    cells: int = CELLS,
    mesh: tuple[np.ndarray, np.ndarray] | None = None,
    lost: int = 0,
    split_column: int | None = None,
    step: int = 100,
    age: float = 0.5,
    offset: float = 0.0,
) -> Snapshot:
    """A snapshot of the sheet above, or of another mesh, which cannot be split.

    The first `lost` faces have fallen. With `split_column` the film is cut along the grid line of that
    number, and the part behind the cut is separated and lifted. Scalars and colours differ from vertex to
    vertex.
    """
    vertices, faces = mesh or make_sheet(cells)
    vertices = vertices + offset
    film_vertices, film_faces = vertices.copy(), faces.copy()
    origin = np.arange(len(vertices), dtype=np.int32)
    behind = np.zeros(len(vertices), np.bool_)
    if split_column is not None:
        column = origin // (cells + 1)
        on_line = np.flatnonzero(column == split_column)
        copies = np.arange(len(vertices), len(vertices) + len(on_line))
        moved = column[faces].max(axis=1) > split_column
        renamed = origin.copy()
        renamed[on_line] = copies
        film_faces[moved] = renamed[film_faces[moved]]
        origin = np.concatenate([origin, on_line]).astype(np.int32)
        film_vertices = vertices[origin]
        behind = np.concatenate([column > split_column, np.ones(len(on_line), np.bool_)])
        film_vertices[behind, 1] += 0.1
    film_face = np.arange(lost, len(faces), dtype=np.int32)
    film_faces = film_faces[lost:]
    used, renumbered = np.unique(film_faces, return_inverse=True)
    film, metal = len(used), len(vertices)
    return Snapshot(
        step=step,
        age=age,
        film_vertices=film_vertices[used],
        film_faces=renumbered.reshape(-1, 3).astype(np.int32),
        film_face=film_face,
        film_origin=origin[used],
        film_rust=np.linspace(0.0, 0.9, film),
        separated=behind[used],
        separation_age=np.where(behind[used], 0.25, 0.0),
        adhesion=np.linspace(0.5, 1.5, film),
        film_color=np.column_stack([np.linspace(0, 1, film), np.full(film, 0.2), np.full(film, 0.5)]),
        substrate_vertices=vertices,
        substrate_normals=vertex_normals(vertices, faces),
        substrate_faces=faces,
        substrate_rust=np.linspace(1.0, 0.1, metal),
        dust=np.linspace(0.0, 0.3, metal),
        bare=~np.isin(np.arange(metal), origin[used]),
        substrate_color=np.column_stack([np.full(metal, 0.4), np.linspace(0, 1, metal), np.full(metal, 0.1)]),
    )


def make_grouped_surface() -> Surface:
    """The sheet in two halves, with texture coordinates that have a seam between them, and vertex colours."""
    vertices, faces = make_sheet(2)
    group = (vertices[faces][:, :, 0].mean(axis=1) > 0.5).astype(np.int32)
    uv = vertices[faces][:, :, [0, 2]] + group[:, None, None]
    colors = np.column_stack([vertices[:, [0, 2]], np.full(len(vertices), 0.5), np.ones(len(vertices))])
    return make_surface(vertices, faces, face_group=group, groups=("body", "tyre left"), uv=uv, colors=colors)
