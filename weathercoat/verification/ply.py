"""Reading the PLY files of a run: binary, little-endian, vertices and then triangles.

A reader of its own, written from `docs/formats.md`. Counts in the header are held against the file's
length before anything is made of them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.verification.findings import BrokenFileError

_MAGIC = b"ply\nformat binary_little_endian 1.0\n"
_END = b"end_header\n"
_LONGEST_HEADER = 1 << 20
_SIZES = {"uchar": 1, "int": 4, "float": 4, "double": 8}
_CORNERS = "list uchar int vertex_indices"
_CORNERS_SIZE = 13  # the count, and three corners
_TEXTURE = "list uchar float texcoord"
_TEXTURE_SIZE = 25  # the count, and two numbers for each of three corners
_TITLE = "weathercoat snapshot 2"

# The properties of a snapshot, as its header lists them, and the same as fields of a record.
_VERTEX_LINES = (
    *("double x", "double y", "double z", "float nx", "float ny", "float nz"),
    *("uchar red", "uchar green", "uchar blue", "uchar part", "float rust", "float dust"),
    *("uchar separated", "float adhesion", "float separation_age", "uchar bare", "int origin"),
)
_VERTEX_FIELDS: list[tuple[Any, ...]] = [
    ("position", "<f8", (3,)),
    ("normal", "<f4", (3,)),
    ("color", "u1", (3,)),
    ("part", "u1"),
    ("rust", "<f4"),
    ("dust", "<f4"),
    ("separated", "u1"),
    ("adhesion", "<f4"),
    ("separation_age", "<f4"),
    ("bare", "u1"),
    ("origin", "<i4"),
]
# What vertices and faces have from the model, after these, as far as the model has it.
_VERTEX_MORE = (
    (("double rest_x", "double rest_y", "double rest_z"), ("rest", "<f8", (3,))),
    (("int input_face",), ("input_face", "<i4")),
    (("float input_v", "float input_w"), ("input_weights", "<f4", (2,))),
    (("uchar base_red", "uchar base_green", "uchar base_blue"), ("base_color", "u1", (3,))),
)
_FACE_LINES = ("uchar part", "int origin")
_FACE_FIELDS: list[tuple[Any, ...]] = [("count", "u1"), ("corners", "<i4", (3,))]
_TEXTURE_FIELDS: list[tuple[Any, ...]] = [("texture_count", "u1"), ("texture", "<f4", (6,))]
_FACE_MORE = ((("int group",), ("group", "<i4")), (("int object",), ("object", "<i4")))


@dataclass(frozen=True)
class Ply:
    """A PLY file's header, and where its tables lie in `content`."""

    content: bytes
    comments: tuple[str, ...]
    vertex_lines: tuple[str, ...]
    face_lines: tuple[str, ...]
    vertex_count: int
    face_count: int
    vertex_start: int
    face_start: int


@dataclass(frozen=True)
class PlySnapshot:
    """What a snapshot's PLY holds, metal and film in one; arrays in the types of the file.

    Vertices: positions (n, 3), normals (n, 3), colors (n, 3), and (n,) each: part, rust, dust, separated,
    adhesion, separation_age, bare, origin. Faces: faces int32 (m, 3), face_part, face_origin (m,).
    vertex_more, face_more: what they have from the model by name: rest (n, 3), input_face (n,), input_weights
    (n, 2), base_color (n, 3); texture (m, 6), group (m,), object (m,).
    """

    step: int
    age: float
    hair: float
    positions: NDArray[np.float64]
    normals: NDArray[np.float32]
    colors: NDArray[np.uint8]
    part: NDArray[np.uint8]
    rust: NDArray[np.float32]
    dust: NDArray[np.float32]
    separated: NDArray[np.uint8]
    adhesion: NDArray[np.float32]
    separation_age: NDArray[np.float32]
    bare: NDArray[np.uint8]
    origin: NDArray[np.int32]
    faces: NDArray[np.int32]
    face_part: NDArray[np.uint8]
    face_origin: NDArray[np.int32]
    vertex_more: dict[str, NDArray[Any]]
    face_more: dict[str, NDArray[Any]]


def read_ply(content: bytes) -> Ply:
    """The header of a PLY file and the places of its tables; raises BrokenFileError."""
    end = content.find(_END, 0, _LONGEST_HEADER)
    if not content.startswith(_MAGIC) or end < 0:
        raise BrokenFileError("no binary little-endian PLY")
    lines = content[len(_MAGIC) : end].decode("latin-1").split("\n")[:-1]
    comments = [line.removeprefix("comment ") for line in lines if line.startswith("comment ")]
    names: list[str] = []
    counts: list[int] = []
    properties: list[list[str]] = []
    for line in lines:
        if match := re.fullmatch(r"element (\w+) (\d{1,18})", line):
            names.append(match[1])
            counts.append(int(match[2]))
            properties.append([])
        elif line.startswith("property ") and properties:
            properties[-1].append(line.removeprefix("property "))
        elif not line.startswith("comment "):
            raise BrokenFileError(f"unexpected line {line[:40]!r} in the header")
    if names != ["vertex", "face"] or not properties[1] or properties[1][0] != _CORNERS:
        raise BrokenFileError("the header tells of no vertices and then triangles")
    start = end + len(_END)
    middle = start + counts[0] * _row_size(properties[0])
    expected = middle + counts[1] * (_CORNERS_SIZE + _row_size(properties[1][1:]))
    if len(content) != expected:
        raise BrokenFileError(f"the header asks for {expected:,} bytes, the file holds {len(content):,}")
    return Ply(
        content=content,
        comments=tuple(comments),
        vertex_lines=tuple(properties[0]),
        face_lines=tuple(properties[1]),
        vertex_count=counts[0],
        face_count=counts[1],
        vertex_start=start,
        face_start=middle,
    )


