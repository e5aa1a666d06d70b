"""`DisplayMesh`: everything of one snapshot that a picture shows, as one triangle mesh in units of the
object's size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Indices, Surface, Vectors, face_areas
from weathercoat.output.shading import BACK, BARE_PART, FRONT, METAL, RIM
from weathercoat.output.shell import corner_normals, make_shell, open_edges, smooth_outline
from weathercoat.sim.snapshot import Snapshot

_GAP = 0.25  # of the film's thickness: it floats this far above the metal, so that no two surfaces coincide
_LEAST_THICKNESS = 8e-4  # in sizes: a thinner film would flicker with its back and the metal
_BEVEL = 0.4  # of the film's thickness
_OUTLINE_PASSES = 1
_FILM_CREASE = np.radians(60.0)  # curls on coarse meshes turn by more than a crease of the metal does
_METAL_CREASE = np.radians(45.0)


@dataclass(frozen=True)
class Normalisation:
    """Model units to display units: (x - centre) / size, with size the root of the substrate's area."""

    centre: Vectors
    size: float

    @classmethod
    def of(cls, snapshot: Snapshot) -> Normalisation:
        """Of a snapshot's substrate, which is the same in all snapshots of a run."""
        return cls.of_mesh(snapshot.substrate_vertices, snapshot.substrate_faces)

    @classmethod
    def of_mesh(cls, vertices: Vectors, faces: Indices) -> Normalisation:
        """Of vertices (k, 3) and faces (t, 3)."""
        size = float(np.sqrt(face_areas(vertices, faces).sum()))
        return cls(0.5 * (vertices.min(axis=0) + vertices.max(axis=0)), size)

    def __call__(self, points: Vectors) -> Vectors:
        """Display coordinates of points (k, 3)."""
        return np.ascontiguousarray((points - self.centre) / self.size)


@dataclass(frozen=True)
class DisplayMesh:
    """One triangle mesh of k vertices and t faces with what the shading needs.

    vertices (k, 3); faces int32 (t, 3); kind uint8 (t,), see `shading`; corner_normals float32 (t, 3, 3).
    rest (k, 3), the position at rest; stain, dust, rust (k,), 0 to 1: runoff rust on the film, dust, rust of
    the metal; layer (k,), 1 on the film's front and 0 on its back; color (k, 3), linear colour of the paint.
    """

    vertices: Vectors
    faces: Indices
    kind: NDArray[np.uint8]
    corner_normals: NDArray[np.float32]
    rest: Vectors
    stain: Vectors
    dust: Vectors
    rust: Vectors
    layer: Vectors
    color: Vectors

    def at(self, face: Indices, weights: NDArray[np.float32]) -> Samples:
        """The points on `face` (s,) with `weights` (s, 2) of its second and third corner."""
        samples = Samples(
            self.kind[face],
            *(np.empty((len(face), 3)) for _ in range(5)),
            *(np.empty(len(face)) for _ in range(4)),
        )
        vectors = np.stack([self.vertices, self.rest, self.color], axis=1)
        scalars = np.stack([self.stain, self.dust, self.rust, self.layer], axis=1)
        _interpolate(
            face,
            weights,
            self.faces,
            vectors,
            scalars,
            self.corner_normals,
            samples.position,
            samples.rest,
            samples.color,
            samples.facet,
            samples.normal,
            samples.stain,
            samples.dust,
            samples.rust,
            samples.layer,
        )
        return samples


@dataclass(frozen=True)
class Samples:
    """Points of a display mesh: kind (s,), vectors (s, 3), scalars (s,); `facet` is the face normal."""

    kind: NDArray[np.uint8]
    position: Vectors
    facet: Vectors
    normal: Vectors
    rest: Vectors
    color: Vectors
    stain: Vectors
    dust: Vectors
    rust: Vectors
    layer: Vectors


