"""What `weathercoat inspect` tells of a surface: sizes, topology, sharp edges, groups, what it carries,
self-intersections.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.errors import Note
from weathercoat.mesh import topology
from weathercoat.mesh.buckets import order_codes
from weathercoat.mesh.charts import find_seams, number_charts
from weathercoat.mesh.surface import Surface, face_normals
from weathercoat.mesh.topology import cross, dot
from weathercoat.mesh.weld import first_at_place

SHARP_ANGLE = np.radians(30.0)
MAX_CELLS_PER_FACE = 8
"""The grid of the self-intersection test is as fine as this many cells for each face on average."""


def inspect_surface(surface: Surface, *, self_intersections: bool = False) -> dict[str, Any]:
    """Counts and measures of a surface, ready for JSON; lengths in the model's units.

    Edges are sharp where the normals of their two faces differ by more than 30 degrees. With
    `self_intersections`, which takes several times as long as reading, the notes include W-SELFINT with the
    number of faces that cut through others.
    """
    vertices, faces = surface.vertices, surface.faces
    twin, crowded = topology.match_twins(vertices, faces)
    _, parent = topology.split_vertices(len(vertices), faces, twin)
    pinched = len(parent) - len(vertices)
    orientation = topology.orient(vertices, faces, twin)
    corner = vertices[faces]
    half = np.arange(3 * len(faces))
    once = half > twin
    length = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2).ravel()[once]
    edges = int(once.sum())
    boundary = int((twin < 0).sum())
    manifold = len(crowded) == 0 and pinched == 0
    areas = surface.face_areas()
    notes = list(surface.notes)
    if self_intersections:
        count = int(self_intersecting_faces(vertices, faces).sum())
        if count:
            notes.append(Note("W-SELFINT", count, "faces cut through others"))
    low, high = corner.reshape(-1, 3).min(axis=0), corner.reshape(-1, 3).max(axis=0)
    return {
        "name": surface.name,
        "format": surface.format,
        "up": list(surface.up),
        "faces": len(faces),
        "vertices": len(vertices),
        "edges": edges,
        "components": int(orientation.component.max(initial=-1)) + 1,
        "boundary_edges": boundary,
        "boundary_loops": topology.count_boundary_loops(faces, twin),
        "euler_number": len(vertices) - edges + len(faces),
        "manifold": manifold,
        "watertight": manifold and boundary == 0,
        "area": float(areas.sum()),
        "size": surface.size(),
        "bounding_box": [low.tolist(), high.tolist()],
        "edge_length": {
            "min": float(length.min()),
            "median": float(np.median(length)),
            "mean": float(length.mean()),
            "max": float(length.max()),
            "variation": float(length.std() / length.mean()),
        },
        "sharp_edge_share": _sharp_share(vertices, faces, twin),
        "groups": [
            {
                "name": name,
                "faces": int((surface.face_group == i).sum()),
                "area": float(areas[surface.face_group == i].sum()),
            }
            for i, name in enumerate(surface.groups)
        ],
        "has_uv": surface.uv is not None,
        "texture": _texture_facts(surface, twin),
        "has_colors": surface.colors is not None,
        "has_normals": surface.normals is not None,
        "materials": [
            {
                "name": material.name,
                "textures": len(material.textures),
                "has_base_texture": material.base_texture is not None,
            }
            for material in surface.materials
        ],
        "parts": [
            {"name": part.name, "faces": faces_of}
            for part, faces_of in zip(surface.parts, _count_parts(surface), strict=True)
        ],
        "notes": [{"code": note.code, "count": note.count, "message": note.message} for note in notes],
    }


def _texture_facts(surface: Surface, twin: NDArray[np.int32]) -> dict[str, Any] | None:
    """Charts of the texture coordinates, and the seams between them: edges, length in the model's units."""
    if surface.uv is None:
        return None
    seams = find_seams(surface.uv, twin)
    once = np.flatnonzero(seams & (np.arange(len(twin)) > twin))
    tail = surface.faces.reshape(-1)[once]
    head = np.roll(surface.faces, -1, axis=1).reshape(-1)[once]
    length = np.linalg.norm(surface.vertices[head] - surface.vertices[tail], axis=1)
    return {
        "charts": int(number_charts(surface.faces, twin, seams).max(initial=-1)) + 1,
        "seam_edges": len(once),
        "seam_length": float(length.sum()),
    }


def _count_parts(surface: Surface) -> list[int]:
    """Faces of each part."""
    if surface.face_part is None:
        return [0] * len(surface.parts)
    count: list[int] = np.bincount(surface.face_part, minlength=len(surface.parts)).tolist()
    return count


