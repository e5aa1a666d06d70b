"""OFF (Object File Format), text: plain, with normals, colours or texture coordinates.

Source: Geomview manual, section OFF files.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.errors import CorruptError, UnsupportedError
from weathercoat.mesh.formats.polygons import Polygons
from weathercoat.mesh.formats.text import Lines, normalise

HEADER = re.compile(rb"\s*(?:#[^\n]*\n\s*)*(ST)?(C)?(N)?(4)?(n)?OFF(\s+BINARY)?(?=[\s\d]|$)")


def read_off(data: bytes) -> Polygons:
    """The polygons of an OFF file.

    Errors: UnsupportedError for binary and higher-dimensional files; CorruptError with counts, line or index.
    """
    data = normalise(data)
    header = HEADER.match(data)
    if header is None:
        raise CorruptError("the file does not begin with OFF")
    texture, color, normal, four, many, binary = (bool(part) for part in header.groups())
    if binary:
        raise UnsupportedError("binary OFF is not supported")
    if four or many:
        raise UnsupportedError("OFF in four or more dimensions is not supported")
    # Blanks instead of the header keep the numbers of the lines.
    body = re.sub(rb"[^\n]", b" ", data[: header.end()]) + data[header.end() :]
    lines = Lines(body, keyed=False)
    filled = np.flatnonzero(lines.fields > 0)
    if not len(filled) or not 2 <= lines.fields[filled[0]] <= 3:
        raise CorruptError("the line with the counts of vertices, faces and edges is missing")
    counts = lines.text(filled[0]).split()
    if not all(word.isdigit() and len(word) < 100 for word in counts):
        raise CorruptError(f"line {lines.number[filled[0]]}: counts are whole numbers from 0 on")
    vertex_count, face_count = int(counts[0]), int(counts[1])
    rows = filled[1:]
    if vertex_count + face_count != len(rows):
        raise CorruptError(
            f"the header says {vertex_count} vertices and {face_count} faces, the file {len(rows)} lines"
        )
    before = 3 + 3 * normal
    after = 2 * texture
    positions, colors, texture_coordinates = _vertices(lines, rows[:vertex_count], before, after, color)
    corners, sizes = _faces(lines, rows[vertex_count:])
    polygons = Polygons(
        positions=positions,
        corners=corners,
        sizes=sizes,
        face_group=np.zeros(face_count, np.int32),
        colors=colors,
    )
    polygons.drop_illegal()
    if texture_coordinates is not None:
        polygons.uv = texture_coordinates[polygons.corners]
    polygons.tidy_attributes()
    return polygons


def _vertices(
    lines: Lines, rows: NDArray[np.int64], before: int, after: int, color: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Positions, colours, texture coordinates: `before` numbers, a colour, `after` numbers a line."""
    fields = lines.fields[rows]
    allowed = [before + after + n for n in ((3, 4) if color else (0, 3, 4))]
    width = next((n for n in fields[:1].tolist() if n in allowed), allowed[0])
    wrong = np.flatnonzero(fields != width)
    if len(wrong):
        row = rows[wrong[0]]
        raise CorruptError(
            f"line {lines.number[row]}: a vertex has {width} numbers, this one {lines.fields[row]}"
        )
    values = lines.numbers(rows).reshape(len(rows), width)
    colors = None
    if width > before + after:
        part = values[:, before : width - after]
        colors = np.ones((len(rows), 4))
        finite = part[np.isfinite(part)]
        colors[:, : part.shape[1]] = part / 255.0 if finite.max(initial=0.0) > 1.0 else part
    return values[:, :3].copy(), colors, values[:, width - after :] if after else None


def _faces(lines: Lines, rows: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Corners and sizes; after the indices of a face stand 0, 1, 3 or 4 numbers of its colour."""
    sizes = np.zeros(len(rows), np.int64)
    corners = np.zeros(int(lines.fields[rows].sum()), np.int64)
    after = np.zeros(len(rows), np.int64)
    used, bad = _parse_counted(lines.buffer, lines.begin[rows], lines.end[rows], sizes, corners, after)
    odd = np.flatnonzero(~np.isin(lines.fields[rows] - 1 - sizes, (0, 1, 3, 4))) if bad < 0 else [bad]
    if len(odd):
        row = rows[odd[0]]
        shown = lines.text(row)[:60].decode("utf-8", "replace")
        raise CorruptError(f"line {lines.number[row]}: {shown!r} is no face of OFF")
    lines.check_numbers(rows, after)
    return corners[:used], sizes


@kernel
def _parse_counted(buffer, begin, end, sizes, corners, after):  # type: ignore[no-untyped-def]
    """Lines "count index index ...", then perhaps a colour, which begins at `after`. Corners found, and the
    first bad line or -1."""
    used = 0
    for line in range(len(begin)):
        i = begin[line]
        wanted = 1
        found = 0
        while found < wanted:
            while i < end[line] and (buffer[i] == 32 or 9 <= buffer[i] <= 13):
                i += 1
            negative = i < end[line] and buffer[i] == 45
            if negative:
                i += 1
            digits = 0
            value = 0
            while i < end[line] and 48 <= buffer[i] <= 57:
                if digits < 18:
                    value = 10 * value + (buffer[i] - 48)
                digits += 1
                i += 1
            blank = i >= end[line] or buffer[i] == 32 or 9 <= buffer[i] <= 13
            if digits == 0 or digits > 17 or not blank:
                return used, line
            if found == 0:
                if negative or value > end[line] - begin[line]:
                    return used, line
                sizes[line] = value
                wanted = 1 + value
            else:
                corners[used] = -value if negative else value
                used += 1
            found += 1
        after[line] = i
    return used, -1
