"""Coarser versions of a snapshot, whose colours, masks and texture coordinates are those of the fine one.

Faces go by quadric errors, but open edges stay, so that cracks and outlines are where they were and no film
is lost; a level of a film in many pieces has as many faces as these need. Vertices take means of what they
stand for, and corners their texture coordinates from the chart that their face lies in. Needs the extra
`lods`.

Source: Garland and Heckbert, Surface simplification using quadric error metrics, 1997.
"""

from __future__ import annotations

import importlib.util
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import UsageError
from weathercoat.mesh.closest import find_closest, make_closest_tree
from weathercoat.mesh.halfedge import make_twins
from weathercoat.mesh.projection import InputSurface, barycentric_of
from weathercoat.mesh.surface import Indices, Place, Surface, Vectors, make_surface, vertex_normals
from weathercoat.mesh.transfer import blend, transfer
from weathercoat.sim.snapshot import Snapshot

_AGGRESSION = 4.0  # how fast the bar for collapses rises; lower is slower and keeps shapes better
RATIO = 4  # each level has this many times fewer faces than the one before


def require_lods() -> None:
    """Raise UsageError where the extra is not installed."""
    if importlib.util.find_spec("pyfqmr") is None:
        raise UsageError(
            "levels of detail need a library that is not installed",
            remedy="pip install 'weathercoat[lods]'",
        )


def coarser(snapshot: Snapshot, level: int) -> tuple[Snapshot, Snapshot]:
    """The snapshot with RATIO ** level times fewer faces: one whose film, and one whose metal is to be
    shown.
    """
    share = float(RATIO) ** -level
    return _coarser_film(snapshot, share), _coarser_metal(snapshot, share)


def _coarser_film(snapshot: Snapshot, share: float) -> Snapshot:
    if len(snapshot.film_faces) == 0:
        return snapshot
    given = snapshot.surface
    fine = make_surface(
        snapshot.film_vertices,
        snapshot.film_faces,
        uv=None if given is None or given.uv is None else given.uv[snapshot.film_face],
        colors=None if given is None or given.colors is None else given.colors[snapshot.film_origin],
        face_group=None if given is None else given.face_group[snapshot.film_face],
        face_part=None if given is None or given.face_part is None else given.face_part[snapshot.film_face],
    )
    coarse, place = _simplify(fine, share)
    values = _Means(fine, coarse, place)
    corner = fine.faces[place.face, np.argmax(place.barycentric, axis=1)]
    return replace(
        snapshot,
        film_vertices=coarse.vertices,
        film_faces=coarse.faces,
        film_face=np.arange(len(coarse.faces), dtype=np.int32),
        film_origin=np.arange(len(coarse.vertices), dtype=np.int32),
        film_rust=values.of(snapshot.film_rust)[:, 0],
        separated=snapshot.separated[corner],
        separation_age=values.of(snapshot.separation_age)[:, 0],
        adhesion=values.of(snapshot.adhesion)[:, 0],
        film_color=values.of(snapshot.film_color),
        dust=values.of(snapshot.dust[snapshot.film_origin])[:, 0],
        surface=_named(coarse, given),
    )


def _coarser_metal(snapshot: Snapshot, share: float) -> Snapshot:
    given = snapshot.surface
    fine = make_surface(snapshot.substrate_vertices, snapshot.substrate_faces)
    if given is not None:
        fine = replace(given, normals=None, place=None)
    coarse, place = _simplify(fine, share)
    values = _Means(fine, coarse, place)
    corner = fine.faces[place.face, np.argmax(place.barycentric, axis=1)]
    return replace(
        snapshot,
        substrate_vertices=coarse.vertices,
        substrate_normals=vertex_normals(coarse.vertices, coarse.faces),
        substrate_faces=coarse.faces,
        substrate_rust=values.of(snapshot.substrate_rust)[:, 0],
        dust=values.of(snapshot.dust)[:, 0],
        bare=snapshot.bare[corner],
        substrate_color=values.of(snapshot.substrate_color),
        surface=_named(coarse, given),
    )


class _Means:
    """Values at the vertices of a coarse mesh, each the mean of a fine one's over what the vertex stands for.

    Taken at single places they would not keep their mean: rust, say, is high along the outlines that stay.
    """

    def __init__(self, fine: Surface, coarse: Surface, place: Place) -> None:
        self._fine, self._place = fine, place
        centers = fine.vertices[fine.faces].mean(axis=1)
        tree = make_closest_tree(coarse.vertices, coarse.faces)
        face, near = find_closest(tree, centers, np.zeros(len(centers), np.int32))
        self._corner = coarse.faces[face]
        weights = barycentric_of(near, coarse.vertices[self._corner])
        self._weights = weights * fine.face_areas()[:, None]
        self._count = len(coarse.vertices)
        self._total = np.bincount(self._corner.ravel(), self._weights.ravel(), self._count)

    def of(self, array: NDArray[np.generic]) -> Vectors:
        """An array over the fine mesh's vertices (n,) or (n, j) as one over the coarse mesh's, (k, j)."""
        values = np.asarray(array, np.float64).reshape(len(array), -1)
        corners = values[self._fine.faces]
        result = blend(corners[self._place.face], self._place.barycentric)
        means = corners.mean(axis=1)
        has_any = self._total > 0.0
        for column in range(values.shape[1]):
            share = (self._weights * means[:, column : column + 1]).ravel()
            total = np.bincount(self._corner.ravel(), share, self._count)
            result[has_any, column] = total[has_any] / self._total[has_any]
        return result


def _named(coarse: Surface, given: Surface | None) -> Surface:
    """The coarse surface with the names of groups, parts and materials."""
    if given is None:
        return coarse
    return replace(
        coarse,
        groups=given.groups,
        parts=given.parts,
        materials=given.materials,
        tree=given.tree,
        up=given.up,
        name=given.name,
    )


def _simplify(fine: Surface, share: float) -> tuple[Surface, Place]:
    """A coarser surface, and where each of its vertices lies on the fine one."""
    used, faces = np.unique(fine.faces, return_inverse=True)
    points, triangles = _collapse(fine.vertices[used], faces.reshape(-1, 3).astype(np.int32), share)
    twin = make_twins(fine.faces)
    source = InputSurface(fine.vertices, fine.faces, twin, np.full(len(twin), -1, np.int32))
    face, near = source.closest(points, np.zeros(len(points), np.int32))
    place = Place(face, barycentric_of(near, fine.vertices[fine.faces[face]]))
    below = _below(source, points, triangles)
    coarse = make_surface(points, triangles, face_group=fine.face_group[below])
    return transfer(coarse, fine, source, below, place, points), place


def _collapse(points: Vectors, faces: Indices, share: float) -> tuple[Vectors, Indices]:
    """Points and faces of a mesh with that share of its faces, or as few as its open edges allow."""
    from pyfqmr import Simplify

    simplify = Simplify()
    simplify.setMesh(points, faces)
    simplify.simplify_mesh(
        max(4, round(share * len(faces))), aggressiveness=_AGGRESSION, preserve_border=True, verbose=False
    )
    moved, triangles, _ = simplify.getMesh()
    return np.asarray(moved, np.float64), np.ascontiguousarray(triangles, np.int32).reshape(-1, 3)


def _below(source: InputSurface, points: Vectors, faces: Indices) -> Indices:
    """The face of the fine mesh under the centre of each coarse one."""
    centers = points[faces].mean(axis=1)
    return source.closest(centers, np.zeros(len(faces), np.int32))[0]
