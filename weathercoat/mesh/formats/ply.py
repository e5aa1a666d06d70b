"""PLY (polygon file format), text and binary of either byte order.

Source: Turk, The PLY polygon file format, 1994. A text body is taken as rows of float64, so that one walk
serves both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.errors import CorruptError
from weathercoat.mesh.formats.polygons import Polygons
from weathercoat.mesh.formats.text import count_words, normalise, parse_numbers

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


def read_ply(data: bytes) -> Polygons:
    """The polygons of a PLY file: elements `vertex` with `face` or `tristrips`.

    Errors: CorruptError with counts, line or index.
    """
    order, elements, body = _header(data)
    table = _read_ascii(data[body:], elements) if order == "=" else _read_binary(data[body:], elements, order)
    if "vertex" not in table or not {"x", "y", "z"} <= table["vertex"].keys():
        raise CorruptError("the header names no element vertex with x, y and z")
    vertex = table["vertex"]
    positions = np.stack([vertex[axis].values.astype(np.float64) for axis in "xyz"], axis=1)
    corners, sizes = _corners(table)
    polygons = Polygons(
        positions=positions,
        corners=corners,
        sizes=sizes,
        uv=_corner_uv(table, corners, sizes),
        face_group=np.zeros(len(sizes), np.int32),
        colors=_colors(vertex),
        single_precision=order != "=" and vertex["x"].type == "f4",
    )
    polygons.drop_illegal()
    return polygons


def _header(data: bytes) -> tuple[ByteOrder, list[Element], int]:
    """Byte order, elements, and where the body begins."""
    end = data.find(b"end_header", 0, _MAX_HEADER)
    stop = min((i for i in (data.find(b"\n", end), data.find(b"\r", end)) if i >= 0), default=-1)
    if end < 0 or stop < 0:
        raise CorruptError("the header has no end")
    body = stop + (2 if data[stop : stop + 2] == b"\r\n" else 1)
    lines = data[:end].replace(b"\r\n", b"\n").replace(b"\r", b"\n").decode("latin-1").split("\n")
    order: ByteOrder | None = None
    elements: list[Element] = []
    for number, line in enumerate(lines, 1):
        words = line.split()
        if number == 1 or not words or words[0] in ("comment", "obj_info"):
            continue
        try:
            if words[0] == "format" and words[2] == "1.0":
                order = _ORDERS[words[1]]
            elif words[0] == "element":
                count = int(words[2])
                if count < 0:
                    raise ValueError
                elements.append(Element(words[1], count, []))
            elif words[0] == "property" and words[1] == "list":
                elements[-1].properties.append(Property(words[4], _TYPES[words[3]], _TYPES[words[2]]))
            elif words[0] == "property":
                elements[-1].properties.append(Property(words[2], _TYPES[words[1]]))
            else:
                raise ValueError
        except (KeyError, IndexError, ValueError):
            raise CorruptError(f"line {number} of the header: {line[:60]!r}") from None
    if order is None:
        raise CorruptError("the header names no format")
    return order, elements, body


def _read_ascii(body: bytes, elements: list[Element]) -> dict[str, dict[str, Column]]:
    text = normalise(body)
    for element in elements:
        _check_room(element, 2 * max(len(element.properties), 1), len(text) + 1)
    words = count_words(np.frombuffer(text, np.uint8))
    values = parse_numbers(text, int(words))
    if values is None:
        for number, line in enumerate(text.split(b"\n"), 1):
            if parse_numbers(line, len(line.split())) is None:
                raise CorruptError(f"line {number} after the header: {line[:60]!r} are no numbers")
        raise CorruptError("something after the header is no number")
    rows = [
        Element(e.name, e.count, [Property(p.name, "f8", p.count_type and "f8") for p in e.properties])
        for e in elements
    ]
    table = _read_binary(values.tobytes(), rows, "=")
    for element in elements:
        for declared in element.properties:
            column = table[element.name][declared.name]
            column.type = declared.type
            if declared.type[0] in "iu":
                whole = np.asarray(column.values, np.float64)
                if not np.all(np.abs(whole) < 2.0**53) or np.any(whole != np.trunc(whole)):
                    raise CorruptError(f"element {element.name}: {declared.name} holds no whole numbers")
                column.values = whole.astype(np.int64)
    return table


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
            columns[p.name] = Column(raw.view(np.dtype(p.type).newbyteorder(order)), sizes[i], p.type)
        table[element.name] = columns
    if body[at : at + 64].strip(b"\0 \t\r\n") or len(body) - at > 64:
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
    """0 for a number, else the bytes of a list's count: negative where signed, 8 for float64."""
    if count_type is None:
        return 0
    size = np.dtype(count_type).itemsize
    if count_type[0] == "f" and size != 8:
        raise CorruptError("the count of a list is declared as float")
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
            if element[name].type[0] == "f":
                raise CorruptError(f"{name} is declared as float")
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
        if all(name in vertex for name in names):
            if prefix + "alpha" in vertex:
                names.append(prefix + "alpha")
            break
    else:
        return None
    colors = np.ones((len(vertex["x"].values), 4))
    for i, name in enumerate(names):
        scale = {"u1": 255.0, "u2": 65535.0}.get(vertex[name].type, 1.0)
        colors[:, i] = vertex[name].values.astype(np.float64) / scale
    return np.clip(np.nan_to_num(colors), 0.0, 1.0)


def _corner_uv(
    table: dict[str, dict[str, Column]], corners: NDArray[np.int64], sizes: NDArray[np.int64]
) -> NDArray[np.float64] | None:
    """Texture coordinates from the faces' own lists (u v u v ...), else from the vertices."""
    own = table.get("face", {}).get("texcoord")
    if own is not None and len(own.sizes) == len(sizes) and np.array_equal(own.sizes, 2 * sizes):
        return np.nan_to_num(own.values.astype(np.float64).reshape(-1, 2), posinf=0.0, neginf=0.0)
    vertex = table["vertex"]
    for u, v in _UV_NAMES:
        if u in vertex and v in vertex and len(vertex[u].values):
            per_vertex = np.stack([vertex[u].values, vertex[v].values], axis=1).astype(np.float64)
            per_vertex = np.nan_to_num(per_vertex, posinf=0.0, neginf=0.0)
            return per_vertex[np.clip(corners, 0, len(per_vertex) - 1)]
    return None


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
