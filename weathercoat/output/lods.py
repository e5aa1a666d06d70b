"""Coarser versions of a snapshot, whose colours, masks and texture coordinates are those of the fine one.

Faces go by quadric errors, with open edges kept, so that cracks stay open and outlines where they are. Every
vertex of the coarse mesh then takes its values from the nearest place on the fine one, and every corner its
texture coordinates from the chart that its face lies in. Needs the extra `lods`.

Source: Garland and Heckbert, Surface simplification using quadric error metrics, 1997.
"""

from __future__ import annotations

import importlib.util
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import UsageError
from weathercoat.mesh.halfedge import make_twins
from weathercoat.mesh.projection import InputSurface, barycentric_of
from weathercoat.mesh.surface import Indices, Place, Surface, Vectors, make_surface, vertex_normals
from weathercoat.mesh.transfer import blend, transfer
from weathercoat.sim.snapshot import Snapshot

RATIO = 4  # each level has this many times fewer faces than the one before


def require_lods() -> None:
    """Raise UsageError where the extra is not installed."""
    if importlib.util.find_spec("fast_simplification") is None:
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

    def values(array: NDArray[np.generic]) -> Vectors:
        return blend(
            np.asarray(array, np.float64).reshape(len(array), -1)[fine.faces[place.face]], place.barycentric
        )

    corner = fine.faces[place.face, np.argmax(place.barycentric, axis=1)]
    return replace(
        snapshot,
        film_vertices=coarse.vertices,
        film_faces=coarse.faces,
        film_face=np.arange(len(coarse.faces), dtype=np.int32),
        film_origin=np.arange(len(coarse.vertices), dtype=np.int32),
        film_rust=values(snapshot.film_rust)[:, 0],
        separated=snapshot.separated[corner],
        separation_age=values(snapshot.separation_age)[:, 0],
        adhesion=values(snapshot.adhesion)[:, 0],
        film_color=values(snapshot.film_color),
        dust=values(snapshot.dust[snapshot.film_origin])[:, 0],
        surface=_named(coarse, given),
    )


def _coarser_metal(snapshot: Snapshot, share: float) -> Snapshot:
    given = snapshot.surface
    fine = make_surface(snapshot.substrate_vertices, snapshot.substrate_faces)
    if given is not None:
        fine = replace(given, normals=None, place=None)
    coarse, place = _simplify(fine, share)

    def values(array: NDArray[np.generic]) -> Vectors:
        return blend(
            np.asarray(array, np.float64).reshape(len(array), -1)[fine.faces[place.face]], place.barycentric
        )

    corner = fine.faces[place.face, np.argmax(place.barycentric, axis=1)]
    return replace(
        snapshot,
        substrate_vertices=coarse.vertices,
        substrate_normals=vertex_normals(coarse.vertices, coarse.faces),
        substrate_faces=coarse.faces,
        substrate_rust=values(snapshot.substrate_rust)[:, 0],
        dust=values(snapshot.dust)[:, 0],
        bare=snapshot.bare[corner],
        substrate_color=values(snapshot.substrate_color),
        surface=_named(coarse, given),
    )


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
    from fast_simplification import simplify

    used, faces = np.unique(fine.faces, return_inverse=True)
    points, triangles = simplify(
        fine.vertices[used], faces.reshape(-1, 3).astype(np.int32), 1.0 - share, agg=5.0
    )
    points = np.asarray(points, np.float64)
    triangles = np.ascontiguousarray(triangles, np.int32).reshape(-1, 3)
    twin = make_twins(fine.faces)
    source = InputSurface(fine.vertices, fine.faces, twin, np.full(len(twin), -1, np.int32))
    face, near = source.closest(points, np.zeros(len(points), np.int32))
    place = Place(face, barycentric_of(near, fine.vertices[fine.faces[face]]))
    below = _below(source, points, triangles)
    coarse = make_surface(points, triangles, face_group=fine.face_group[below])
    return transfer(coarse, fine, source, below, place, points), place


def _below(source: InputSurface, points: Vectors, faces: Indices) -> Indices:
    """The face of the fine mesh under the centre of each coarse one."""
    centers = points[faces].mean(axis=1)
    return source.closest(centers, np.zeros(len(faces), np.int32))[0]
