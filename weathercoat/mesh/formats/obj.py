"""Wavefront OBJ: polygons with texture coordinates, groups, materials and vertex colours.

Source: Wavefront, Object Files (.obj), appendix B1 of the Advanced Visualizer manual; vertex colours after
the position are the common extension of MeshLab and others. Free-form curves and surfaces are passed over.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.errors import CorruptError, Note
from weathercoat.mesh.formats.polygons import Polygons
from weathercoat.mesh.formats.text import Lines, decode_names, join_continued, normalise, pack

PASSED_OVER = (
    "l", "p", "s", "vp", "mtllib", "usemap", "maplib", "mg", "cstype", "deg", "bmat", "step", "curv", "curv2",
    "surf", "parm", "trim", "hole", "scrv", "sp", "end", "con", "bevel", "c_interp", "d_interp", "lod",
    "ctech", "stech", "call", "csh", "bsp", "bzp", "cdc", "cdp", "res", "vw",
)  # fmt: skip
# Longer than the eight characters that tell keywords apart.
_LONG = {b"shadow_obj", b"trace_obj"}
KEYWORDS = ("v", "vt", "vn", "f", "fo", "g", "o", "usemtl", *PASSED_OVER)


def read_obj(data: bytes, folder: Path | None) -> Polygons:
    """The polygons of an OBJ file. A missing material library beside it (in `folder`) is noted.

    Errors: CorruptError, with the line or the face and index.
    """
    lines = Lines(join_continued(normalise(data)), keyed=True)
    _refuse_unknown(lines)
    v, vt, vn = (np.flatnonzero(lines.keyword == pack(word)) for word in ("v", "vt", "vn"))
    f = np.flatnonzero((lines.keyword == pack("f")) | (lines.keyword == pack("fo")))
    positions, colors = _vertices(lines, v)
    corners, texture, sizes = _faces(lines, f, v, vt, vn)
    face_group, groups = _groups(lines, f)
    polygons = Polygons(
        positions=positions,
        corners=corners,
        sizes=sizes,
        uv=_corner_uv(lines, vt, texture),
        face_group=face_group,
        groups=groups,
        colors=colors,
    )
    polygons.drop_illegal()
    polygons.notes.extend(_missing_materials(lines, folder))
    return polygons


def _refuse_unknown(lines: Lines) -> None:
    known = np.array([0, *(pack(word) for word in KEYWORDS)], np.uint64)
    for line in np.flatnonzero(~np.isin(lines.keyword, known)):
        text = lines.data[: lines.begin[line]].rsplit(b"\n", 1)[-1].strip()
        if text.lower() not in _LONG:
            word = text[:40].decode("utf-8", "replace")
            raise CorruptError(f"line {lines.number[line]}: {word!r} is no keyword of OBJ")


def _vertices(lines: Lines, v: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Positions and colours; a line holds x y z [w] [r g b]."""
    fields = lines.fields[v]
    wrong = np.flatnonzero(~np.isin(fields, (3, 4, 6, 7)))
    if len(wrong):
        line = v[wrong[0]]
        raise CorruptError(
            f"line {lines.number[line]}: a vertex has 3 coordinates, this one {lines.fields[line]}"
        )
    values = lines.numbers(v)
    first = np.cumsum(fields) - fields
    positions = values[first[:, None] + np.arange(3)]
    if not (fields >= 6).any():
        return positions, None
    colors = np.ones((len(v), 4))
    colored = np.flatnonzero(fields >= 6)
    colors[colored, :3] = values[(first + fields)[colored, None] - np.arange(3, 0, -1)]
    return positions, np.clip(colors, 0.0, 1.0)


