"""Binary PLY: writing triangle meshes with vertex colours and named scalars, and reading such files back.

Positions are doubles, so that a model far from its origin keeps its digits. General PLY files are read by
`weathercoat.mesh.read`; the reader here takes only what the writer makes, and refuses everything else.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from weathercoat.errors import AccessError, CorruptError, FormatError

PROPERTY_TYPES = {"uchar": "u1", "int": "<i4", "float": "<f4", "double": "<f8"}
TYPE_NAMES = {np.dtype(code): name for name, code in PROPERTY_TYPES.items()}
CORNER_LIST = "property list uchar int vertex_indices"
CORNER_FIELDS: list[tuple[Any, ...]] = [("count", "u1"), ("vertex_indices", "<i4", (3,))]
TEXTURE_LIST = "property list uchar float texcoord"
TEXTURE_FIELDS: list[tuple[Any, ...]] = [("texcoord_count", "u1"), ("texcoord", "<f4", (6,))]
_IN_LISTS = {field[0] for field in CORNER_FIELDS + TEXTURE_FIELDS}
HEADER_LIMIT = 1 << 20


@dataclass(frozen=True)
class PlyArrays:
    """Content of a PLY file.

    comments: the header's comment lines; vertex, face: the named properties, each (n,) or (m,), in the types
    of the file; faces: int32 (m, 3); texture: float32 (m, 3, 2), the texture coordinates of corners, or None.
    """

    comments: tuple[str, ...]
    vertex: dict[str, NDArray[Any]]
    face: dict[str, NDArray[Any]]
    faces: NDArray[np.int32]
    texture: NDArray[np.float32] | None = None

    def vectors(self, *names: str) -> NDArray[Any]:
        """The named vertex properties side by side, (n, len(names))."""
        return np.stack([self.vertex[name] for name in names], axis=1)


def write_ply(
    target: Path | str | BinaryIO,
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    normals: ArrayLike | None = None,
    colors: ArrayLike | None = None,
    scalars: Mapping[str, NDArray[Any]] | None = None,
    face_scalars: Mapping[str, NDArray[Any]] | None = None,
    texture: ArrayLike | None = None,
    comments: Iterable[str] = (),
) -> None:
    """Write a triangle mesh as binary little-endian PLY to a path or a binary stream.

    vertices (n, 3), faces (m, 3); normals (n, 3), written as floats; colors uint8 (n, 3), sRGB; scalars (n,)
    and face_scalars (m,), named, each of type bool, uint8, int32, float32 or float64 and written as such;
    texture (m, 3, 2), texture coordinates of corners, written as floats in a list `texcoord` of each face.
    Raises ValueError where lengths or types do not fit, OSError where the target cannot be written.
    """
    positions = np.asarray(vertices, np.float64)
    corners = np.asarray(faces, np.int32).reshape(-1, 3)
    columns: dict[str, NDArray[Any]] = dict(zip("xyz", positions.T, strict=True))
    if normals is not None:
        columns |= dict(zip(("nx", "ny", "nz"), np.asarray(normals, np.float32).T, strict=True))
    if colors is not None:
        colors = np.asarray(colors)
        if colors.dtype != np.uint8:
            raise ValueError(f"colors must be uint8, not {colors.dtype}")
        columns |= dict(zip(("red", "green", "blue"), colors.T, strict=True))
    columns |= scalars or {}
    vertex_table = _pack(columns, len(positions), [])
    lists = CORNER_FIELDS if texture is None else CORNER_FIELDS + TEXTURE_FIELDS
    face_table = _pack(face_scalars or {}, len(corners), lists)
    face_table["count"] = 3
    face_table["vertex_indices"] = corners
    if texture is not None:
        face_table["texcoord_count"] = 6
        face_table["texcoord"] = np.asarray(texture, np.float32).reshape(-1, 6)

    header = ["ply", "format binary_little_endian 1.0"]
    header += ["comment " + " ".join(comment.split()) for comment in comments]
    header += [f"element vertex {len(positions)}", *_property_lines(vertex_table)]
    header += [f"element face {len(corners)}", CORNER_LIST]
    header += [] if texture is None else [TEXTURE_LIST]
    header += [*_property_lines(face_table), "end_header", ""]
    content = ("\n".join(header).encode("ascii", "backslashreplace"), vertex_table, face_table)
    if isinstance(target, (str, Path)):
        with Path(target).open("wb") as stream:
            _write_all(stream, content)
    else:
        _write_all(target, content)


def read_ply_arrays(path: Path | str) -> PlyArrays:
    """Read a PLY file that `write_ply` made.

    Raises AccessError where the file cannot be opened, FormatError where it is no PLY of this kind,
    CorruptError where it contradicts itself (truncated, counts that do not fit, corners out of range).
    """
    path = Path(path)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise AccessError(error.strerror or "cannot be read", file=str(path)) from error
    end = content.find(b"end_header\n", 0, HEADER_LIMIT)
    if not content.startswith(b"ply\nformat binary_little_endian 1.0\n") or end < 0:
        raise FormatError(
            "no binary little-endian PLY", file=str(path), remedy="give a file of a run's folder"
        )
    lines = content[:end].decode("ascii", "replace").split("\n")[2:-1]
    comments = tuple(line[len("comment ") :] for line in lines if line.startswith("comment "))
    vertex_count, vertex_type, face_count, face_type = _parse_elements(lines[len(comments) :], path)

    start = end + len(b"end_header\n")
    middle = start + vertex_count * vertex_type.itemsize
    expected = middle + face_count * face_type.itemsize
    if len(content) != expected:
        raise CorruptError(f"header asks for {expected} bytes, file holds {len(content)}", file=str(path))
    vertex_table = np.frombuffer(content, vertex_type, vertex_count, start)
    face_table = np.frombuffer(content, face_type, face_count, middle)
    faces = np.ascontiguousarray(face_table["vertex_indices"], np.int32)
    if face_count and (np.any(face_table["count"] != 3) or faces.min() < 0 or faces.max() >= vertex_count):
        raise CorruptError("a face is no triangle or refers to no vertex", file=str(path))
    texture = None
    if "texcoord" in (face_table.dtype.names or ()):
        if face_count and np.any(face_table["texcoord_count"] != 6):
            raise CorruptError("a face has not three texture coordinates", file=str(path))
        texture = np.ascontiguousarray(face_table["texcoord"], np.float32).reshape(-1, 3, 2)
    return PlyArrays(comments, _unpack(vertex_table), _unpack(face_table), faces, texture)


def color_bytes(colors: ArrayLike) -> NDArray[np.uint8]:
    """Colours 0 to 1 as bytes, rounded to the nearest."""
    return np.floor(np.clip(np.asarray(colors, np.float64), 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)


def _pack(columns: Mapping[str, NDArray[Any]], length: int, first: list[tuple[Any, ...]]) -> NDArray[Any]:
    """A packed table of the fields `first`, left unset, followed by `columns`."""
    fields = list(first)
    for name, column in columns.items():
        stored = np.dtype(np.uint8) if column.dtype == np.bool_ else column.dtype.newbyteorder("<")
        if column.shape != (length,) or stored not in TYPE_NAMES:
            raise ValueError(
                f"{name}: {column.dtype} of shape {column.shape} is no PLY property of {length} elements"
            )
        fields.append((name, stored))
    table = np.empty(length, fields)
    for name, column in columns.items():
        table[name] = column
    return table


def _property_lines(table: NDArray[Any]) -> list[str]:
    """Header lines of the table's scalar properties."""
    assert table.dtype.fields is not None
    types = {name: field[0] for name, field in table.dtype.fields.items()}
    return [f"property {TYPE_NAMES[kind]} {name}" for name, kind in types.items() if name not in _IN_LISTS]


