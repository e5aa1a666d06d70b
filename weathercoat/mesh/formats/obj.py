"""Wavefront OBJ: polygons with texture coordinates, groups, materials and vertex colours.

Source: Wavefront, Object Files (.obj), appendix B1 of the Advanced Visualizer manual; vertex colours after
the position are the common extension of MeshLab and others. Free-form curves and surfaces are passed over;
what calls another file or a command is refused.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.errors import CorruptError, Note, SecurityError, UnsupportedError
from weathercoat.mesh.formats.mtl import read_library
from weathercoat.mesh.formats.polygons import Polygons
from weathercoat.mesh.formats.text import Lines, decode_names, join_continued, normalise, pack
from weathercoat.mesh.materials import SourceMaterial
from weathercoat.mesh.surface import Part

PASSED_OVER = (
    "mtllib", "usemap", "maplib", "mg", "cstype", "deg", "bmat", "step", "curv", "curv2", "surf", "parm",
    "trim", "hole", "scrv", "sp", "end", "con", "bevel", "c_interp", "d_interp", "lod", "ctech", "stech",
    "bsp", "bzp", "cdc", "cdp", "res", "vw",
)  # fmt: skip
# Longer than the eight characters that tell keywords apart.
_LONG = {b"shadow_obj", b"trace_obj"}
KEYWORDS = ("v", "vt", "vn", "vp", "f", "fo", "l", "p", "s", "g", "o", "usemtl", "call", "csh", *PASSED_OVER)


def read_obj(data: bytes, folder: Path | None) -> Polygons:
    """The polygons of an OBJ file. A missing material library beside it (in `folder`) is noted.

    Errors: CorruptError, with the line or the face and index; UnsupportedError, SecurityError.
    """
    lines = Lines(join_continued(normalise(data)), keyed=True)
    _refuse_unknown(lines)
    v, vt, vn = (_lines_of(lines, word) for word in ("v", "vt", "vn"))
    f = _lines_of(lines, "f", "fo")
    positions, colors = _vertices(lines, v)
    _check_passed_over(lines, v, vt, vn)
    indices, sizes, notes = _faces(lines, f, v, vt, vn)
    face_group, groups = _groups(lines, f)
    materials, missing = _materials(lines, folder)
    for name in _switches(lines, "usemtl")[1]:  # one that no library has keeps its name
        materials.setdefault(name, SourceMaterial(name))
    face_part, parts = _parts(lines, f, list(materials))
    polygons = Polygons(
        positions=positions,
        corners=np.where(indices[:, 0] < 0, -1, indices[:, 0]),
        sizes=sizes,
        uv=_corner_uv(lines, vt, indices[:, 1]),
        normals=_corner_normals(lines, vn, indices[:, 2]),
        face_part=face_part,
        parts=parts,
        materials=tuple(materials.values()),
        face_group=face_group,
        groups=groups,
        colors=colors,
        notes=notes,
    )
    polygons.drop_illegal()
    polygons.tidy_attributes()
    polygons.notes.extend(missing)
    return polygons


def _lines_of(lines: Lines, *keywords: str) -> NDArray[np.int64]:
    return np.flatnonzero(np.isin(lines.keyword, np.array([pack(word) for word in keywords], np.uint64)))


def _refuse_unknown(lines: Lines) -> None:
    known = np.array([0, *(pack(word) for word in KEYWORDS)], np.uint64)
    for line in np.flatnonzero(~np.isin(lines.keyword, known)):
        text = lines.data[: lines.begin[line]].rsplit(b"\n", 1)[-1].strip()
        if text.lower() not in _LONG:
            word = text[:40].decode("utf-8", "replace")
            raise CorruptError(f"line {lines.number[line]}: {word!r} is no keyword of OBJ")
    for line in _lines_of(lines, "call")[:1]:
        raise UnsupportedError(f"line {lines.number[line]} includes another file")
    for line in _lines_of(lines, "csh")[:1]:
        raise SecurityError(
            f"line {lines.number[line]} asks to run a command", remedy="export the model without it"
        )


def _check_passed_over(
    lines: Lines, v: NDArray[np.int64], vt: NDArray[np.int64], vn: NDArray[np.int64]
) -> None:
    """Refuse what is no normal, point in parameters, line, point or smoothing group, though none is used: a
    damaged line may have been a vertex or a face."""
    for kind, fewest, most, name in (
        (vt, 1, 3, "a texture coordinate has 1 to 3"),
        (vn, 3, 3, "a normal has 3"),
        (_lines_of(lines, "vp"), 1, 3, "a point in parameters has 1 to 3"),
    ):
        wrong = np.flatnonzero((lines.fields[kind] < fewest) | (lines.fields[kind] > most))
        if len(wrong):
            line = kind[wrong[0]]
            raise CorruptError(f"line {lines.number[line]}: {name} numbers, this one {lines.fields[line]}")
        lines.check_numbers(kind, lines.begin[kind])
    others = _lines_of(lines, "l", "p")
    illegal = np.flatnonzero(_indices(lines, others, v, vt, vn)[:, 0] == -1)
    if len(illegal):
        line = others[np.searchsorted(np.cumsum(lines.fields[others]), illegal[0], side="right")]
        raise CorruptError(f"line {lines.number[line]}: index 0, but indices begin at 1")
    for line in _lines_of(lines, "s").tolist():
        if not re.fullmatch(rb"\d+|off|on", lines.text(line)):
            raise CorruptError(
                f"line {lines.number[line]}: a smoothing group is a number or off, not "
                f"{lines.text(line)[:40].decode('utf-8', 'replace')!r}"
            )


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
    return positions, colors


def _faces(
    lines: Lines, f: NDArray[np.int64], v: NDArray[np.int64], vt: NDArray[np.int64], vn: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], list[Note]]:
    """Indices of vertex, texture coordinate and normal of each corner, from 0, negative where there is none
    or an illegal one; corners of each face.
    """
    indices = _indices(lines, f, v, vt, vn)
    lost = indices[:, 1] == -1
    # A file whose normals were stripped keeps the indices of all of them.
    if len(vn):
        lost |= (indices[:, 2] == -1) | (indices[:, 2] == BEFORE_FIRST) | (indices[:, 2] >= len(vn))
    notes = []
    if lost.any():
        text = "corners name a texture coordinate or a normal that does not exist"
        notes.append(Note("W-BADINDEX", int(lost.sum()), text))
    return indices, lines.fields[f], notes


def _indices(
    lines: Lines, f: NDArray[np.int64], v: NDArray[np.int64], vt: NDArray[np.int64], vn: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Indices (k, 3) of vertex, texture coordinate and normal of all corners on the lines `f`, from 0; -1,
    ABSENT or BEFORE_FIRST for others. Refuses vertices and texture coordinates beyond the last."""
    sizes = lines.fields[f]
    indices = np.empty((int(sizes.sum()), 3), np.int64)
    before = np.stack([np.searchsorted(kind, f) for kind in (v, vt, vn)], axis=1).astype(np.int64)
    bad = _parse_corners(lines.buffer, lines.begin[f], lines.end[f], before, indices)
    if bad >= 0:
        shown = lines.text(f[bad])[:60].decode("utf-8", "replace")
        raise CorruptError(f"line {lines.number[f[bad]]}: {shown!r} is no list of indices of one form")
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
    return indices


