"""`Polygons`: what a file says, before anything is repaired."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import CorruptError, Note
from weathercoat.mesh.materials import SourceMaterial
from weathercoat.mesh.surface import Part


@dataclass
class Polygons:
    """The faces of a file as polygons with per-corner data.

    positions: float64 (n, 3).
    corners: int64 (k,), the vertex of each corner, face after face; sizes: int64 (m,), corners of each face.
    uv: float64 (k, 2), a texture coordinate per corner, or None.
    face_group: int32 (m,), an index into `groups`.
    colors: float64 (n, 4), RGBA from 0 to 1, sRGB-encoded, or None.
    normals: float64 (k, 3), a unit shading normal per corner, zero where it has none, or None.
    face_part: int32 (m,), an index into `parts`, or None; materials and tree: see `Surface`.
    part: int64 (n,), vertices of different parts (instances, nodes) are never welded; or None.
    single_precision: positions are stored as float32, so that equal points may differ by its rounding.
    shared: faces of this format share their vertices by index, so that a repeated position is worth a note.
    """

    positions: NDArray[np.float64]
    corners: NDArray[np.int64]
    sizes: NDArray[np.int64]
    uv: NDArray[np.float64] | None = None
    face_group: NDArray[np.int32] | None = None
    groups: tuple[str, ...] = ("default",)
    colors: NDArray[np.float64] | None = None
    normals: NDArray[np.float64] | None = None
    face_part: NDArray[np.int32] | None = None
    parts: tuple[Part, ...] = ()
    materials: tuple[SourceMaterial, ...] = ()
    tree: tuple[Mapping[str, Any], ...] = ()
    part: NDArray[np.int64] | None = None
    single_precision: bool = False
    shared: bool = True
    notes: list[Note] = field(default_factory=list)

    def drop_illegal(self) -> None:
        """Drop the faces with a negative index, with a note; refuse an index beyond the last vertex.

        Errors: CorruptError, which names the face (counted from 0) and the index.
        """
        beyond = np.flatnonzero(self.corners >= len(self.positions))
        if len(beyond):
            corner = beyond[0]
            face = int(np.searchsorted(np.cumsum(self.sizes), corner, side="right"))
            raise CorruptError(
                f"face {face} (counted from 0) has index {self.corners[corner]}, "
                f"but there are {len(self.positions)} vertices"
            )
        illegal = self.corners < 0
        if not illegal.any():
            return
        face_of_corner = np.repeat(np.arange(len(self.sizes)), self.sizes)
        keep = np.ones(len(self.sizes), bool)
        keep[face_of_corner[illegal]] = False
        self.keep_faces(keep)
        dropped = int((~keep).sum())
        self.notes.append(Note("W-BADINDEX", dropped, "faces with an illegal index were dropped"))

    def tidy_attributes(self) -> None:
        """Make texture coordinates and colours zero where they are not finite, with a note; clip colours, and
        give normals the length 1, or 0 where they have none.
        """
        for values, name in ((self.uv, "texture coordinates"), (self.colors, "colours")):
            broken = None if values is None else np.logical_not(np.isfinite(values).all(axis=1))
            if values is not None and broken is not None and broken.any():
                values[broken] = 0.0
                text = f"{name} are not finite and were set to zero"
                self.notes.append(Note("W-NONFINITE", int(broken.sum()), text))
        if self.normals is not None:
            with np.errstate(invalid="ignore", over="ignore"):
                length = np.linalg.norm(self.normals, axis=1, keepdims=True)
                self.normals = self.normals / length
            self.normals[~np.isfinite(self.normals).all(axis=1)] = 0.0
        if self.colors is not None:
            np.clip(self.colors, 0.0, 1.0, out=self.colors)

    def keep_faces(self, keep: NDArray[np.bool_]) -> None:
        """Drop the faces where `keep` (m,) is false."""
        keep_corner = np.repeat(keep, self.sizes)
        self.corners = self.corners[keep_corner]
        self.sizes = self.sizes[keep]
        if self.uv is not None:
            self.uv = self.uv[keep_corner]
        if self.normals is not None:
            self.normals = self.normals[keep_corner]
        if self.face_part is not None:
            self.face_part = self.face_part[keep]
        if self.face_group is not None:
            self.face_group = self.face_group[keep]