def _write_all(stream: BinaryIO, content: tuple[bytes, NDArray[Any], NDArray[Any]]) -> None:
    header, *tables = content
    stream.write(header)
    for table in tables:
        if len(table):
            stream.write(table.view(np.uint8).data)


def _parse_elements(lines: list[str], path: Path) -> tuple[int, np.dtype[Any], int, np.dtype[Any]]:
    """Count and type of the vertex table and of the face table."""
    elements: list[tuple[str, int, list[tuple[Any, ...]]]] = []
    for line in lines:
        match line.split():
            case ["element", "vertex" | "face" as name, count] if count.isdigit():
                elements.append((name, int(count), []))
            case ["property", kind, name] if kind in PROPERTY_TYPES and elements:
                elements[-1][2].append((name, PROPERTY_TYPES[kind]))
            case _ if line == CORNER_LIST and elements:
                elements[-1][2].extend(CORNER_FIELDS)
            case _ if line == TEXTURE_LIST and elements:
                elements[-1][2].extend(TEXTURE_FIELDS)
            case _:
                raise FormatError(f"unexpected line {line[:60]!r} in the PLY header", file=str(path))
    if [name for name, _, _ in elements] != ["vertex", "face"] or elements[1][2][:2] != CORNER_FIELDS:
        raise FormatError("the PLY file does not hold vertices, then triangles", file=str(path))
    try:
        types = [np.dtype(fields) for _, _, fields in elements]
    except ValueError as error:
        raise CorruptError("the PLY header names a property twice", file=str(path)) from error
    return elements[0][1], types[0], elements[1][1], types[1]


def _unpack(table: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """The table's scalar properties, each contiguous and of native byte order."""
    names = [name for name in table.dtype.names or () if name not in _IN_LISTS]
    return {name: np.ascontiguousarray(table[name], table.dtype[name].newbyteorder("=")) for name in names}