def read_snapshot(content: bytes) -> PlySnapshot:
    """A snapshot's PLY; raises BrokenFileError where it is none."""
    ply = read_ply(content)
    has_texture = ply.face_lines[1:2] == (_TEXTURE,)
    begin = (_CORNERS, _TEXTURE) if has_texture else (_CORNERS,)
    vertex_fields = _more_fields(ply.vertex_lines, _VERTEX_LINES, _VERTEX_MORE)
    face_fields = _more_fields(ply.face_lines, begin + _FACE_LINES, _FACE_MORE)
    if vertex_fields is None or face_fields is None:
        raise BrokenFileError("its properties are not those of a snapshot")
    if not ply.comments or ply.comments[0] != _TITLE:
        raise BrokenFileError(f"its first comment is not {_TITLE!r}")
    own: list[tuple[Any, ...]] = [("part", "u1"), ("origin", "<i4")]
    lists = _FACE_FIELDS + _TEXTURE_FIELDS if has_texture else _FACE_FIELDS
    vertex_type = np.dtype([*_VERTEX_FIELDS, *vertex_fields])
    face_type = np.dtype([*lists, *own, *face_fields])
    vertex = np.frombuffer(content, vertex_type, ply.vertex_count, ply.vertex_start)
    face = np.frombuffer(content, face_type, ply.face_count, ply.face_start)
    wrong = np.flatnonzero(face["count"] != 3)
    if len(wrong):
        raise BrokenFileError(f"face {wrong[0]} has {face['count'][wrong[0]]} corners")
    if has_texture and np.any(face["texture_count"] != 6):
        raise BrokenFileError("a face has not three texture coordinates")

    def column(name: str) -> NDArray[Any]:
        return np.ascontiguousarray(vertex[name])

    return PlySnapshot(
        step=int(_fact(ply, "step", r"\d{1,18}")),
        age=float(_fact(ply, "age", r"[0-9.e+-]+")),
        hair=float(_fact(ply, "hair", r"[0-9.e+-]+")),
        positions=column("position"),
        normals=column("normal"),
        colors=column("color"),
        part=column("part"),
        rust=column("rust"),
        dust=column("dust"),
        separated=column("separated"),
        adhesion=column("adhesion"),
        separation_age=column("separation_age"),
        bare=column("bare"),
        origin=column("origin"),
        faces=np.ascontiguousarray(face["corners"]),
        face_part=np.ascontiguousarray(face["part"]),
        face_origin=np.ascontiguousarray(face["origin"]),
        vertex_more={field[0]: column(field[0]) for field in vertex_fields},
        face_more={
            name: np.ascontiguousarray(face[name])
            for name in ([field[0] for field in face_fields] + (["texture"] if has_texture else []))
        },
    )


def _more_fields(
    lines: tuple[str, ...], first: tuple[str, ...], more: tuple[tuple[tuple[str, ...], tuple[Any, ...]], ...]
) -> list[tuple[Any, ...]] | None:
    """The fields of the properties after the `first` ones; None where these are others, or in disorder."""
    if lines[: len(first)] != first:
        return None
    rest, fields = lines[len(first) :], []
    for names, field in more:
        if rest[: len(names)] == names:
            rest = rest[len(names) :]
            fields.append(field)
    return None if rest else fields


def read_triangles(content: bytes) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Positions (n, 3) and corners (m, 3) of a PLY of any other properties; raises BrokenFileError."""
    ply = read_ply(content)
    if ply.vertex_lines[:3] != ("double x", "double y", "double z"):
        raise BrokenFileError("its vertices do not begin with their position")
    vertex = np.dtype([("position", "<f8", (3,)), ("more", f"V{_row_size(ply.vertex_lines[3:])}")])
    face = np.dtype(
        [("count", "u1"), ("corners", "<i4", (3,)), ("more", f"V{_row_size(ply.face_lines[1:])}")]
    )
    positions = np.frombuffer(content, vertex, ply.vertex_count, ply.vertex_start)["position"]
    faces = np.frombuffer(content, face, ply.face_count, ply.face_start)
    if np.any(faces["count"] != 3):
        raise BrokenFileError("a face is no triangle")
    return np.ascontiguousarray(positions), np.ascontiguousarray(faces["corners"])


def _row_size(lines: tuple[str, ...] | list[str]) -> int:
    """Bytes of the scalar properties of one row."""
    size = 0
    for line in lines:
        if line == _TEXTURE:
            size += _TEXTURE_SIZE
            continue
        kind, _, name = line.partition(" ")
        if kind not in _SIZES or not name or " " in name:
            raise BrokenFileError(f"unexpected property {line[:40]!r} in the header")
        size += _SIZES[kind]
    return size


def _fact(ply: Ply, name: str, pattern: str) -> str:
    """The number that a comment of the header gives."""
    for comment in ply.comments:
        if match := re.fullmatch(f"{name} ({pattern})", comment):
            try:
                if np.isfinite(float(match[1])):
                    return match[1]
            except ValueError:
                break
    raise BrokenFileError(f"no comment gives its {name}")
