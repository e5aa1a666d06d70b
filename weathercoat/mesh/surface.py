"""`Surface`: a triangle mesh with what came with it, as it is handed from reading to remeshing to the
simulation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import Note
from weathercoat.mesh.buckets import compact_indices
from weathercoat.mesh.materials import SourceMaterial

Vectors = NDArray[np.float64]
Indices = NDArray[np.int32]

_ROWS = 8192  # faces at a time, so that what is worked out for them stays in the cache


@dataclass(frozen=True)
class Place:
    """Where the vertices of a surface lie on the surface that was read.

    face: int32 (n,), a face of the input; barycentric: float64 (n, 3), weights of its three corners, which
    sum to 1.
    """

    face: Indices
    barycentric: Vectors


@dataclass(frozen=True)
class Part:
    """What faces of the input belong to: a primitive of a node of glTF, or an object of another format.

    name: of the node or the object. material: a number in `Surface.materials`, or -1. node: the number of the
    node in the glTF document, or -1. matrix: from the node's axes to the model's, sixteen numbers row after
    row.
    """

    name: str
    material: int = -1
    node: int = -1
    matrix: tuple[float, ...] = (
        1.0,
        0.0,
        0.0,
        0.0,
        0.0,
        1.0,
        0.0,
        0.0,
        0.0,
        0.0,
        1.0,
        0.0,
        0.0,
        0.0,
        0.0,
        1.0,
    )


@dataclass(frozen=True)
class Surface:
    """A triangle mesh in the model's units.

    vertices: float64 (n, 3); faces: int32 (m, 3), counter-clockwise seen from outside. face_group: int32
    (m,), for each face an index into `groups`, the names of material groups or objects. uv: float64 (m, 3,
    2), a texture coordinate per corner of a face, v upwards (seams need no duplicate vertices), or None.
    colors: float64 (n, 4), the input's vertex colours (RGBA, 0 to 1), or None. up: unit vector (3,) against
    gravity, in the model's axes. notes: repairs that were made and what could not be kept. place: where each
    vertex lies on the input surface; None for the input itself. normals: float64 (m, 3, 3), the unit shading
    normal of each corner, or None where the input has none. face_part: int32 (m,), for each face an index
    into `parts`, or None where nothing is known of parts; materials: those of the parts. tree: the nodes of
    glTF that the parts name by number, with their names, transforms and children; empty for other formats.
    """

    vertices: Vectors
    faces: Indices
    face_group: Indices
    groups: tuple[str, ...] = ("default",)
    uv: Vectors | None = None
    colors: Vectors | None = None
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    notes: tuple[Note, ...] = ()
    place: Place | None = None
    normals: Vectors | None = None
    face_part: Indices | None = None
    parts: tuple[Part, ...] = ()
    materials: tuple[SourceMaterial, ...] = ()
    tree: tuple[Mapping[str, Any], ...] = ()
    name: str = "model"
    format: str = ""

    def face_areas(self) -> Vectors:
        """Area of each face, (m,)."""
        return face_areas(self.vertices, self.faces)

    def area(self) -> float:
        """Total area, in square units of the model."""
        return float(self.face_areas().sum())

    def size(self) -> float:
        """The length that relative lengths refer to: the square root of the area."""
        return float(np.sqrt(self.area()))

    def diagonal(self) -> float:
        """Diagonal of the bounding box of the vertices in use."""
        is_used = np.zeros(len(self.vertices), np.bool_)
        is_used[self.faces] = True
        used = self.vertices[is_used]
        return float(np.linalg.norm(used.max(axis=0) - used.min(axis=0)))

    def with_notes(self, *notes: Note) -> Surface:
        """The same surface with more notes."""
        return replace(self, notes=self.notes + notes)

    def select_faces(self, keep: NDArray[np.bool_]) -> Surface:
        """The surface of the faces where `keep` (m,) is true, without the vertices that no face uses any
        more.
        """
        faces = self.faces[keep]
        used, renumbered = compact_indices(faces, len(self.vertices))
        place = None if self.place is None else Place(self.place.face[used], self.place.barycentric[used])
        return replace(
            self,
            vertices=self.vertices[used],
            faces=renumbered,
            face_group=self.face_group[keep],
            uv=None if self.uv is None else self.uv[keep],
            colors=None if self.colors is None else self.colors[used],
            place=place,
            normals=None if self.normals is None else self.normals[keep],
            face_part=None if self.face_part is None else self.face_part[keep],
        )


def make_surface(vertices: Vectors, faces: Indices, **more: object) -> Surface:
    """A surface of plain arrays, in one group unless `face_group` and `groups` are given."""
    faces = np.ascontiguousarray(faces, dtype=np.int32)
    group = more.pop("face_group", None)
    return Surface(
        vertices=np.ascontiguousarray(vertices, dtype=np.float64),
        faces=faces,
        face_group=np.zeros(len(faces), np.int32) if group is None else np.asarray(group, np.int32),
        **more,  # type: ignore[arg-type]
    )


def face_normals(vertices: Vectors, faces: Indices) -> Vectors:
    """Normal of each face with twice its area as length, (m, 3)."""
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    return np.cross(b - a, c - a)


def face_areas(vertices: Vectors, faces: Indices) -> Vectors:
    """Area of each face, (m,)."""
    return 0.5 * np.linalg.norm(face_normals(vertices, faces), axis=1)


def vertex_normals(vertices: Vectors, faces: Indices) -> Vectors:
    """Angle-weighted unit normal of each vertex, (n, 3); zero where no face has an area.

    Source: Thuermer and Wuethrich, Computing vertex normals from polygonal facets, 1998.
    """
    weighted = np.empty((3, 3, len(faces)))  # by corner, axis and face
    for start in range(0, len(faces), _ROWS):
        rows = slice(start, start + _ROWS)
        corner = vertices[faces[rows]]
        side = [corner[:, (i + 1) % 3] - corner[:, i] for i in range(3)]
        normal = np.cross(side[0], -side[2])
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
        for i in range(3):
            a, b = side[i], -side[i - 1]
            angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
            weighted[i, :, rows] = (normal * angle[:, None]).T
    result = np.zeros_like(vertices)
    for i in range(3):
        for axis in range(3):
            result[:, axis] += np.bincount(faces[:, i], weighted[i, axis], len(vertices))
    length = np.linalg.norm(result, axis=1, keepdims=True)
    return np.divide(result, length, out=np.zeros_like(result), where=length > 0)
