"""PLY (polygon file format), text and binary of either byte order.

Source: Turk, The PLY polygon file format, 1994. A text body is taken as rows of float64, so that one walk
serves both.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.errors import CorruptError
from weathercoat.mesh.formats.polygons import Polygons
from weathercoat.mesh.formats.text import Lines, normalise

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
ByteOrder = Literal["=", "<", ">"]
_ORDERS: dict[str, ByteOrder] = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
_INDEX_NAMES = ("vertex_indices", "vertex_index")
_UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
_MAX_HEADER = 1 << 20


@dataclass
class Property:
    """A column of an element: a number, or a list with a count (`count_type`) before its items."""

    name: str
    type: str
    count_type: str | None = None


@dataclass
class Element:
    name: str
    count: int
    properties: list[Property]


@dataclass
class Column:
    """The values of a property, row after row; `sizes` tells how many belong to each row."""

    values: NDArray[np.generic]
    sizes: NDArray[np.int64]
    type: str
    is_list: bool


def read_ply(data: bytes) -> Polygons:
    """The polygons of a PLY file: elements `vertex` with `face` or `tristrips`.

    Errors: CorruptError with counts, line or index.
    """
    order, elements, body, line = _header(data)
    if order == "=":
        table = _read_ascii(data[body:], elements, line)
    else:
        table = _read_binary(data[body:], elements, order)
    vertex = table.get("vertex", {})
    for axis in "xyz":
        if axis not in vertex or vertex[axis].is_list:
            raise CorruptError(f"the header names no element vertex with a number {axis}")
    positions = np.stack([vertex[axis].values.astype(np.float64) for axis in "xyz"], axis=1)
    corners, sizes = _corners(table)
    polygons = Polygons(
        positions=positions,
        corners=corners,
        sizes=sizes,
        uv=_corner_uv(table, corners, sizes),
        normals=_corner_normals(table["vertex"], corners),
        face_group=np.zeros(len(sizes), np.int32),
        colors=_colors(vertex),
        single_precision=order != "=" and vertex["x"].type == "f4",
    )
    polygons.drop_illegal()
    polygons.tidy_attributes()
    return polygons


def _header(data: bytes) -> tuple[ByteOrder, list[Element], int, int]:
    """Byte order, elements, where the body begins, and in which line, counted from 1."""
    # A carriage return alone ends the lines of old files; one before a line feed is a blank.
    end = b"\r" if data[3:4] == b"\r" and data[4:5] != b"\n" else b"\n"
    order: ByteOrder | None = None
    elements: list[Element] = []
    at = 0
    for number in range(1, _MAX_HEADER):
        stop = data.find(end, at, _MAX_HEADER)
        if stop < 0:
            break
        line = data[at:stop].decode("latin-1")
        at = stop + 1
        words = line.split()
        if words == ["end_header"]:
            if order is None:
                raise CorruptError("the header names no format")
            _check_names(elements)
            return order, elements, at, number + 1
        if (words == ["ply"] and number == 1) or not words or words[0] in ("comment", "obj_info"):
            continue
        try:
            if words[0] == "format" and words[2:] == ["1.0"] and order is None and not elements:
                order = _ORDERS[words[1]]
            else:
                _declare(words, elements)
        except (KeyError, IndexError, ValueError):
            raise CorruptError(f"line {number} of the header: {line[:60]!r}") from None
    raise CorruptError("the header has no end")


def _check_names(elements: list[Element]) -> None:
    """Refuse a name that is given twice, and rows without properties."""
    names = {"the file": [e.name for e in elements]}
    names |= {f"element {e.name}": [p.name for p in e.properties] for e in elements}
    for owner, given in names.items():
        if len(set(given)) < len(given):
            twice = next(name for i, name in enumerate(given) if name in given[:i])
            raise CorruptError(f"the header of {owner} names {twice[:40]!r} twice")
    for element in elements:
        if element.count and not element.properties:
            raise CorruptError(f"the header names no property of element {element.name}")


def _declare(words: list[str], elements: list[Element]) -> None:
    """Add what a line of the header declares; KeyError, IndexError or ValueError where it is none."""
    if words[0] == "element":
        _, name, count = words
        if not re.fullmatch(r"[0-9]{1,99}", count):
            raise ValueError
        elements.append(Element(name, int(count), []))
        return
    if words[:2] == ["property", "list"]:
        _, _, count_type, type, name = words
        new = Property(name, _TYPES[type], _TYPES[count_type])
        if _TYPES[count_type][0] == "f":
            raise ValueError
    else:
        keyword, type, name = words
        new = Property(name, _TYPES[type])
        if keyword != "property":
            raise ValueError
    elements[-1].properties.append(new)


def _read_ascii(body: bytes, elements: list[Element], first_line: int) -> dict[str, dict[str, Column]]:
    """The values of a text body: a line for each row of each element."""
    text = normalise(body)
    for element in elements:
        _check_room(element, 2 * max(len(element.properties), 1), len(text) + 1)
    lines = Lines(text, keyed=False, comments=False)
    lines.number += first_line - 1
    filled = np.flatnonzero(lines.fields)
    values = lines.numbers(filled)
    rows = [
        Element(e.name, e.count, [Property(p.name, "f8", p.count_type and "f8") for p in e.properties])
        for e in elements
    ]
    table = _read_binary(values.tobytes(), rows, "=")
    for element in elements:
        words = np.zeros(element.count, np.int64)
        for declared in element.properties:
            column = table[element.name][declared.name]
            column.type = declared.type
            words += column.sizes + column.is_list
            if declared.type[0] in "iu":
                column.values = _whole_numbers(column.values.astype(np.float64), element, declared)
        if len(filled) < element.count:
            raise CorruptError(
                f"the header says {element.count} rows of element {element.name}, "
                f"the file holds {len(filled)} lines of them"
            )
        wrong = np.flatnonzero(lines.fields[filled[: element.count]] != words)
        if len(wrong):
            line = filled[wrong[0]]
            raise CorruptError(
                f"line {lines.number[line]}: a row of element {element.name} of {words[wrong[0]]} words, "
                f"this line has {lines.fields[line]}"
            )
        filled = filled[element.count :]
    return table


def _whole_numbers(values: NDArray[np.float64], element: Element, declared: Property) -> NDArray[np.int64]:
    """Values of a text body that were declared as whole numbers; an index may be negative all the same, since
    that is illegal and noted as such."""
    limits = np.iinfo(declared.type)
    low = -(2**53) if declared.name in _INDEX_NAMES else limits.min
    good = (values >= low) & (values <= limits.max) & (values == np.trunc(values))
    if not good.all():
        raise CorruptError(
            f"element {element.name}: {declared.name} is {values[np.argmin(good)]:g}, "
            f"but declared as a whole number from {limits.min} to {limits.max}"
        )
    return values.astype(np.int64)


def _read_binary(body: bytes, elements: list[Element], order: ByteOrder) -> dict[str, dict[str, Column]]:
    buffer = np.frombuffer(body, np.uint8)
    swap = order not in ("=", "<")
    at = 0
    table: dict[str, dict[str, Column]] = {}
    for element in elements:
        item = np.array([np.dtype(p.type).itemsize for p in element.properties], np.int64)
        count = np.array([_count_code(p.count_type) for p in element.properties], np.int64)
        least = int(np.where(count == 0, item, np.abs(count)).sum())
        _check_room(element, max(least, 1), len(buffer) - at)
        offsets = np.zeros((len(element.properties), element.count), np.int64)
        sizes = np.ones((len(element.properties), element.count), np.int64)
        at, whole = _walk(buffer, at, item, count, swap, offsets, sizes)
        if whole < element.count:
            raise CorruptError(
                f"the header says {element.count} rows of element {element.name}, the file holds {whole}"
            )
        columns = {}
        for i, p in enumerate(element.properties):
            raw = np.empty(int(sizes[i].sum()) * item[i], np.uint8)
            _gather(buffer, offsets[i], sizes[i] * item[i], raw)
            values = raw.view(np.dtype(p.type).newbyteorder(order))
            columns[p.name] = Column(values, sizes[i], p.type, p.count_type is not None)
        table[element.name] = columns
    if body[at:] not in (b"", b"\n", b"\r\n"):
        raise CorruptError(f"{len(body) - at} bytes follow the last row that the header announces")
    return table


def _check_room(element: Element, least_bytes: int, room: int) -> None:
    """Refuse a count that the file cannot hold before anything is allocated for it."""
    if element.count * least_bytes > room:
        raise CorruptError(
            f"the header says {element.count} rows of element {element.name}, "
            f"the file holds at most {room // least_bytes}"
        )


def _count_code(count_type: str | None) -> int:
    """0 for a number, else the bytes of a list's count: negative where signed, 8 for float64 (of text)."""
    if count_type is None:
        return 0
    size = np.dtype(count_type).itemsize
    return -size if count_type[0] == "i" else size


