"""`DisplayMesh`: everything of one snapshot that a picture shows, as one triangle mesh in units of the
object's size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.surface import Indices, Surface, Vectors, face_areas
from weathercoat.output.materials import Material, face_materials, film_materials, read_material
from weathercoat.output.shading import BACK, BARE_PART, FRONT, METAL, OWN_PART, RIM, to_linear
from weathercoat.output.shell import Shell, corner_normals, make_shell, open_edges, smooth_outline
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
    the metal; layer (k,), 1 on the film's front and 0 on its back; color (k, 3), linear colour of the paint
    or, under a material, what multiplies its colour. material int32 (t,): what a face shows of `materials`,
    -1 for none; uv float32 (t, 3, 2), texture coordinates of the corners, v upwards. source int32 (t,): the
    face of the snapshot's metal or film, or of the part without paint, that it shows.
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
    material: Indices
    uv: NDArray[np.float32]
    source: Indices
    materials: tuple[Material, ...] = ()

    def at(self, face: Indices, weights: NDArray[np.float32]) -> Samples:
        """The points on `face` (s,) with `weights` (s, 2) of its second and third corner."""
        count = len(face)
        vector, scalar = (partial(np.empty, shape) for shape in ((count, 3), count))
        samples = Samples(
            self.kind[face],
            position=vector(),
            facet=vector(),
            normal=vector(),
            rest=vector(),
            color=vector(),
            stain=scalar(),
            dust=scalar(),
            rust=scalar(),
            layer=scalar(),
            is_own=self.material[face] >= 0,
            roughness=np.ones(count),
            metallic=np.zeros(count),
            occlusion=np.ones(count),
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
    """Points of a display mesh: kind (s,), vectors (s, 3), scalars (s,); `facet` is the face normal.

    is_own (s,): whether the colour is that of a material of the input; roughness, metallic, occlusion: of
    parts that show one.
    """

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
    is_own: NDArray[np.bool_]
    roughness: Vectors
    metallic: Vectors
    occlusion: Vectors


def make_display_mesh(
    snapshot: Snapshot,
    normalise: Normalisation,
    *,
    film_thickness: float,
    metal_thickness: float,
    paint: Vectors,
    untouched: Surface | None = None,
    look: str = "paint",
) -> DisplayMesh:
    """The display mesh of a snapshot; thicknesses are in sizes, `paint` (3,) is the film's linear colour,
    which it has where it does not show a material of the input, see `materials.film_materials` on `look`.

    Raises CorruptError where a texture cannot be decoded.
    """
    rest = normalise(snapshot.substrate_vertices)
    parts = [_metal(snapshot, rest, metal_thickness)]
    if len(snapshot.film_faces):
        parts.append(_film(snapshot, normalise(snapshot.film_vertices), rest, film_thickness, paint, look))
    if untouched is not None and len(untouched.faces):
        parts.append(make_part_mesh(normalise(untouched.vertices), untouched))
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
    everything = np.concatenate([faces for faces, _ in surfaces]).astype(np.int32, copy=False)
    return DisplayMesh(
        vertices=vertices,
        faces=everything,
        kind=np.concatenate([np.full(len(faces), kind, np.uint8) for faces, kind in surfaces]),
        corner_normals=np.concatenate([corner_normals(vertices, faces, crease) for faces, _ in surfaces]),
        rest=given.get("rest", vertices),
        stain=given.get("stain", zero),
        dust=given.get("dust", zero),
        rust=given.get("rust", zero),
        layer=given.get("layer", zero),
        color=given.get("color", np.zeros((len(vertices), 3))),
        material=np.full(len(everything), -1, np.int32),
        uv=np.zeros((len(everything), 3, 2), np.float32),
        source=np.arange(len(everything), dtype=np.int32),
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
    sheet = _part(shell.vertices, ((everything, METAL),), _METAL_CREASE, doubled)
    return replace(sheet, source=_sources(shell))


def _sources(shell: Shell) -> Indices:
    """The face of the sheet that each face of its shell's front, back and rim belongs to."""
    own = np.arange(len(shell.front), dtype=np.int32)
    return np.concatenate([own, own, shell.rim_face])


