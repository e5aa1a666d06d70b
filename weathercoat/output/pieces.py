"""Loose pieces of film: what has let go of the metal and hangs together."""

from __future__ import annotations

import numpy as np

from weathercoat.mesh.pairing import pair_half_edges
from weathercoat.mesh.surface import Indices, Vectors, face_areas
from weathercoat.mesh.topology import number_components
from weathercoat.sim.snapshot import Snapshot


def number_pieces(snapshot: Snapshot) -> Indices:
    """The piece of each face of the film, int32 (m,): from 1 in the order of their first faces, and 0 for
    film that holds.

    A face is loose when all its corners have let go; loose faces across an unbroken edge are one piece, so a
    flap that still hangs on the film beside it is a piece as well, up to that film.
    """
    faces = snapshot.film_faces
    number = np.zeros(len(faces), np.int32)
    loose = np.flatnonzero(snapshot.separated[faces].all(axis=1))
    if len(loose) == 0:
        return number
    own = np.ascontiguousarray(faces[loose])
    twin, _, _ = pair_half_edges(own, len(snapshot.film_vertices))
    number[loose] = number_components(own, twin) + 1
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
