"""How much of the sky each vertex of a snapshot sees: baked, so that a page shows depth without tracing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Indices, Vectors, vertex_normals
from weathercoat.output.lighting import sky_directions
from weathercoat.output.rays import RayQueries, make_rays
from weathercoat.sim.snapshot import Snapshot

_RAYS = 12  # a vertex: neighbours have other directions, and are averaged
_REACH = 0.25  # in sizes
_LIFT = 1.5e-3  # start of a ray above its surface, in sizes: what touches it does not darken it
_AT_ONCE = 65_536  # vertices, so that memory is bounded and Ctrl-C is answered


@dataclass(frozen=True)
class Occlusion:
    """The free share of the hemisphere, 0 to 1: over the metal (n,), the film's front (k,) and its back (k,).

    It is 0 where nobody can look: on the metal under film that holds, and on the back of such film.
    """

    metal: Vectors
    front: Vectors
    back: Vectors


def bake_occlusion(snapshot: Snapshot, size: float) -> Occlusion:
    """The occlusion of a snapshot by its metal and by the film that has let go, within a quarter of `size`.

    Film that holds lies on the metal and hides nothing else, so the rays leave it out.
    """
    faces, metal_faces = snapshot.film_faces, snapshot.substrate_faces
    is_lifted = snapshot.separated[faces].any(axis=1)
    count = len(snapshot.substrate_vertices)
    rays = make_rays(
        np.concatenate([snapshot.substrate_vertices, snapshot.film_vertices]) / size,
        np.concatenate([metal_faces, faces[is_lifted] + np.int32(count)]),
    )
    is_open = np.ones(len(metal_faces), np.bool_)
    is_open[snapshot.film_face[~is_lifted]] = False
    exposed = np.zeros(count, np.bool_)
    exposed[metal_faces[is_open]] = True
    free = np.zeros(len(snapshot.film_vertices), np.bool_)
    free[faces[is_lifted]] = True
    normals = vertex_normals(snapshot.film_vertices, faces)
    everywhere = np.ones(len(free), np.bool_)
    film = snapshot.film_vertices / size
    return Occlusion(
        _shares(rays, snapshot.substrate_vertices / size, snapshot.substrate_normals, metal_faces, exposed),
        _shares(rays, film, normals, faces, everywhere),
        _shares(rays, film, -normals, faces, free),
    )


def _shares(
    rays: RayQueries, vertices: Vectors, normals: Vectors, faces: Indices, wanted: NDArray[np.bool_]
) -> Vectors:
    """The free share over each vertex (k,) that is `wanted`, averaged with its neighbours; else 0."""
    chosen = np.flatnonzero(wanted)
    share = np.zeros(len(vertices))
    for first in range(0, len(chosen), _AT_ONCE):
        part = chosen[first : first + _AT_ONCE]
        normal = np.ascontiguousarray(normals[part])
        origins = (vertices[part] + _LIFT * normal).astype(np.float32)
        row, column = (part // 4).astype(np.int32), (part % 4).astype(np.int32)
        directions = np.empty((len(part), 3), np.float32)
        blocked = np.zeros(len(part), np.int64)
        for index in range(_RAYS):
            sky_directions(row, column, normal, normal, index, _RAYS, directions)
            blocked += rays.blocked(origins, directions, _REACH)
        share[part] = 1.0 - blocked / _RAYS
    return np.where(wanted, _averaged(share, wanted, faces), 0.0)


def _averaged(share: Vectors, wanted: NDArray[np.bool_], faces: Indices) -> Vectors:
    """Each share (k,) with those of the vertices beside it that are wanted."""
    tails, heads = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    total, weight = 2.0 * share, 2.0 * np.ones(len(share))
    for here, there in ((tails, heads), (heads, tails)):
        total += np.bincount(here, np.where(wanted[there], share[there], 0.0), len(share))
        weight += np.bincount(here, wanted[there], len(share))
    return total / weight