def _faces(
    lines: Lines, f: NDArray[np.int64], v: NDArray[np.int64], vt: NDArray[np.int64], vn: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Vertex and texture index of each corner, from 0, -1 for the illegal index 0; corners of each face."""
    sizes = lines.fields[f]
    indices = np.empty((int(sizes.sum()), 3), np.int64)
    before = np.stack([np.searchsorted(kind, f) for kind in (v, vt, vn)], axis=1).astype(np.int64)
    bad = _parse_corners(lines.buffer, lines.begin[f], lines.end[f], before, indices)
    if bad >= 0:
        raise CorruptError(f"line {lines.number[f[bad]]}: {lines.text(f[bad])[:60]!r} is no list of indices")
    # Indices of normals are not checked: files whose normals were stripped keep them, and they are not used.
    for column, (kind, name) in enumerate(((v, "vertices"), (vt, "texture coordinates"))):
        outside = np.flatnonzero((indices[:, column] >= len(kind)) | (indices[:, column] == BEFORE_FIRST))
        if len(outside):
            face = int(np.searchsorted(np.cumsum(sizes), outside[0], side="right"))
            index = indices[outside[0], column]
            which = f"index {index + 1}" if index >= 0 else "a relative index before the first one"
            raise CorruptError(
                f"face {face} (counted from 0), line {lines.number[f[face]]}: {which}, "
                f"but there are {len(kind)} {name}"
            )
    vertex = np.where(indices[:, 0] < 0, -1, indices[:, 0])
    return vertex, indices[:, 1], sizes


def _corner_uv(lines: Lines, vt: NDArray[np.int64], texture: NDArray[np.int64]) -> NDArray[np.float64] | None:
    if not len(vt) or not (texture >= 0).any():
        return None
    fields = lines.fields[vt]
    wrong = np.flatnonzero((fields < 1) | (fields > 3))
    if len(wrong):
        raise CorruptError(f"line {lines.number[vt[wrong[0]]]}: a texture coordinate has 1 to 3 numbers")
    values = lines.numbers(vt)
    first = np.cumsum(fields) - fields
    coordinates = np.zeros((len(vt), 2))
    coordinates[:, 0] = values[first]
    two = fields >= 2
    coordinates[two, 1] = values[first[two] + 1]
    uv = np.zeros((len(texture), 2))
    has = texture >= 0
    uv[has] = coordinates[texture[has]]
    return np.nan_to_num(uv, posinf=0.0, neginf=0.0)


def _groups(lines: Lines, f: NDArray[np.int64]) -> tuple[NDArray[np.int32], tuple[str, ...]]:
    """A group per face: its material where the file names any, else its group, else its object."""
    for keyword in ("usemtl", "g", "o"):
        switches = np.flatnonzero(lines.keyword == pack(keyword))
        names = decode_names([b" ".join(lines.text(line).split()) for line in switches.tolist()])
        if any(names):
            break
    else:
        return np.zeros(len(f), np.int32), ("default",)
    names = ["default", *(name or "default" for name in names)]
    return number_groups(np.searchsorted(switches, f), names)


def number_groups(switch: NDArray[np.int64], names: list[str]) -> tuple[NDArray[np.int32], tuple[str, ...]]:
    """Groups in the order of their first face: `switch` (m,) is an index into `names`, which may repeat."""
    used, first = np.unique(switch, return_index=True)
    groups = list(dict.fromkeys(names[s] for s in used[np.argsort(first, kind="stable")]))
    number = np.zeros(len(names), np.int32)
    for s in used:
        number[s] = groups.index(names[s])
    return number[switch], tuple(groups) or ("default",)


def _missing_materials(lines: Lines, folder: Path | None) -> list[Note]:
    if folder is None:
        return []
    missing = []
    for line in np.flatnonzero(lines.keyword == pack("mtllib")).tolist():
        (name,) = decode_names([lines.text(line).strip()])
        path = Path(name.replace("\\", "/").removeprefix("./"))
        outside = path.is_absolute() or ".." in path.parts or ":" in name
        if outside or not _is_file(folder / path):
            missing.append(name)
    if not missing:
        return []
    return [Note("W-MATERIAL", len(missing), f"material library {missing[0]!r} is not beside the model")]


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


ABSENT = -2
BEFORE_FIRST = -3


@kernel
def _parse_corners(buffer, begin, end, before, indices):  # type: ignore[no-untyped-def]
    """Indices v/vt/vn of each corner, from 0, into `indices` (k, 3); the first line that is no list, or -1.

    Relative (negative) indices count back from the elements `before` the line. -1 stands for the illegal
    index 0, ABSENT for none, BEFORE_FIRST for a relative index that is too large.
    """
    corner = 0
    for line in range(len(begin)):
        i = begin[line]
        while i < end[line]:
            if buffer[i] == 32 or 9 <= buffer[i] <= 13:
                i += 1
                continue
            indices[corner, 0] = -2
            indices[corner, 1] = -2
            indices[corner, 2] = -2
            column = 0
            while True:
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
                if digits > 17 or (digits == 0 and (negative or column == 0)):
                    return line
                if digits > 0:
                    if value == 0:
                        indices[corner, column] = -1
                    elif not negative:
                        indices[corner, column] = value - 1
                    elif value <= before[line, column]:
                        indices[corner, column] = before[line, column] - value
                    else:
                        indices[corner, column] = -3
                if i < end[line] and buffer[i] == 47:
                    column += 1
                    i += 1
                    if column > 2:
                        return line
                    continue
                break
            if i < end[line] and not (buffer[i] == 32 or 9 <= buffer[i] <= 13):
                return line
            corner += 1
    return -1
