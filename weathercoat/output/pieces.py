"""Loose pieces of film, and other stretches of faces that hang together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.pairing import pair_half_edges
from weathercoat.mesh.surface import Indices, Vectors, face_areas
from weathercoat.mesh.topology import number_components
from weathercoat.output.condition import LIFTED, film_classes
from weathercoat.sim.snapshot import Snapshot


def number_flakes(snapshot: Snapshot) -> Indices:
    """The flake of each face of the film, int32 (m,), as `number_pieces` numbers lifted film.

    Lifted faces across an unbroken edge are one flake, so a flap that still hangs on the film beside it is
    one as well, up to that film.
    """
    return number_pieces(snapshot.film_faces, film_classes(snapshot) == LIFTED)


def number_pieces(faces: Indices, chosen: NDArray[np.bool_]) -> Indices:
    """The number of the piece, from 1 in the order of their first faces, that each of the `chosen` faces (m,)
    belongs to, int32 (m,), 0 for the others. Faces that share an edge are one piece.
    """
    number = np.zeros(len(faces), np.int32)
    own = np.flatnonzero(chosen)
    if len(own):
        triangles = np.ascontiguousarray(faces[own], np.int32)
        twin, _, _ = pair_half_edges(triangles, int(faces.max()) + 1)
        number[own] = number_components(triangles, twin) + 1
    return number


def rest_centers(snapshot: Snapshot, pieces: Indices) -> Vectors:
    """The centre at rest of each piece from 1, weighted by area, (k, 3) in units of the model."""
    faces = snapshot.substrate_faces[snapshot.film_face]
    area = face_areas(snapshot.substrate_vertices, faces)
    middle = snapshot.substrate_vertices[faces].mean(axis=1)
    total = np.bincount(pieces, area)
    sums = [np.bincount(pieces, area * middle[:, axis]) for axis in range(3)]
    centers: Vectors = (np.stack(sums, axis=1) / np.where(total > 0.0, total, 1.0)[:, None])[1:]
    return centers