def _corner_uv(lines: Lines, vt: NDArray[np.int64], texture: NDArray[np.int64]) -> NDArray[np.float64] | None:
    if not len(vt) or not (texture >= 0).any():
        return None
    fields = lines.fields[vt]
    values = lines.numbers(vt)
    first = np.cumsum(fields) - fields
    coordinates = np.zeros((len(vt), 2))
    coordinates[:, 0] = values[first]
    two = fields >= 2
    coordinates[two, 1] = values[first[two] + 1]
    uv = np.zeros((len(texture), 2))
    has = texture >= 0
    uv[has] = coordinates[texture[has]]
    return uv


def _corner_normals(
    lines: Lines, vn: NDArray[np.int64], normal: NDArray[np.int64]
) -> NDArray[np.float64] | None:
    has = (normal >= 0) & (normal < len(vn))
    if not has.any():
        return None
    normals = np.zeros((len(normal), 3))
    normals[has] = lines.numbers(vn).reshape(-1, 3)[normal[has]]
    return normals


def _parts(
    lines: Lines, f: NDArray[np.int64], materials: list[str]
) -> tuple[NDArray[np.int32] | None, tuple[Part, ...]]:
    """A part per face, of its object (or group, where the file names no objects) and its material."""
    named = {word: _switches(lines, word) for word in ("o", "g", "usemtl")}
    switches, names = named["o"] if any(named["o"][1]) else named["g"]
    shown, shown_names = named["usemtl"]
    if not any(names) and not any(shown_names):
        return None, ()
    numbers = {name: number for number, name in enumerate(materials)}
    pairs = np.stack([np.searchsorted(switches, f), np.searchsorted(shown, f)], axis=1)
    used, first, face_part = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    names, shown_names = ["", *names], ["", *shown_names]
    parts = [
        Part(names[i] or shown_names[j] or "default", numbers.get(shown_names[j], -1))
        for i, j in used[order].tolist()
    ]
    number: dict[Part, int] = {}
    place = np.array([number.setdefault(part, len(number)) for part in parts], np.int32)
    return place[rank[face_part.reshape(-1)]], tuple(number)