def _corners(table: dict[str, dict[str, Column]]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Corners and sizes of the polygons, then of the triangles of strips."""
    corners: list[NDArray[np.int64]] = []
    sizes: list[NDArray[np.int64]] = []
    faces = _index_column(table.get("face", {}))
    if faces is not None:
        corners.append(faces.values.astype(np.int64))
        sizes.append(faces.sizes)
    strips = _index_column(table.get("tristrips", {}))
    if strips is not None:
        triangles = strip_triangles(strips.values.astype(np.int64), strips.sizes)
        corners.append(triangles.ravel())
        sizes.append(np.full(len(triangles), 3, np.int64))
    empty = np.zeros(0, np.int64)
    return np.concatenate([empty, *corners]), np.concatenate([empty, *sizes])


def _index_column(element: dict[str, Column]) -> Column | None:
    for name in _INDEX_NAMES:
        if name in element:
            if element[name].type[0] == "f" or not element[name].is_list:
                raise CorruptError(f"{name} is declared as something else than a list of whole numbers")
            return element[name]
    return None


def strip_triangles(indices: NDArray[np.int64], sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """The triangles (t, 3) of triangle strips; -1 begins a new strip, every second triangle is turned."""
    ends = np.cumsum(sizes)
    begins = np.zeros(len(indices) + 1, bool)
    begins[ends - sizes] = True
    restart = indices == -1
    begins[1:] |= restart
    # Position of each index within its own strip: the distance to where that strip began.
    start = np.maximum.accumulate(np.where(begins[:-1], np.arange(len(indices)), 0))
    position = np.arange(len(indices)) - start
    last = np.flatnonzero((position >= 2) & ~restart)
    triangles = np.stack([indices[last - 2], indices[last - 1], indices[last]], axis=1)
    odd = position[last] % 2 == 1
    triangles[odd] = triangles[odd][:, [1, 0, 2]]
    return triangles[(triangles[:, 0] != triangles[:, 1]) & (triangles[:, 1] != triangles[:, 2])]


def _colors(vertex: dict[str, Column]) -> NDArray[np.float64] | None:
    for prefix in ("", "diffuse_"):
        names = [prefix + name for name in ("red", "green", "blue")]
        if all(name in vertex and not vertex[name].is_list for name in names):
            if prefix + "alpha" in vertex and not vertex[prefix + "alpha"].is_list:
                names.append(prefix + "alpha")
            break
    else:
        return None
    colors = np.ones((len(vertex["x"].values), 4))
    for i, name in enumerate(names):
        scale = {"u1": 255.0, "u2": 65535.0}.get(vertex[name].type, 1.0)
        colors[:, i] = vertex[name].values.astype(np.float64) / scale
    return colors


def _corner_uv(
    table: dict[str, dict[str, Column]], corners: NDArray[np.int64], sizes: NDArray[np.int64]
) -> NDArray[np.float64] | None:
    """Texture coordinates from the faces' own lists (u v u v ...), else from the vertices."""
    own = table.get("face", {}).get("texcoord")
    if own is not None and len(own.sizes) == len(sizes) and np.array_equal(own.sizes, 2 * sizes):
        return own.values.astype(np.float64).reshape(-1, 2)
    vertex = table["vertex"]
    for u, v in _UV_NAMES:
        if (
            u in vertex
            and v in vertex
            and len(vertex[u].values)
            and not vertex[u].is_list | vertex[v].is_list
        ):
            per_vertex = np.stack([vertex[u].values, vertex[v].values], axis=1).astype(np.float64)
            return per_vertex[np.clip(corners, 0, len(per_vertex) - 1)]
    return None


def _corner_normals(vertex: dict[str, Column], corners: NDArray[np.int64]) -> NDArray[np.float64] | None:
    """The normals of the vertices, at the corners."""
    columns = [vertex.get(name) for name in ("nx", "ny", "nz")]
    if any(column is None or column.is_list or not len(column.values) for column in columns):
        return None
    normals = np.stack([column.values for column in columns if column is not None], axis=1)
    return normals.astype(np.float64)[np.clip(corners, 0, len(normals) - 1)]


@kernel
def _walk(buffer, at, item, count, swap, offsets, sizes):  # type: ignore[no-untyped-def]
    """Where each property of each row lies. Returns the end of the rows, and how many the buffer holds."""
    properties, rows = offsets.shape
    scratch = np.empty(8, np.uint8)
    for row in range(rows):
        for p in range(properties):
            n = 1
            if count[p] != 0:
                width = abs(count[p])
                if at + width > len(buffer):
                    return at, row
                if width == 8:
                    for i in range(8):
                        scratch[i] = buffer[at + i]
                    value = scratch.view(np.float64)[0]
                    if not (0 <= value < 1e15) or value != np.floor(value):
                        return at, row
                    n = int(value)
                else:
                    n = 0
                    for i in range(width):
                        n = 256 * n + buffer[at + i if swap else at + width - 1 - i]
                    if count[p] < 0 and n >= 1 << (8 * width - 1):
                        return at, row
                at += width
            if n * item[p] > len(buffer) - at:
                return at, row
            offsets[p, row] = at
            sizes[p, row] = n
            at += n * item[p]
    return at, rows


@kernel
def _gather(buffer, offsets, widths, out):  # type: ignore[no-untyped-def]
    k = 0
    for row in range(len(offsets)):
        for i in range(offsets[row], offsets[row] + widths[row]):
            out[k] = buffer[i]
            k += 1