def make_display_mesh(
    snapshot: Snapshot,
    normalise: Normalisation,
    *,
    film_thickness: float,
    metal_thickness: float,
    paint: Vectors,
    untouched: Surface | None = None,
) -> DisplayMesh:
    """The display mesh of a snapshot; thicknesses are in sizes, `paint` (3,) is the film's linear colour."""
    rest = normalise(snapshot.substrate_vertices)
    parts = [_metal(snapshot, rest, metal_thickness)]
    if len(snapshot.film_faces):
        parts.append(_film(snapshot, normalise(snapshot.film_vertices), rest, film_thickness, paint))
    if untouched is not None and len(untouched.faces):
        parts.append(make_bare_mesh(normalise(untouched.vertices), untouched.faces))
    return join_meshes(parts)


def _part(
    vertices: Vectors,
    surfaces: Sequence[tuple[Indices, int]],
    crease: float,
    scalars: dict[str, Vectors] | None = None,
) -> DisplayMesh:
    """A mesh of faces of several kinds, whose normals do not mix, on the same vertices; what `scalars` does
    not give is 0, and the rest position that of the vertices.
    """
    given = scalars or {}
    zero = np.zeros(len(vertices))
    return DisplayMesh(
        vertices=vertices,
        faces=np.concatenate([faces for faces, _ in surfaces]).astype(np.int32, copy=False),
        kind=np.concatenate([np.full(len(faces), kind, np.uint8) for faces, kind in surfaces]),
        corner_normals=np.concatenate([corner_normals(vertices, faces, crease) for faces, _ in surfaces]),
        rest=given.get("rest", vertices),
        stain=given.get("stain", zero),
        dust=given.get("dust", zero),
        rust=given.get("rust", zero),
        layer=given.get("layer", zero),
        color=given.get("color", np.zeros((len(vertices), 3))),
    )


def _metal(snapshot: Snapshot, rest: Vectors, thickness: float) -> DisplayMesh:
    """The metal: as it is when closed, else a sheet with a thickness below its surface."""
    scalars = {"dust": snapshot.dust, "rust": snapshot.substrate_rust, "rest": rest}
    faces = snapshot.substrate_faces
    if thickness <= 0.0 or len(open_edges(faces)[0]) == 0:
        return _part(rest, ((faces, METAL),), _METAL_CREASE, scalars)
    shell = make_shell(rest, faces, thickness, gap=-thickness)
    doubled = {name: np.concatenate([value, value]) for name, value in scalars.items()}
    doubled["rest"] = shell.vertices
    everything = np.concatenate([shell.front, shell.back, shell.rim])
    return _part(shell.vertices, ((everything, METAL),), _METAL_CREASE, doubled)


def _film(
    snapshot: Snapshot, vertices: Vectors, rest: Vectors, thickness: float, paint: Vectors
) -> DisplayMesh:
    """Front, back and rim of the film."""
    thickness = max(thickness, _LEAST_THICKNESS)
    origin = snapshot.film_origin
    fixed = np.bincount(origin, minlength=len(rest)) > 2
    fixed[open_edges(snapshot.substrate_faces)[0]] = True
    vertices = smooth_outline(vertices, snapshot.film_faces, fixed[origin], _OUTLINE_PASSES)
    shell = make_shell(
        vertices, snapshot.film_faces, thickness, gap=_GAP * thickness, bevel=_BEVEL * thickness
    )
    color = np.broadcast_to(paint, (len(vertices), 3))
    scalars = {
        "rest": np.tile(rest[origin], (2, 1)),
        "stain": np.tile(snapshot.film_rust, 2),
        "dust": np.tile(snapshot.dust[origin], 2),
        "rust": np.tile(snapshot.substrate_rust[origin], 2),
        "layer": np.repeat([1.0, 0.0], len(vertices)),
        "color": np.tile(color, (2, 1)),
    }
    surfaces = ((shell.front, FRONT), (shell.back, BACK), (shell.rim, RIM))
    return _part(shell.vertices, surfaces, _FILM_CREASE, scalars)