def _film(
    snapshot: Snapshot, vertices: Vectors, rest: Vectors, thickness: float, paint: Vectors, look: str
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
    film = replace(_part(shell.vertices, surfaces, _FILM_CREASE, scalars), source=_sources(shell))
    return _with_look(film, snapshot, shell, look)


def _with_look(film: DisplayMesh, snapshot: Snapshot, shell: Shell, look: str) -> DisplayMesh:
    """The film with the input's own materials where `look` wants them: on its front and its rim."""
    surface = snapshot.surface
    if surface is None:
        return film
    shown = film_materials(surface, look)[snapshot.film_face]
    if (shown < 0).all():
        return film
    fronts, owner = len(shell.front), shell.rim_face
    everywhere = np.full(len(film.faces), -1, np.int32)
    everywhere[:fronts] = shown
    everywhere[2 * fronts :] = shown[owner]
    uv = film.uv.copy()
    if surface.uv is not None:
        uv[:fronts] = surface.uv[snapshot.film_face]
        # a corner of the rim has the texture of the front's corner at the same vertex
        at = shell.rim % np.int32(len(snapshot.film_vertices))
        corner = (shell.front[owner][:, None, :] == at[:, :, None]).argmax(axis=2)
        uv[2 * fronts :] = uv[owner[:, None], corner]
    number, materials = _decoded(surface, everywhere, only_color=True)
    colors = _vertex_colors(surface)[np.tile(snapshot.film_origin, 2)]
    return replace(_recolored(film, number >= 0, colors), uv=uv, material=number, materials=materials)


def _recolored(mesh: DisplayMesh, chosen: NDArray[np.bool_], colors: Vectors) -> DisplayMesh:
    """The mesh with `colors` (k, 3) on the `chosen` faces (t,), which get vertices of their own."""
    used, renumbered = np.unique(mesh.faces[chosen], return_inverse=True)
    faces = mesh.faces.copy()
    faces[chosen] = (len(mesh.vertices) + renumbered).reshape(-1, 3)
    names = ("vertices", "rest", "stain", "dust", "rust", "layer")
    longer: dict[str, Any] = {
        name: np.concatenate([getattr(mesh, name), getattr(mesh, name)[used]]) for name in names
    }
    return replace(mesh, faces=faces, color=np.concatenate([mesh.color, colors[used]]), **longer)


def _decoded(
    surface: Surface, material: Indices, *, only_color: bool = False
) -> tuple[Indices, tuple[Material, ...]]:
    """The materials that are used of a surface's, decoded, and their numbers for those of `material` (t,)."""
    used = np.unique(material[material >= 0])
    number = np.where(material >= 0, np.searchsorted(used, material), -1).astype(np.int32)
    read = (read_material(surface.materials[i], only_color=only_color) for i in used)
    return number, tuple(each if surface.uv is not None else each.without_textures() for each in read)


def _vertex_colors(surface: Surface) -> Vectors:
    """What multiplies the materials' colour at each vertex, (n, 3), linear."""
    if surface.colors is None:
        return np.ones((len(surface.vertices), 3))
    return to_linear(surface.colors[:, :3])


def make_part_mesh(vertices: Vectors, surface: Surface) -> DisplayMesh:
    """The display mesh of a surface that carries no paint, with its vertices at `vertices` (k, 3): in its own
    materials and vertex colours, or in the colour of unpainted parts where it has none.

    Raises CorruptError where a texture cannot be decoded.
    """
    material, materials = _decoded(surface, face_materials(surface))
    if surface.colors is not None and len(materials) == 0:
        material, materials = np.zeros_like(material), (Material(roughness=0.6, metallic=0.0),)
    bare, own = surface.faces[material < 0], surface.faces[material >= 0]
    mesh = _part(
        vertices,
        ((bare, BARE_PART), (own, OWN_PART)),
        _METAL_CREASE,
        {"color": _vertex_colors(surface)},
    )
    order = np.argsort(material >= 0, kind="stable")
    uv = mesh.uv if surface.uv is None else surface.uv[order].astype(np.float32)
    normals = mesh.corner_normals if surface.normals is None else surface.normals[order].astype(np.float32)
    return replace(
        mesh,
        material=np.ascontiguousarray(material[order], np.int32),
        materials=materials,
        uv=uv,
        corner_normals=normals,
        source=order.astype(np.int32),
    )


def make_textured_mesh(vertices: Vectors, surface: Surface, material: Material) -> DisplayMesh:
    """The display mesh of a surface with texture coordinates, all of it in one material, such as one of
    `materials.make_material`; its vertices lie at `vertices` (k, 3), and it keeps its smooth normals.
    """
    plain = replace(surface, parts=(), materials=(), colors=np.ones((len(surface.vertices), 4)))
    return replace(make_part_mesh(vertices, plain), materials=(material,))


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

    names = (
        "vertices",
        "kind",
        "corner_normals",
        "rest",
        "stain",
        "dust",
        "rust",
        "layer",
        "color",
        "uv",
        "source",
    )
    starts = np.cumsum([0] + [len(part.materials) for part in parts])
    material = [
        np.where(part.material >= 0, part.material + np.int32(start), part.material)
        for part, start in zip(parts, starts, strict=False)
    ]
    return DisplayMesh(
        faces=np.concatenate(faces),
        material=np.concatenate(material),
        materials=tuple(material for part in parts for material in part.materials),
        **{name: all_of(name) for name in names},  # type: ignore[arg-type]
    )


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
