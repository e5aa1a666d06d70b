"""All that meshio reads beyond our own formats: the triangles, quads and polygons of its cells."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import CorruptError, LimitError, SecurityError, UnsupportedError
from weathercoat.mesh.formats.polygons import Polygons
from weathercoat.mesh.formats.sniff import FOREIGN

_CHILD = Path(__file__).with_name("foreign_child.py")
_ESCAPED, _LACKING = 2, 3  # exit codes of the child
_MAX_SECONDS = 45.0
# Corners in the order of the outline, without the points on the middle of edges and faces.
_FACE_CELLS = {
    "triangle": 3, "quad": 4, "polygon": 0,
    "triangle6": 3, "triangle7": 3, "quad8": 4, "quad9": 4,
}  # fmt: skip


def read_foreign(data: bytes, extension: str) -> Polygons:
    """The surface cells of a file that meshio reads by its extension; volume cells are passed over.

    meshio reads by path alone, so the bytes go through a temporary folder, in which it finds no other file;
    and in a process of its own, for the reasons that `foreign_child` gives.
    Errors: CorruptError with meshio's own words, UnsupportedError, SecurityError, LimitError.
    """
    if extension not in FOREIGN:
        raise UnsupportedError(f"the format {extension!r} is not known")
    with tempfile.TemporaryDirectory() as folder:
        model, result = Path(folder, f"model.{extension}"), Path(folder, "result.npz")
        model.write_bytes(data)
        try:
            child = subprocess.run(
                [sys.executable, "-P", str(_CHILD), str(model), str(result)],
                capture_output=True,
                timeout=_MAX_SECONDS,
                cwd=folder,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise LimitError(
                f"meshio has not read it as {extension} within {_MAX_SECONDS:g} s", remedy="convert it to PLY"
            ) from None
        said = " ".join(child.stderr.decode("utf-8", "replace").replace(folder, "").split())[-120:]
        if child.returncode == _ESCAPED:
            raise SecurityError(f"it refers to another file or to the network: {said}")
        if child.returncode == _LACKING:
            raise UnsupportedError(f"meshio cannot read {extension} here: {said}", remedy="convert it to PLY")
        if child.returncode:
            raise CorruptError(f"meshio cannot read it as {extension}: {said or 'its process ended'}")
        with np.load(result) as arrays:
            points = arrays["points"]
            cells = [(name.partition(" ")[2], arrays[name]) for name in arrays if name != "points"]
    return _polygons(points, cells)


def _polygons(points: NDArray[np.float64], cells: list[tuple[str, NDArray[np.int64]]]) -> Polygons:
    """The faces among the cells, given by their types, in the order of the file."""
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise UnsupportedError(f"points have {points.shape[-1]} dimensions")
    positions = np.zeros((len(points), 3))
    positions[:, : points.shape[1]] = points
    corners, sizes = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for kind, data in cells:
        if kind not in _FACE_CELLS or not len(data):
            continue
        data = data[:, : _FACE_CELLS[kind] or data.shape[1]]
        corners.append(data.ravel())
        sizes.append(np.full(len(data), data.shape[1], np.int64))
    polygons = Polygons(positions=positions, corners=np.concatenate(corners), sizes=np.concatenate(sizes))
    polygons.face_group = np.zeros(len(polygons.sizes), np.int32)
    polygons.drop_illegal()
    return polygons
