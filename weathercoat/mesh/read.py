"""Reading a model: from a file or a stream to a repaired `Surface`.

The content decides the format, the extension only where the content does not tell. Nothing outside the
model's folder is read, and nothing from the network.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO

import numpy as np

from weathercoat.errors import (
    AccessError,
    EmptyFileError,
    FormatError,
    LimitError,
    Note,
    UsageError,
    WeathercoatError,
)
from weathercoat.mesh.beside import files_beside
from weathercoat.mesh.formats import sniff
from weathercoat.mesh.formats.mtl import picture_names
from weathercoat.mesh.formats.polygons import Polygons
from weathercoat.mesh.repair import repair
from weathercoat.mesh.surface import Surface

MAX_BYTES = 2 << 30

Up = str | tuple[float, float, float]

_AXES = {
    "x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0),
    "-x": (-1.0, 0.0, 0.0), "-y": (0.0, -1.0, 0.0), "-z": (0.0, 0.0, -1.0),
}  # fmt: skip
# glTF fixes its axis; the others follow the habit of the programs that write them.
UP_OF_FORMAT = {"glb": "y", "gltf": "y", "obj": "y", "stl": "z", "ply": "z", "off": "z"}
_UP_OF_OTHERS = "z"


def read_surface(
    path: str | Path, *, format: str | None = None, up: Up = "auto", max_faces: int = 20_000_000
) -> Surface:
    """Read a model, weld and repair it, ready for remeshing.

    format: overrules content and extension: obj, ply, stl, off, glb, gltf, or an extension that meshio knows.
    up: "auto" follows the format (glTF and OBJ +y, all others +z), else x, y, z, -x, -y, -z or a vector.
    max_faces: triangles beyond which the model is refused.

    Errors: AccessError, EmptyFileError, FormatError, CorruptError, MissingFileError, SecurityError,
    UnsupportedError; NoFacesError, NoAreaError, NonFiniteError, PrecisionError, ScaleError; LimitError;
    each with the file's name.
    """
    path = Path(path)
    direction = _direction(up)
    try:
        data = load_bytes(path)
        return _make_surface(data, path, name_of(path), format, direction, max_faces)
    except WeathercoatError as error:
        error.file = error.file or str(path)
        raise


def name_of(path: Path) -> str:
    """The name of a file, read as UTF-8 whatever the locale, so that it is written the same in all."""
    return os.fsencode(path.name).decode("utf-8", "surrogateescape")


def side_files(path: Path) -> list[Path]:
    """The files beside a model that are read with it: buffers, libraries of materials, pictures; sorted, and
    only those that are there. Whatever is wrong with the model or with them, reading it tells.
    """
    if path.suffix.lower() not in (".gltf", ".obj"):
        return []
    folder = path.parent.resolve()

    def found(names: list[str]) -> set[Path]:
        files = {(folder / name).resolve() for name in names}
        return {file for file in files if file.is_relative_to(folder) and file.is_file()}

    try:
        beside = files_beside(path.read_bytes(), path.name)
        files = found([*beside.read, *beside.noticed])
        for library in [file for file in files if file.suffix.lower() == ".mtl"]:
            files |= found(picture_names(library.read_bytes()))
    except (OSError, ValueError):
        return []
    return sorted(files)


def read_stream(
    stream: BinaryIO, *, format: str | None = None, up: Up = "auto", max_faces: int = 20_000_000
) -> Surface:
    """Read a model from a binary stream, as `read_surface` does; it cannot refer to other files."""
    direction = _direction(up)
    try:
        data = stream.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise LimitError(f"the input is larger than {MAX_BYTES >> 20} MB")
        return _make_surface(data, None, "stdin", format, direction, max_faces)
    except WeathercoatError as error:
        error.file = error.file or "-"
        raise


def load_bytes(path: Path) -> bytes:
    """The bytes of a regular file; refuses everything else at once, with AccessError or LimitError."""
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise AccessError("is a directory")
        if not stat.S_ISREG(status.st_mode):
            raise AccessError("is no regular file")
        if status.st_size > MAX_BYTES:
            raise LimitError(f"the file has {status.st_size >> 20} MB, the limit is {MAX_BYTES >> 20} MB")
        return path.read_bytes()
    except FileNotFoundError:
        raise AccessError("does not exist") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise AccessError(f"cannot be read: {reason}") from None


def _make_surface(
    data: bytes,
    path: Path | None,
    name: str,
    format: str | None,
    up: tuple[float, float, float] | None,
    max_faces: int,
) -> Surface:
    kind, notes = _kind(data, name, format)
    if kind == "zip":
        from weathercoat.mesh.formats.archive import unpack_model

        data, name = unpack_model(data, MAX_BYTES)
        path = None
        kind, more = _kind(data, name, None)
        notes += more
        if kind == "zip":
            raise FormatError("a zip archive within a zip archive", remedy="unpack it first")
    axis = up or _AXES[UP_OF_FORMAT.get(kind, _UP_OF_OTHERS)]
    # Numbers that are not finite, or too large, are found and reported by the checks, not by NumPy.
    with np.errstate(invalid="ignore", over="ignore"):
        polygons = _parse(data, kind, path)
        polygons.notes[:0] = notes
        return repair(polygons, up=axis, name=Path(name).stem, format=kind, max_faces=max_faces)


def _kind(data: bytes, name: str, format: str | None) -> tuple[str, list[Note]]:
    """The format that is given, else that of the content and the name; a note where these disagree."""
    if not data:
        raise EmptyFileError("the file has no bytes")
    if format is not None:
        return format.lower().removeprefix("."), []
    kind, note = sniff.identify(data, Path(name).suffix.lower().removeprefix("."))
    return kind, [note] if note else []


def _parse(data: bytes, kind: str, path: Path | None) -> Polygons:
    folder = None if path is None else path.parent
    if kind == "obj":
        from weathercoat.mesh.formats.obj import read_obj

        return read_obj(data, folder)
    if kind == "ply":
        from weathercoat.mesh.formats.ply import read_ply

        return read_ply(data)
    if kind == "stl":
        from weathercoat.mesh.formats.stl import read_stl

        return read_stl(data)
    if kind == "off":
        from weathercoat.mesh.formats.off import read_off

        return read_off(data)
    if kind in ("glb", "gltf"):
        from weathercoat.mesh.formats.gltf import read_gltf

        return read_gltf(data, folder)
    from weathercoat.mesh.formats.foreign import read_foreign

    return read_foreign(data, kind)


def _direction(up: Up) -> tuple[float, float, float] | None:
    """A unit vector, or None for "auto"."""
    if isinstance(up, str):
        if up == "auto":
            return None
        if up.removeprefix("+") not in _AXES:
            raise UsageError(f"up is {up!r}, but must be auto, x, y, z, -x, -y, -z or a vector")
        return _AXES[up.removeprefix("+")]
    vector = np.asarray(up, np.float64)
    length = np.linalg.norm(vector)
    if vector.shape != (3,) or not np.isfinite(length) or length == 0:
        raise UsageError(f"up is {up!r}, but must be a vector of three numbers that is not zero")
    x, y, z = (vector / length).tolist()
    return (x, y, z)
