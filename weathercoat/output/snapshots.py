"""Snapshots as files: film and metal in one PLY, which reads back, and in one GLB for viewers.

Film that still holds lies exactly on the metal, and a renderer that sees both at one depth shows a random mix
of them. So files hold the film where it is, and the metal set in a hair along its normals: the surface of a
painted part is the paint, and the metal lies beneath it. Removing film never has to move anything.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import FormatError
from weathercoat.mesh.surface import (
    Indices,
    Part,
    Place,
    Surface,
    Vectors,
    face_areas,
    make_surface,
    vertex_normals,
)
from weathercoat.output.glb import Material, Node, Sheet, write_glb
from weathercoat.output.materials import shows_material
from weathercoat.output.parts import part_sheets, write_parts_glb
from weathercoat.output.ply import PlyArrays, color_bytes, read_ply_arrays, write_ply
from weathercoat.output.sheets import METAL_CREASE, make_sheet, srgb_to_linear, surface_nodes
from weathercoat.output.shell import corner_normals, make_shell, open_edges
from weathercoat.sim.snapshot import Snapshot
from weathercoat.stain.color import Palette, stain_color

# Depth of the metal under the film, in sizes (square root of the area): some twenty steps of a 24-bit depth
# buffer whose near plane is a hundredth of the object away, and a third of an edge at a million faces.
HAIR = 5e-4
# Curls on coarse meshes turn by more between two faces than what shows an edge on metal.
FILM_CREASE = float(np.radians(60.0))
# Of the thickness: open edges of the front draw back, so that a closed crack shows as a groove.
BEVEL = 0.5
SUBSTRATE, FILM = 0, 1
TITLE, FIRST_TITLE = "weathercoat snapshot 2", "weathercoat snapshot 1"
_MOST_NAMES = 1 << 18  # characters of the names of groups and objects in a header
PAINT = Material("paint", metallic=0.0, roughness=0.5, double_sided=True)
PRIMER = Material("primer", metallic=0.0, roughness=0.8, double_sided=True)
METAL = Material("metal", metallic=0.2, roughness=0.8, double_sided=True)


class Look(NamedTuple):
    """Where the film shows materials of the model, see `materials.film_materials`, and the colour of the rust
    (sRGB, 0 to 1) that tints them.
    """

    kind: str
    rust: tuple[float, float, float]


def write_snapshot_ply(folder: Path | str, snapshot: Snapshot, stem: str) -> Path:
    """Write `folder`/`stem`.ply, film and metal in one file, and return its path.

    Properties of a vertex: position (double), normal, colour (sRGB bytes), and the scalars part (0 metal, 1
    film), rust, dust, separated, adhesion, separation_age, bare, origin (number of the metal's vertex, which
    for the metal is its own), rest_x, rest_y, rest_z (position at rest, double), and the place on the input:
    input_face, and input_v, input_w, the weights of the second and third of its corners. Of a face: part,
    origin (number of the metal's face), and, as far as the model has them, texcoord (u v of each corner),
    group and object, whose names are comments. A vertex has the model's own colour as base_red, base_green,
    base_blue, where it has one. The metal comes first and lies a hair under the film; what does not apply to
    it is 0. Scalars are 32-bit floats. Raises OSError where the file cannot be written.
    """
    path = Path(folder) / f"{stem}.ply"
    metal, film = len(snapshot.substrate_vertices), len(snapshot.film_vertices)
    depth = hair(snapshot)
    film_normals = vertex_normals(snapshot.film_vertices, snapshot.film_faces)
    no_value = np.zeros(metal)
    origin = np.concatenate([np.arange(metal, dtype=np.int32), snapshot.film_origin]).astype(np.int32)
    face_origin = np.concatenate(
        [np.arange(len(snapshot.substrate_faces), dtype=np.int32), snapshot.film_face]
    ).astype(np.int32)
    inherited = _inherited(snapshot, origin, face_origin)
    write_ply(
        path,
        np.concatenate([set_in(snapshot, depth), snapshot.film_vertices]),
        np.concatenate([snapshot.substrate_faces, snapshot.film_faces + metal]),
        normals=np.concatenate([snapshot.substrate_normals, film_normals]),
        colors=color_bytes(np.concatenate([snapshot.substrate_color, snapshot.film_color])),
        scalars={
            "part": np.repeat(np.array([SUBSTRATE, FILM], np.uint8), [metal, film]),
            "rust": _floats(snapshot.substrate_rust, snapshot.film_rust),
            "dust": _floats(snapshot.dust, snapshot.dust[snapshot.film_origin]),
            "separated": np.concatenate([np.zeros(metal, np.bool_), snapshot.separated]),
            "adhesion": _floats(no_value, snapshot.adhesion),
            "separation_age": _floats(no_value, snapshot.separation_age),
            "bare": np.concatenate([snapshot.bare, np.zeros(film, np.bool_)]),
            "origin": origin,
            **inherited.vertex,
        },
        face_scalars={
            "part": np.repeat(
                np.array([SUBSTRATE, FILM], np.uint8),
                [len(snapshot.substrate_faces), len(snapshot.film_faces)],
            ),
            "origin": face_origin,
            **inherited.face,
        },
        texture=inherited.texture,
        comments=(
            TITLE,
            f"step {snapshot.step}",
            f"age {float(snapshot.age)!r}",
            f"hair {depth!r}",
            "part 0 is the metal, set in by the hair along its normals; part 1 is the film",
            *inherited.comments,
        ),
    )
    return path


def read_snapshot_ply(path: Path | str) -> Snapshot:
    """Read a snapshot that `write_snapshot_ply` wrote.

    Positions come back exactly, scalars, normals and texture coordinates as 32-bit floats, colours as bytes;
    the surface without its shading normals, and its parts without materials. Raises AccessError, FormatError
    or CorruptError.
    """
    ply = read_ply_arrays(path)
    try:
        return _unpack(ply)
    except (KeyError, ValueError, IndexError) as error:
        raise FormatError(
            "no snapshot of weathercoat", file=str(path), remedy="give the folder of a finished run"
        ) from error


def write_snapshot_glb(
    path: Path | str,
    snapshot: Snapshot,
    *,
    thickness: float = 0.0,
    back_color: tuple[float, float, float] | None = None,
    look: Look | None = None,
    up: tuple[float, float, float] = (0.0, 1.0, 0.0),
    untouched: Surface | None = None,
) -> None:
    """Write a snapshot as GLB.

    Where the model has named parts, the nodes are those of the model, with their names and transforms, each
    with a mesh of the film and the metal of its faces; else there are the nodes `film` and `substrate`, and
    one for each group of `untouched`. The `extras` of each primitive tell its role: film, back, rim,
    substrate or untouched, and the number of its part.

    With a thickness [units of the model] the film is a shell on the metal whose back and rim have
    `back_color` (sRGB, 0 to 1; None: that of the front), else a double-sided sheet. The metal lies a hair
    beneath it. `look` tells where the film shows materials of the model. Colours are linear, and tint what
    the model's own material shows; the scalars are the attributes _RUST, _DIRT, _SEPARATED, _ADHESION,
    _SEPARATION_AGE of the film and _RUST, _DIRT, _BARE of the metal. `up` is the model's axis against
    gravity. Raises OSError where the file cannot be written.
    """
    sheets = [*film_sheets(snapshot, thickness, back_color, look), *metal_sheets(snapshot)]
    extras = {"step": int(snapshot.step), "age": float(snapshot.age)}
    surface = snapshot.surface
    if surface is not None and surface.parts:
        others = [] if untouched is None else part_sheets(untouched)
        write_parts_glb(path, surface, [*sheets, *others], up=up, extras=extras)
        return
    nodes = [
        Node("film", [sheet for sheet in sheets if sheet.role != "substrate"]),
        Node("substrate", [sheet for sheet in sheets if sheet.role == "substrate"]),
    ]
    write_glb(path, nodes + ([] if untouched is None else surface_nodes(untouched)), up=up, extras=extras)


def hair(snapshot: Snapshot) -> float:
    """Depth of the metal under the film in files, in units of the model."""
    return float(HAIR * np.sqrt(face_areas(snapshot.substrate_vertices, snapshot.substrate_faces).sum()))


def set_in(snapshot: Snapshot, depth: float) -> Vectors:
    """Positions of the metal, (n, 3), moved inwards by `depth`."""
    return snapshot.substrate_vertices - depth * snapshot.substrate_normals


def metal_sheets(snapshot: Snapshot) -> list[Sheet]:
    """The metal, a hair under the film, with its colours and scalars; a sheet for each part of the model."""
    vertices = set_in(snapshot, hair(snapshot))
    faces, surface = snapshot.substrate_faces, snapshot.surface
    normals = None if surface is None else surface.normals
    if normals is None:
        normals = corner_normals(vertices, faces, METAL_CREASE).astype(np.float64)
    return [
        _used_sheet(
            METAL,
            vertices,
            faces,
            chosen,
            srgb_to_linear(snapshot.substrate_color),
            {"_RUST": snapshot.substrate_rust, "_DIRT": snapshot.dust, "_BARE": snapshot.bare},
            normals=normals,
            uv=None if surface is None else surface.uv,
            role="substrate",
            part=part,
        )
        for part, chosen in _by_part(surface, np.arange(len(faces), dtype=np.int32))
    ]


def film_sheets(
    snapshot: Snapshot,
    thickness: float,
    back_color: tuple[float, float, float] | None,
    look: Look | None = None,
    pieces: Indices | None = None,
) -> list[Sheet]:
    """The film's front, and where it has a thickness its back and rim; a sheet of each for each part of the
    model, and for each of the `pieces` (m,) that the film's faces belong to. See `write_snapshot_glb`.
    """
    faces, surface, film_face = snapshot.film_faces, snapshot.surface, snapshot.film_face
    uv = None if surface is None or surface.uv is None else surface.uv[film_face]
    scalars = {
        "_RUST": snapshot.film_rust,
        "_DIRT": snapshot.dust[snapshot.film_origin],
        "_SEPARATED": snapshot.separated,
        "_ADHESION": snapshot.adhesion,
        "_SEPARATION_AGE": snapshot.separation_age,
    }
    is_shell = thickness > 0.0
    if is_shell:
        shell = make_shell(snapshot.film_vertices, faces, thickness, bevel=BEVEL * thickness)
        vertices, rims = shell.vertices, _Rims(np.repeat(open_edges(faces)[2], 2), len(faces))
        under = srgb_to_linear(snapshot.film_color if back_color is None else back_color)
        under = np.tile(np.broadcast_to(under, (len(snapshot.film_vertices), 3)), (2, 1))
        scalars = {name: np.tile(values, 2) for name, values in scalars.items()}
    else:
        vertices = snapshot.film_vertices
    copies = 2 if is_shell else 1
    normals = _front_normals(snapshot, vertices)
    sheets = []
    for part, piece, chosen in _by_piece(surface, film_face, pieces):
        material, colors = _front_look(snapshot, part, look)
        sheets.append(
            _used_sheet(
                material,
                vertices,
                faces,
                chosen,
                np.tile(srgb_to_linear(colors), (copies, 1)),
                scalars,
                normals=normals,
                uv=uv,
                role="film",
                part=part,
                piece=piece,
            )
        )
        if is_shell:
            rim = rims.of(chosen)
            for role, triangles, rows in (("back", shell.back, chosen), ("rim", shell.rim, rim)):
                sheets.append(
                    _used_sheet(
                        PRIMER, vertices, triangles, rows, under, scalars, role=role, part=part, piece=piece
                    )
                )
    return sheets


def _by_part(surface: Surface | None, faces: Indices) -> list[tuple[int, NDArray[np.intp]]]:
    """The parts of the model, and which of these faces of the metal are theirs; all are of part -1 where the
    model has none.
    """
    if surface is None or surface.face_part is None or not surface.parts:
        return [(-1, np.arange(len(faces)))]
    part = surface.face_part[faces]
    order = np.argsort(part, kind="stable")
    bounds = np.searchsorted(part[order], np.arange(len(surface.parts) + 1))
    return [
        (n, order[bounds[n] : bounds[n + 1]]) for n in range(len(surface.parts)) if bounds[n] < bounds[n + 1]
    ]


class _Rims:
    """The rim's faces by the face of the film that each belongs to, `owners` (b,), of `count` faces."""

    def __init__(self, owners: NDArray[np.integer], count: int) -> None:
        self._order = np.argsort(owners, kind="stable")
        self._first = np.searchsorted(owners[self._order], np.arange(count + 1))

    def of(self, faces: NDArray[np.integer]) -> NDArray[np.intp]:
        """The rim's faces of some of the film's faces (k,)."""
        counts = self._first[faces + 1] - self._first[faces]
        starts = np.repeat(self._first[faces] - np.concatenate([[0], np.cumsum(counts)[:-1]]), counts)
        return np.sort(self._order[starts + np.arange(len(starts))])


def _by_piece(
    surface: Surface | None, faces: Indices, pieces: Indices | None
) -> Iterator[tuple[int, int, NDArray[np.intp]]]:
    """As `_by_part`, with the number of the piece between."""
    for part, chosen in _by_part(surface, faces):
        if pieces is None:
            yield part, 0, chosen
            continue
        own = pieces[chosen]
        order = np.argsort(own, kind="stable")
        numbers, first = np.unique(own[order], return_index=True)
        for number, rows in zip(numbers.tolist(), np.split(chosen[order], first[1:]), strict=True):
            yield part, number, np.sort(rows)


def _front_look(snapshot: Snapshot, part: int, look: Look | None) -> tuple[Material, Vectors]:
    """The material of the front of a part, and the colours (sRGB, 0 to 1) of the film's vertices on it."""
    surface = snapshot.surface
    if surface is None or part < 0 or look is None:
        return PAINT, snapshot.film_color
    number = surface.parts[part].material
    if not shows_material(surface, number, look.kind):
        return PAINT, snapshot.film_color
    source = surface.materials[number]
    origin = snapshot.film_origin
    own = np.ones((len(origin), 3)) if surface.colors is None else surface.colors[origin, :3]
    tint = stain_color(own, Palette(rust=look.rust), snapshot.film_rust, snapshot.dust[origin])
    return Material(source.name, 0.0, 0.5, double_sided=True, source=source), tint


def _front_normals(snapshot: Snapshot, vertices: Vectors) -> Vectors:
    """Shading normals (m, 3, 3) of the film's front: those of the model where it is attached."""
    faces, surface = snapshot.film_faces, snapshot.surface
    normals = corner_normals(vertices, faces, FILM_CREASE).astype(np.float64)
    if surface is not None and surface.normals is not None:
        attached = ~snapshot.separated[faces].any(axis=1)
        normals[attached] = surface.normals[snapshot.film_face[attached]]
    return normals


def _used_sheet(
    material: Material,
    vertices: Vectors,
    faces: Indices,
    chosen: NDArray[np.integer],
    colors: Vectors,
    scalars: dict[str, NDArray[Any]],
    *,
    normals: Vectors | None = None,
    uv: Vectors | None = None,
    role: str,
    part: int,
    piece: int = 0,
) -> Sheet:
    """A sheet of the chosen faces (k,), with the vertices that they use."""
    used, renumbered = np.unique(faces[chosen], return_inverse=True)
    return make_sheet(
        material,
        vertices[used],
        renumbered.reshape(-1, 3).astype(np.int32),
        crease=FILM_CREASE,
        colors=colors[used],
        scalars={name: values[used] for name, values in scalars.items()},
        normals=None if normals is None else normals[chosen],
        uv=None if uv is None else uv[chosen],
        role=role,
        part=part,
        piece=piece,
    )


class _Inherited(NamedTuple):
    """What vertices and faces of a file have from the model; see `write_snapshot_ply`."""

    vertex: dict[str, NDArray[Any]]
    face: dict[str, NDArray[Any]]
    texture: NDArray[np.float32] | None
    comments: list[str]


def _inherited(snapshot: Snapshot, origin: Indices, face_origin: Indices) -> _Inherited:
    """What the vertices and faces of these origins have from the model."""
    rest = snapshot.substrate_vertices[origin]
    vertex: dict[str, NDArray[Any]] = dict(zip(("rest_x", "rest_y", "rest_z"), rest.T, strict=True))
    face: dict[str, NDArray[Any]] = {}
    comments: list[str] = []
    surface = snapshot.surface
    if surface is None:
        return _Inherited(vertex, face, None, comments)
    if surface.place is not None:
        weights = surface.place.barycentric[origin].astype(np.float32)
        vertex |= {
            "input_face": surface.place.face[origin],
            "input_v": weights[:, 1],
            "input_w": weights[:, 2],
        }
    if surface.colors is not None:
        colors = color_bytes(surface.colors[origin, :3])
        vertex |= dict(zip(("base_red", "base_green", "base_blue"), colors.T, strict=True))
    if surface.groups != ("default",):
        face["group"] = surface.face_group[face_origin]
        comments += _names("group", surface.groups)
    if surface.face_part is not None:
        face["object"] = surface.face_part[face_origin]
        comments += [f"object_material {n} {part.material}" for n, part in enumerate(surface.parts)]
        comments += _names("object", [part.name for part in surface.parts])
    texture = None if surface.uv is None else surface.uv[face_origin].astype(np.float32)
    return _Inherited(vertex, face, texture, comments)


def _names(kind: str, names: Sequence[str]) -> list[str]:
    """Comments that name what faces refer to by number, as far as a header has room."""
    comments, room = [], _MOST_NAMES
    for number, name in enumerate(names):
        room -= len(name) + len(kind) + 12
        if room < 0:
            break
        comments.append(f"{kind} {number} {name}")
    return comments


def _read_surface(ply: PlyArrays, metal: int, metal_faces: int, vertices: Vectors, faces: Indices) -> Surface:
    """The surface at the start in a file's arrays: that of the metal, which comes first."""
    vertex = {name: values[:metal] for name, values in ply.vertex.items()}
    face = {name: values[:metal_faces] for name, values in ply.face.items()}
    place = colors = None
    if "input_face" in vertex:
        v, w = (vertex[name].astype(np.float64) for name in ("input_v", "input_w"))
        place = Place(vertex["input_face"], np.stack([1.0 - v - w, v, w], axis=1))
    if "base_red" in vertex:
        base = np.stack([vertex[f"base_{c}"] for c in ("red", "green", "blue")], axis=1) / 255.0
        colors = np.column_stack([base, np.ones(metal)])
    return make_surface(
        vertices,
        faces,
        face_group=face.get("group"),
        groups=_read_names(ply.comments, "group", face.get("group")) or ("default",),
        uv=None if ply.texture is None else ply.texture[:metal_faces].astype(np.float64),
        colors=colors,
        place=place,
        face_part=face.get("object"),
        parts=_read_parts(ply.comments, face.get("object")),
    )


def _read_names(comments: Sequence[str], kind: str, numbers: Indices | None) -> tuple[str, ...]:
    """The names that comments give, as many as the largest of the numbers needs."""
    if numbers is None:
        return ()
    known = dict(c.removeprefix(f"{kind} ").partition(" ")[::2] for c in comments if c.startswith(f"{kind} "))
    count = max(int(numbers.max(initial=-1)) + 1, len(known))
    return tuple(_unescaped(known.get(str(n), f"{kind}_{n}")) for n in range(count))


def _read_parts(comments: Sequence[str], numbers: Indices | None) -> tuple[Part, ...]:
    shown = _read_names(comments, "object_material", numbers)
    names = _read_names(comments, "object", numbers)
    return tuple(
        Part(name, int(material) if material.lstrip("-").isdigit() else -1)
        for name, material in zip(names, shown, strict=True)
    )


def _unescaped(text: str) -> str:
    """A name as it was before the header's ASCII."""
    return re.sub(
        r"\\(?:x([0-9a-f]{2})|u([0-9a-f]{4})|U([0-9a-f]{8}))",
        lambda match: chr(int(match[1] or match[2] or match[3], 16)),
        text,
    )


def _floats(metal: Vectors, film: Vectors) -> NDArray[np.float32]:
    return np.concatenate([metal, film]).astype(np.float32)


def _unpack(ply: PlyArrays) -> Snapshot:
    """The snapshot in a file's arrays; KeyError, ValueError or IndexError where it is none."""
    if ply.comments[0] not in (TITLE, FIRST_TITLE):
        raise ValueError(ply.comments[0])
    facts = dict(comment.partition(" ")[::2] for comment in ply.comments[1:4])
    metal = int(np.sum(ply.vertex["part"] == SUBSTRATE))
    metal_faces = int(np.sum(ply.face["part"] == SUBSTRATE))
    positions = ply.vectors("x", "y", "z")
    normals = ply.vectors("nx", "ny", "nz").astype(np.float64)
    colors = ply.vectors("red", "green", "blue") / 255.0
    rust = ply.vertex["rust"].astype(np.float64)
    vertices = positions[:metal] + float(facts["hair"]) * normals[:metal]
    if "rest_x" in ply.vertex:
        vertices = ply.vectors("rest_x", "rest_y", "rest_z")[:metal]
    return Snapshot(
        step=int(facts["step"]),
        age=float(facts["age"]),
        film_vertices=positions[metal:],
        film_faces=ply.faces[metal_faces:] - np.int32(metal),
        film_face=ply.face["origin"][metal_faces:],
        film_origin=ply.vertex["origin"][metal:],
        film_rust=rust[metal:],
        separated=ply.vertex["separated"][metal:] != 0,
        separation_age=ply.vertex["separation_age"][metal:].astype(np.float64),
        adhesion=ply.vertex["adhesion"][metal:].astype(np.float64),
        film_color=colors[metal:],
        substrate_vertices=vertices,
        substrate_normals=normals[:metal],
        substrate_faces=ply.faces[:metal_faces],
        substrate_rust=rust[:metal],
        dust=ply.vertex["dust"][:metal].astype(np.float64),
        bare=ply.vertex["bare"][:metal] != 0,
        substrate_color=colors[:metal],
        surface=_read_surface(ply, metal, metal_faces, vertices, ply.faces[:metal_faces]),
    )