def make_bare_mesh(vertices: Vectors, faces: Indices) -> DisplayMesh:
    """The display mesh of vertices (k, 3) and faces (t, 3) that carry no paint."""
    return _part(vertices, ((faces, BARE_PART),), _METAL_CREASE)


def make_painted_mesh(vertices: Vectors, faces: Indices, paint: Vectors) -> DisplayMesh:
    """The display mesh of vertices (k, 3) and faces (t, 3) under whole paint of the linear colour `paint`
    (3,).
    """
    scalars = {"layer": np.ones(len(vertices)), "color": np.tile(paint, (len(vertices), 1))}
    return _part(vertices, ((faces, FRONT),), _METAL_CREASE, scalars)


def join_meshes(parts: Sequence[DisplayMesh]) -> DisplayMesh:
    """One mesh of several, one at least."""
    offsets = np.concatenate([[0], np.cumsum([len(part.vertices) for part in parts])])
    faces = [part.faces + np.int32(offset) for part, offset in zip(parts, offsets, strict=False)]

    def all_of(name: str) -> NDArray[np.generic]:
        return np.concatenate([getattr(part, name) for part in parts])

    names = ("vertices", "kind", "corner_normals", "rest", "stain", "dust", "rust", "layer", "color")
    return DisplayMesh(faces=np.concatenate(faces), **{name: all_of(name) for name in names})  # type: ignore[arg-type]


@kernel
def _interpolate(
    face: Indices,
    weights: NDArray[np.float32],
    faces: Indices,
    vectors: Vectors,
    scalars: Vectors,
    corner_normals: NDArray[np.float32],
    position: Vectors,
    rest: Vectors,
    color: Vectors,
    facet: Vectors,
    normal: Vectors,
    stain: Vectors,
    dust: Vectors,
    rust: Vectors,
    layer: Vectors,
) -> None:
    for s in range(len(face)):
        f = face[s]
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        v, w = np.float64(weights[s, 0]), np.float64(weights[s, 1])
        u = 1.0 - v - w
        for x in range(3):
            position[s, x] = u * vectors[a, 0, x] + v * vectors[b, 0, x] + w * vectors[c, 0, x]
            rest[s, x] = u * vectors[a, 1, x] + v * vectors[b, 1, x] + w * vectors[c, 1, x]
            color[s, x] = u * vectors[a, 2, x] + v * vectors[b, 2, x] + w * vectors[c, 2, x]
            normal[s, x] = (
                u * corner_normals[f, 0, x] + v * corner_normals[f, 1, x] + w * corner_normals[f, 2, x]
            )
        stain[s] = u * scalars[a, 0] + v * scalars[b, 0] + w * scalars[c, 0]
        dust[s] = u * scalars[a, 1] + v * scalars[b, 1] + w * scalars[c, 1]
        rust[s] = u * scalars[a, 2] + v * scalars[b, 2] + w * scalars[c, 2]
        layer[s] = u * scalars[a, 3] + v * scalars[b, 3] + w * scalars[c, 3]
        for x in range(3):
            y, z = (x + 1) % 3, (x + 2) % 3
            facet[s, x] = (vectors[b, 0, y] - vectors[a, 0, y]) * (vectors[c, 0, z] - vectors[a, 0, z]) - (
                vectors[b, 0, z] - vectors[a, 0, z]
            ) * (vectors[c, 0, y] - vectors[a, 0, y])
        size = np.sqrt(facet[s, 0] ** 2 + facet[s, 1] ** 2 + facet[s, 2] ** 2)
        length = np.sqrt(normal[s, 0] ** 2 + normal[s, 1] ** 2 + normal[s, 2] ** 2)
        for x in range(3):
            facet[s, x] /= max(size, 1e-300)
            normal[s, x] = normal[s, x] / length if length > 1e-6 else facet[s, x]
