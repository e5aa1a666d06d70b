"""STL, binary and text.

Source: 3D Systems, StereoLithography Interface Specification, 1989. Binary files may begin with "solid" as
well: their size tells.
"""

from __future__ import annotations

import numpy as np

from weathercoat.errors import CorruptError
from weathercoat.mesh.formats.obj import number_groups
from weathercoat.mesh.formats.polygons import Polygons
from weathercoat.mesh.formats.text import Lines, decode_names, normalise, pack

HEADER_BYTES = 84
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_FACET_LINES = ("facet", "outer", "vertex", "vertex", "vertex", "endloop", "endfacet")


def is_binary_stl(data: bytes) -> bool:
    """Whether the size of `data` is what its header announces as binary STL."""
    return len(data) >= HEADER_BYTES and len(data) == HEADER_BYTES + FACET.itemsize * _announced(data)


def looks_like_coordinates(data: bytes) -> bool:
    """Whether the records of `data`, taken as binary STL with whatever count, are mostly sensible numbers.

    Of random bits, taken as float32, a third lies between 1e-12 and 1e12; of coordinates and normals almost
    all.
    """
    whole = (len(data) - HEADER_BYTES) // FACET.itemsize
    if whole < 1:
        return False
    records = np.frombuffer(data, FACET, min(whole, 1000), HEADER_BYTES)
    magnitude = np.abs(records["corners"])
    return bool(((magnitude == 0) | ((magnitude > 1e-12) & (magnitude < 1e12))).mean() > 0.6)


def read_stl(data: bytes) -> Polygons:
    """The triangles of an STL file; the solids of a text file are its groups.

    Errors: CorruptError, with the announced and the real count, or the line.
    """
    if not is_binary_stl(data) and is_text_stl(data):
        return _read_text(data)
    if len(data) < HEADER_BYTES:
        raise CorruptError(f"the header of a binary STL has {HEADER_BYTES} bytes, the file {len(data)}")
    if not is_binary_stl(data):
        holds = (len(data) - HEADER_BYTES) / FACET.itemsize
        raise CorruptError(f"the header says {_announced(data)} faces, the file holds {holds:g}")
    corners = np.frombuffer(data, FACET, -1, HEADER_BYTES)["corners"].reshape(-1, 3)
    return _soup(corners.astype(np.float64), single_precision=True)


def is_text_stl(data: bytes) -> bool:
    """Whether `data` begins like a text STL."""
    start = data[:4096].lstrip(b"\xef\xbb\xbf \t\r\n").lower()
    return start.startswith(b"solid") and (b"facet" in start or b"endsolid" in start) and b"\0" not in start


def _announced(data: bytes) -> int:
    return int.from_bytes(data[80:84], "little")


def _soup(positions: np.ndarray, *, single_precision: bool) -> Polygons:
    return Polygons(
        positions=positions,
        corners=np.arange(len(positions)),
        sizes=np.full(len(positions) // 3, 3, np.int64),
        face_group=np.zeros(len(positions) // 3, np.int32),
        single_precision=single_precision,
        shared=False,
    )


def _read_text(data: bytes) -> Polygons:
    lines = Lines(normalise(data), keyed=True)
    solid, endsolid = pack("solid"), pack("endsolid")
    filled = np.flatnonzero(lines.keyword != 0)
    facet_lines = filled[(lines.keyword[filled] != solid) & (lines.keyword[filled] != endsolid)]
    begins = np.flatnonzero(lines.keyword == solid)
    ends = np.flatnonzero(lines.keyword == endsolid)
    expected = np.resize(np.array([pack(word) for word in _FACET_LINES], np.uint64), len(facet_lines))
    wrong = np.flatnonzero(lines.keyword[facet_lines] != expected)
    if len(wrong):
        word = _FACET_LINES[wrong[0] % len(_FACET_LINES)]
        raise CorruptError(f"line {lines.number[facet_lines[wrong[0]]]}: expected {word!r}")
    if len(facet_lines) % len(_FACET_LINES) or len(begins) != len(ends) or (begins > ends).any():
        whole = len(facet_lines) // len(_FACET_LINES)
        raise CorruptError(f"the file ends within a solid, after {whole} whole faces")
    vertex = facet_lines.reshape(-1, len(_FACET_LINES))[:, 2:5].ravel()
    short = np.flatnonzero(lines.fields[vertex] != 3)
    if len(short):
        raise CorruptError(f"line {lines.number[vertex[short[0]]]}: a vertex has 3 coordinates")
    polygons = _soup(lines.numbers(vertex).reshape(-1, 3), single_precision=False)
    names = decode_names([lines.text(line) for line in begins.tolist()])
    names = ["default", *(name or "default" for name in names)]
    polygons.face_group, polygons.groups = number_groups(np.searchsorted(begins, vertex[::3]), names)
    return polygons
