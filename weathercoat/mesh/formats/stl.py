"""STL, binary and text.

Source: 3D Systems, StereoLithography Interface Specification, 1989. Binary files may begin with "solid" as
well: their size tells.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import CorruptError
from weathercoat.mesh.formats.obj import number_groups
from weathercoat.mesh.formats.polygons import Polygons
from weathercoat.mesh.formats.text import Lines, decode_names, is_number, normalise, pack

HEADER_BYTES = 84
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_FACET_LINES = ("facet", "outer", "vertex", "vertex", "vertex", "endloop", "endfacet")
# Words that follow on each of these lines.
_WORDS = (4, 1, 3, 3, 3, 0, 0)
# Normals of faces without area are written in many ways that are no numbers; they are not used.
_NO_NUMBER = re.compile(rb"nan|inf|ind|#", re.IGNORECASE)


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
    lines = Lines(normalise(data), keyed=True, any_case=True, comments=False)
    filled = np.flatnonzero(lines.keyword != 0)
    frame = np.flatnonzero(np.isin(lines.keyword, np.array([pack("solid"), pack("endsolid")], np.uint64)))
    facet_lines = np.setdiff1d(filled, frame, assume_unique=True)
    expected = np.resize(np.array([pack(word) for word in _FACET_LINES], np.uint64), len(facet_lines))
    wrong = np.flatnonzero(lines.keyword[facet_lines] != expected)
    if len(wrong):
        word = _FACET_LINES[wrong[0] % len(_FACET_LINES)]
        raise CorruptError(f"line {lines.number[facet_lines[wrong[0]]]}: expected {word!r}")
    whole = len(facet_lines) // len(_FACET_LINES)
    begins = _solids(lines, frame, facet_lines, whole)
    facet = facet_lines.reshape(-1, len(_FACET_LINES))
    _check_words(lines, facet)
    vertex = facet[:, 2:5].ravel()
    polygons = _soup(lines.numbers(vertex).reshape(-1, 3), single_precision=False)
    names = decode_names([lines.text(line) for line in begins.tolist()])
    names = ["default", *(name or "default" for name in names)]
    polygons.face_group, polygons.groups = number_groups(np.searchsorted(begins, vertex[::3]), names)
    return polygons


def _solids(
    lines: Lines, frame: NDArray[np.int64], facet_lines: NDArray[np.int64], whole: int
) -> NDArray[np.int64]:
    """The lines that begin a solid; refuses facets outside, solids that do not end, and frames in a facet."""
    place = np.searchsorted(facet_lines, frame)
    order = np.resize(np.array([pack("solid"), pack("endsolid")], np.uint64), len(frame))
    good = (lines.keyword[frame] == order) & (place % len(_FACET_LINES) == 0)
    good[::2] &= place[::2] == np.concatenate([[0], place[1:-1:2]])[: len(place[::2])]
    if not good.all():
        raise CorruptError(
            f"line {lines.number[frame[np.argmin(good)]]}: a solid begins or ends here wrongly"
        )
    if len(frame) % 2 or len(facet_lines) % len(_FACET_LINES) or place[-1] < len(facet_lines):
        raise CorruptError(f"the file ends within a solid, after {whole} whole faces")
    return frame[::2]


def _check_words(lines: Lines, facet: NDArray[np.int64]) -> None:
    """Refuse lines of facets (m, 7) with words too many, too few or not in their place."""
    for column, count in enumerate(_WORDS):
        rows = facet[:, column]
        wrong = lines.fields[rows] != count
        if column == 0 and not wrong.any():
            wrong = ~lines.begins_with(rows, b"normal ")
        if column == 1 and not wrong.any():
            wrong = ~lines.begins_with(rows, b"loop") | (lines.end[rows] - lines.begin[rows] != len("loop"))
        for row in rows[wrong]:
            _refuse_line(lines, row, _FACET_LINES[column])
    rows = facet[:, 0]
    for row in rows[~lines.are_numbers(rows, lines.begin[rows] + len("normal"))]:
        if not all(_NO_NUMBER.search(word) or is_number(word) for word in lines.text(row).split()[1:]):
            _refuse_line(lines, row, "facet")


def _refuse_line(lines: Lines, row: int, keyword: str) -> None:
    shown = lines.text(row)[:60].decode("utf-8", "replace")
    raise CorruptError(f"line {lines.number[row]}: {shown!r} cannot follow {keyword!r}")