def _switches(lines: Lines, keyword: str) -> tuple[NDArray[np.int64], list[str]]:
    """The lines of a keyword, and the name on each."""
    switches = np.flatnonzero(lines.keyword == pack(keyword))
    return switches, decode_names([b" ".join(lines.text(line).split()) for line in switches.tolist()])


def _groups(lines: Lines, f: NDArray[np.int64]) -> tuple[NDArray[np.int32], tuple[str, ...]]:
    """A group per face: its material where the file names any, else its group, else its object."""
    for keyword in ("usemtl", "g", "o"):
        switches, names = _switches(lines, keyword)
        if any(names):
            break
    else:
        return np.zeros(len(f), np.int32), ("default",)
    names = ["default", *(name or "default" for name in names)]
    return number_groups(np.searchsorted(switches, f), names)


def number_groups(switch: NDArray[np.int64], names: list[str]) -> tuple[NDArray[np.int32], tuple[str, ...]]:
    """Groups in the order of their first face: `switch` (m,) is an index into `names`, which may repeat."""
    used, first = np.unique(switch, return_index=True)
    place: dict[str, int] = {}
    number = np.zeros(len(names), np.int32)
    for s in used[np.argsort(first, kind="stable")].tolist():
        number[s] = place.setdefault(names[s], len(place))
    return number[switch], tuple(place) or ("default",)


def _materials(lines: Lines, folder: Path | None) -> tuple[dict[str, SourceMaterial], list[Note]]:
    """The materials of the libraries beside the model, by name, and notes on what is not there."""
    materials: dict[str, SourceMaterial] = {}
    libraries, pictures = [], []
    for line in np.flatnonzero(lines.keyword == pack("mtllib")).tolist() if folder is not None else ():
        (name,) = decode_names([lines.text(line).strip()])
        path = library_path(name)
        try:
            if path is None:
                raise OSError("leads out of the model's folder")
            assert folder is not None
            found, missing = read_library(folder / path, folder)
        except (OSError, ValueError):
            libraries.append(name)
            continue
        materials |= found
        pictures += missing
    notes = []
    if libraries:
        what = f"material library {libraries[0]!r} is not beside the model"
        notes.append(Note("W-MATERIAL", len(libraries), what))
    if pictures:
        what = f"pictures are not beside the model: {pictures[0]!r}"
        notes.append(Note("W-MATERIAL", len(pictures), what))
    return materials, notes


def library_path(name: str) -> Path | None:
    """The path of a material library from the model's folder; None where it leads out of that."""
    path = Path(name.replace("\\", "/").removeprefix("./"))
    outside = path.is_absolute() or ".." in path.parts or ":" in name or "\0" in name
    return None if outside else path


ABSENT = -2
BEFORE_FIRST = -3


@kernel
def _parse_corners(buffer, begin, end, before, indices):  # type: ignore[no-untyped-def]
    """Indices v/vt/vn of each corner, from 0, into `indices` (k, 3); the first line that is no list of
    corners of one form, or -1.

    Relative (negative) indices count back from the elements `before` the line. -1 stands for the illegal
    index 0, ABSENT for none, BEFORE_FIRST for a relative index that is too large.
    """
    corner = 0
    for line in range(len(begin)):
        i = begin[line]
        form_of_line = -1
        while i < end[line]:
            if buffer[i] == 32 or 9 <= buffer[i] <= 13:
                i += 1
                continue
            form = 0
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
                    form |= 4 << column
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
            form |= column
            if form_of_line >= 0 and form != form_of_line:
                return line
            form_of_line = form
            corner += 1
    return -1
