"""Surfaces as files: OBJ, PLY, STL, OFF and GLB, for what is remeshed or sampled."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import UsageError
from weathercoat.mesh.surface import Surface, face_normals
from weathercoat.output.folder import whole_file
from weathercoat.output.ply import color_bytes, write_ply

# Rows that are turned into text at a time: enough to amortise the call, little enough to stay in the cache.
ROWS = 16384


def write_mesh(
    target: Path | str | BinaryIO, surface: Surface, *, format: str | None = None, overwrite: bool = False
) -> None:
    """Write a surface to a path, in the format of its extension or the one named, or to a binary stream.

    OBJ keeps groups, texture coordinates and vertex colours (after the position), GLB all three (turned
    y-up), PLY colours, texture coordinates (a list `texcoord` of each face) and groups (a face property
    `group`, its names in comments), STL and OFF the bare triangles. Shading normals are left to the reader.
    A file appears only once it is whole. Raises UsageError for a format that is not written,
    OutputExistsError, OutputError.
    """
    writer = WRITERS[mesh_format(target, format)]
    if isinstance(target, (str, Path)):
        with whole_file(target, overwrite=overwrite) as stream:
            writer(stream, surface)
    else:
        writer(target, surface)


def mesh_format(target: Path | str | BinaryIO, format: str | None = None) -> str:
    """The format that `write_mesh` would take, to be refused before any work; UsageError where it is not
    written."""
    if format is None and not isinstance(target, (str, Path)):
        raise UsageError("the format of a stream must be named", remedy="give --format")
    wanted = Path(str(target)).suffix if format is None else format
    name = wanted.lower().lstrip(".")
    if name not in WRITERS:
        known = ", ".join(WRITERS)
        raise UsageError(
            f"meshes are not written as {wanted or 'a file without extension'}", remedy=f"use {known}"
        )
    return name


def _write_obj(stream: BinaryIO, surface: Surface) -> None:
    columns = surface.vertices
    if surface.colors is not None:
        columns = np.column_stack([columns, surface.colors[:, :3]])
    for text in text_lines("v" + " %r" * columns.shape[1] + "\n", columns):
        stream.write(text)
    corner = surface.faces + 1
    row = "f %d %d %d\n"
    if surface.uv is not None:
        rows, index = np.unique(surface.uv.reshape(-1, 2), axis=0, return_inverse=True)
        for text in text_lines("vt %r %r\n", rows):
            stream.write(text)
        corner = np.stack([corner, index.reshape(-1, 3) + 1], axis=2).reshape(-1, 6)
        row = "f %d/%d %d/%d %d/%d\n"
    for number, name in enumerate(surface.groups):
        chosen = corner[surface.face_group == number]
        if len(chosen):
            if surface.groups != ("default",):
                stream.write(f"g {'_'.join(name.split())}\n".encode("utf-8", "replace"))
            for text in text_lines(row, chosen):
                stream.write(text)


def _write_ply(stream: BinaryIO, surface: Surface) -> None:
    grouped = surface.groups != ("default",)
    write_ply(
        stream,
        surface.vertices,
        surface.faces,
        colors=None if surface.colors is None else color_bytes(surface.colors[:, :3]),
        face_scalars={"group": surface.face_group} if grouped else {},
        texture=surface.uv,
        comments=[f"group {number} {name}" for number, name in enumerate(surface.groups)] if grouped else (),
    )


def _write_stl(stream: BinaryIO, surface: Surface) -> None:
    record = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    table = np.zeros(len(surface.faces), record)
    normal = face_normals(surface.vertices, surface.faces)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    table["normal"] = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    table["corners"] = surface.vertices[surface.faces]
    stream.write(b"weathercoat".ljust(80) + np.uint32(len(table)).astype("<u4").tobytes() + table.tobytes())


def _write_off(stream: BinaryIO, surface: Surface) -> None:
    stream.write(f"OFF\n{len(surface.vertices)} {len(surface.faces)} 0\n".encode())
    for text in text_lines("%r %r %r\n", surface.vertices):
        stream.write(text)
    for text in text_lines("3 %d %d %d\n", surface.faces):
        stream.write(text)


def _write_glb(stream: BinaryIO, surface: Surface) -> None:
    from weathercoat.output.glb import write_glb
    from weathercoat.output.sheets import surface_nodes

    write_glb(stream, surface_nodes(surface), up=surface.up)


def text_lines(row: str, table: NDArray[Any]) -> Iterator[bytes]:
    """Rows of numbers as text; `%r` gives the fewest digits that read back as the same double."""
    for start in range(0, len(table), ROWS):
        chunk = table[start : start + ROWS]
        yield (row * len(chunk) % tuple(chunk.ravel().tolist())).encode()


WRITERS = {"obj": _write_obj, "ply": _write_ply, "stl": _write_stl, "off": _write_off, "glb": _write_glb}