def _sharp_share(vertices: NDArray[np.float64], faces: NDArray[np.int32], twin: NDArray[np.int32]) -> float:
    """Share of the inner edges whose faces meet at more than `SHARP_ANGLE`."""
    inner = np.flatnonzero(twin > np.arange(len(twin)))
    if not len(inner):
        return 0.0
    normal = face_normals(vertices, faces)
    one, other = normal[inner // 3], normal[twin[inner] // 3]
    sine = np.linalg.norm(np.cross(one, other), axis=1)
    cosine = np.einsum("ij,ij->i", one, other)
    return float((np.arctan2(sine, cosine) > SHARP_ANGLE).mean())


def self_intersecting_faces(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Whether each face, (m,), cuts another or is cut by it.

    Two faces cut each other where an edge of one passes through the inside of the other; faces that share
    an edge, only touch, or overlap in one plane do not count. A grid of cells about as large as the faces
    finds the candidates.
    """
    corner = vertices[faces]
    low, high = corner.min(axis=1), corner.max(axis=1)
    origin = low.min(axis=0)
    extent = np.maximum(high.max(axis=0) - origin, np.finfo(float).tiny)
    position = first_at_place(vertices, np.zeros(len(vertices), np.int64))
    cell = float(np.mean((high - low).max(axis=1)))
    while True:
        first = np.floor((low - origin) / cell).astype(np.int64)
        last = np.floor((high - origin) / cell).astype(np.int64)
        covered = np.prod(last - first + 1, axis=1)
        if covered.sum() <= MAX_CELLS_PER_FACE * len(faces):
            break
        cell *= 1.5
    shape = np.floor(extent / cell).astype(np.int64) + 1
    key = np.empty(int(covered.sum()), np.int64)
    member = np.empty(len(key), np.int64)
    _enter_cells(first, last, shape, key, member)
    order = order_codes(key.view(np.uint64))
    hit = np.zeros(len(faces), np.bool_)
    _test_cells(corner, position[faces], low, high, first, key[order], member[order], shape, hit)
    return hit


@kernel
def _enter_cells(first, last, shape, key, member):  # type: ignore[no-untyped-def]
    """Every cell that the box of each face covers, as one number, with the face."""
    k = 0
    for f in range(len(first)):
        for a in range(first[f, 0], last[f, 0] + 1):
            for b in range(first[f, 1], last[f, 1] + 1):
                for c in range(first[f, 2], last[f, 2] + 1):
                    key[k] = (a * shape[1] + b) * shape[2] + c
                    member[k] = f
                    k += 1


@kernel
def _test_cells(corner, position, low, high, first, key, member, shape, hit):  # type: ignore[no-untyped-def]
    """Mark the faces that cut another of their cell; a pair is tested in the first cell that both cover."""
    begin = 0
    while begin < len(key):
        end = begin + 1
        while end < len(key) and key[end] == key[begin]:
            end += 1
        for i in range(begin, end):
            for j in range(begin, i):
                f, g = member[i], member[j]
                if hit[f] and hit[g]:
                    continue
                apart = False
                for k in range(3):
                    apart = apart or low[f, k] > high[g, k] or low[g, k] > high[f, k]
                if apart:
                    continue
                shared, corner_f, corner_g = 0, -1, -1
                for k in range(9):
                    if position[f, k // 3] == position[g, k % 3]:
                        shared += 1
                        corner_f, corner_g = k // 3, k % 3
                if shared > 1:
                    continue
                common = 0
                for k in range(3):
                    common = common * shape[k] + max(first[f, k], first[g, k])
                if common == key[begin] and (
                    _cuts(corner[f], corner[g], corner_f) or _cuts(corner[g], corner[f], corner_g)
                ):
                    hit[f] = True
                    hit[g] = True
        begin = end


@kernel
def _cuts(a, b, shared):  # type: ignore[no-untyped-def]
    """Whether an edge of triangle `a` (3, 3), but none at its corner `shared` (or -1), passes through `b`.

    The ends of the edge must lie on different sides of the plane, and its line pass the three edges of `b`
    on the same side; each is the sign of a volume.
    """
    normal = cross(b[1] - b[0], b[2] - b[0])
    height = np.empty(3)
    for i in range(3):
        height[i] = dot(normal, a[i] - b[0])
    for i in range(3):
        j = (i + 1) % 3
        if i == shared or j == shared or height[i] * height[j] >= 0:
            continue
        along = a[j] - a[i]
        left = right = 0
        for k in range(3):
            volume = dot(along, cross(b[k] - a[i], b[(k + 1) % 3] - a[i]))
            left += volume > 0
            right += volume < 0
        if left == 3 or right == 3:
            return True
    return False
