"""All that meshio reads beyond our own formats: the triangles, quads and polygons of its cells."""

from __future__ import annotations

import contextlib
import io
import tempfile
from pathlib import Path

import numpy as np

from weathercoat.errors import CorruptError, UnsupportedError, WeathercoatError
from weathercoat.mesh.formats.polygons import Polygons
from weathercoat.mesh.formats.sniff import FOREIGN

# Corners in the order of the outline, without the points on the middle of edges and faces.
_FACE_CELLS = {
    "triangle": 3, "quad": 4, "polygon": 0,
    "triangle6": 3, "triangle7": 3, "quad8": 4, "quad9": 4,
}  # fmt: skip


def read_foreign(data: bytes, extension: str) -> Polygons:
    """The surface cells of a file that meshio reads by its extension; volume cells are passed over.

    meshio reads by path alone, so the bytes go through a temporary folder, in which it finds no other file.
    Errors: CorruptError with meshio's own words, UnsupportedError.
    """
    if extension not in FOREIGN:
        raise UnsupportedError(f"the format {extension!r} is not known")
    import meshio

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"model.{extension}"
        path.write_bytes(data)
        words = io.StringIO()
        try:
            with (
                contextlib.redirect_stdout(words),
                contextlib.redirect_stderr(words),
                np.errstate(all="ignore"),
            ):
                mesh = meshio.read(path)
        except (Exception, SystemExit) as error:  # meshio ends the process on some files
            said = " ".join(f"{error} {words.getvalue()}".replace(folder, "").split())[:120]
            raise CorruptError(
                f"meshio cannot read it as {extension}: {type(error).__name__} {said}"
            ) from None
    try:
        return _polygons(mesh)
    except WeathercoatError:
        raise
    except (ValueError, TypeError, IndexError, OverflowError) as error:
        raise CorruptError(f"meshio reads no sensible mesh from it: {error}") from None


def _polygons(mesh: object) -> Polygons:
    points = np.asarray(mesh.points, np.float64)  # type: ignore[attr-defined]
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise UnsupportedError(f"points have {points.shape[-1]} dimensions")
    positions = np.zeros((len(points), 3))
    positions[:, : points.shape[1]] = points
    corners, sizes = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for block in mesh.cells:  # type: ignore[attr-defined]
        if block.type not in _FACE_CELLS or not len(block.data):
            continue
        data = np.asarray(block.data, np.int64)
        data = data[:, : _FACE_CELLS[block.type] or data.shape[1]]
        corners.append(data.ravel())
        sizes.append(np.full(len(data), data.shape[1], np.int64))
    polygons = Polygons(positions=positions, corners=np.concatenate(corners), sizes=np.concatenate(sizes))
    polygons.face_group = np.zeros(len(polygons.sizes), np.int32)
    polygons.drop_illegal()
    return polygons
