"""A strict parser of the tests' own: is a file well-formed by the rules of its format, read literally?

Plain Python without any code of the package, slow, and made only to contradict the reader. What it lets
pass beyond the letter, because programs write it and it can mean one thing only: byte order marks, UTF-16
with one, CR and CRLF, blanks and empty lines anywhere in text, comments behind a blank in OBJ and OFF,
`1/` and `1//` in OBJ, whole numbers written as 3.0 in text PLY, a last line end after a binary PLY, upper
case in STL, in OBJ statements of free-form geometry and indices of normals where all normals were stripped,
in glTF everything that does not make the surface.
"""

from __future__ import annotations

import base64
import binascii
import io
import json
import math
import re
import struct
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import Any

Point = tuple[float, float, float]

_NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_NOT_FINITE = re.compile(rb"[+-]?(nan|inf|infinity)", re.IGNORECASE)
_SHIFT_JIS_OR_NOT = re.compile(rb"(?<![\x80-\xff])\\\n")


class BrokenError(Exception):
    """The file breaks a rule of its format, and nothing but a refusal will do."""

    def __init__(self, why: str) -> None:
        super().__init__(why[:200])


@dataclass(frozen=True)
class Flaw:
    """A rule that is broken where the reader may go on, if it says so by one of these notes."""

    why: str
    notes: tuple[str, ...]


@dataclass
class Content:
    """What a file says.

    points: the positions of the file, or None where they are not stored as such. triangles: as many at most.
    """

    points: set[Point] | None
    triangles: int
    flaws: list[Flaw] = field(default_factory=list)


def parse(data: bytes, format: str) -> Content | None:
    """The content of a file in one of the formats that have a parser here, else None; BrokenError."""
    if data.startswith(b"PK"):
        data = _only_model(data)
    parser = _PARSERS.get(format)
    return None if parser is None else parser(data)


def _only_model(data: bytes) -> bytes:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = [n for n in archive.namelist() if PurePosixPath(n).suffix.lower()[1:] in _PARSERS]
            if archive.testzip() is not None or len(names) != 1:
                raise BrokenError("no whole archive of one model")
            return archive.read(names[0])
    except (zipfile.BadZipFile, ValueError, OSError, EOFError) as error:
        raise BrokenError(str(error)) from None


# Text


def _plain(data: bytes) -> bytes:
    """Bytes with line feeds only, of a text in UTF-8 or a relative."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        try:
            data = data.decode("utf-16").encode()
        except UnicodeError as error:
            raise BrokenError(str(error)) from None
    return data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def _uncommented(line: bytes) -> list[bytes]:
    words = line.split()
    for i, word in enumerate(words):
        if word.startswith(b"#"):
            return words[:i]
    return words


def _number(word: bytes) -> float:
    if not _NUMBER.fullmatch(word) and not _NOT_FINITE.fullmatch(word):
        raise BrokenError(f"{word!r} is no number")
    return float(word)


def _numbers(words: list[bytes]) -> list[float]:
    return [_number(word) for word in words]


def _natural(word: bytes) -> int:
    if not re.fullmatch(rb"\d+", word):
        raise BrokenError(f"{word!r} is no whole number from 0 on")
    return int(word)


def _check_finite(points: list[Point], flaws: list[Flaw]) -> None:
    if not all(math.isfinite(x) for point in points for x in point):
        flaws.append(Flaw("a position is not finite", ("W-NONFINITE", "W-UNREFERENCED")))


def _check_corners(indices: list[int], points: int, flaws: list[Flaw]) -> None:
    """The vertices of one face, counted from 0."""
    if any(i >= points for i in indices):
        raise BrokenError(f"a face has index {max(indices)} of {points}")
    if any(i < 0 for i in indices):
        flaws.append(Flaw("a face has a negative index", ("W-BADINDEX",)))
    if len(indices) < 3:
        flaws.append(Flaw("a face has fewer than three corners", _DROPPED))


_DROPPED = ("W-DEGENERATE", "W-BADINDEX", "W-NONFINITE")


# OBJ

_OBJ_CORNER = re.compile(rb"(-?\d+)(?:(/)(-?\d+)?(?:(/)(-?\d+)?)?)?")
_OBJ_NUMBERS = {b"v": (3, 4, 6, 7), b"vt": (1, 2, 3), b"vn": (3,), b"vp": (1, 2, 3)}
_OBJ_OTHERS = set(
    b"g o usemtl mtllib usemap maplib mg cstype deg bmat step curv curv2 surf parm trim hole scrv sp end con"
    b" bevel c_interp d_interp lod ctech stech shadow_obj trace_obj bsp bzp cdc cdp res vw".split()
)


def _obj(data: bytes) -> Content:
    values: dict[bytes, list[list[float]]] = {word: [] for word in _OBJ_NUMBERS}
    faces: list[list[tuple[int | None, ...]]] = []
    others: list[list[tuple[int | None, ...]]] = []
    for line in _SHIFT_JIS_OR_NOT.sub(b"  ", _plain(data)).split(b"\n"):
        words = _uncommented(line)
        if not words:
            continue
        keyword, rest = words[0], words[1:]
        if keyword in _OBJ_NUMBERS:
            if len(rest) not in _OBJ_NUMBERS[keyword]:
                raise BrokenError(f"{keyword!r} with {len(rest)} numbers")
            values[keyword].append(_numbers(rest))
        elif keyword in (b"f", b"fo", b"l", b"p"):
            before = [len(values[kind]) for kind in (b"v", b"vt", b"vn")]
            (faces if keyword[:1] == b"f" else others).append(_obj_corners(rest, before))
        elif keyword == b"s":
            if len(rest) != 1 or not re.fullmatch(rb"\d+|off|on", rest[0]):
                raise BrokenError("s without a number or off")
        elif keyword not in _OBJ_OTHERS:
            raise BrokenError(f"{keyword!r} is no keyword")
    points: list[Point] = [(p[0], p[1], p[2]) for p in values[b"v"]]
    flaws: list[Flaw] = []
    _check_finite(points, flaws)
    for number, element in enumerate([*faces, *others]):
        for v, vt, vn in element:
            for index, kind in ((v, b"v"), (vt, b"vt")):
                if index is not None and index >= len(values[kind]):
                    raise BrokenError(f"index {index} of {len(values[kind])} {kind!r}")
            if number >= len(faces):
                if v is not None and v < 0:
                    raise BrokenError("a point or a line with index 0")
                continue
            normals = range(len(values[b"vn"]))
            if any(index is not None and index < 0 for index in (v, vt)) or (
                vn is not None and normals and vn not in normals
            ):
                flaws.append(Flaw("an illegal index", ("W-BADINDEX",)))
    if any(len(face) < 3 for face in faces):
        flaws.append(Flaw("a face has fewer than three corners", _DROPPED))
    used = {vt for face in faces for _, vt, _ in face if vt is not None}
    if any(not math.isfinite(x) for i in used if i >= 0 for x in values[b"vt"][i][:2]):
        flaws.append(Flaw("a texture coordinate is not finite", _DROPPED))
    if any(not math.isfinite(x) for v in values[b"v"] if len(v) >= 6 for x in v[-3:]):
        flaws.append(Flaw("a colour is not finite", ("W-NONFINITE", "W-UNREFERENCED")))
    return Content(set(points), sum(max(len(face) - 2, 0) for face in faces), flaws)


def _obj_corners(words: list[bytes], before: list[int]) -> list[tuple[int | None, ...]]:
    """Indices from 0 of vertex, texture coordinate and normal of each corner; negative where illegal."""
    corners, forms = [], set()
    for word in words:
        match = _OBJ_CORNER.fullmatch(word)
        if not match:
            raise BrokenError(f"{word!r} is no corner")
        v, first, vt, second, vn = match.groups()
        forms.add((first, vt is None, second, vn is None))
        corner: list[int | None] = []
        for text, count in zip((v, vt, vn), before, strict=True):
            index = None if text is None else int(text)
            if index is not None and index < -count and text is not vn:
                raise BrokenError(f"{index} lies before the first")
            corner.append(index if index is None else index - 1 if index >= 0 else max(count + index, -1))
            if text is not None and re.fullmatch(rb"-0+", text):
                corner[-1] = -1
        corners.append(tuple(corner))
    if len(forms) > 1:
        raise BrokenError("the corners of a face have different forms")
    return corners


# PLY

_PLY_TYPES = {
    "char": "b", "int8": "b", "uchar": "B", "uint8": "B", "short": "h", "int16": "h", "ushort": "H",
    "uint16": "H", "int": "i", "int32": "i", "uint": "I", "uint32": "I", "float": "f", "float32": "f",
    "double": "d", "float64": "d",
}  # fmt: skip
_RANGES = {
    "b": (-(2**7), 2**7), "B": (0, 2**8), "h": (-(2**15), 2**15), "H": (0, 2**16), "i": (-(2**31), 2**31),
    "I": (0, 2**32),
}  # fmt: skip
_Property = tuple[str, str, str]  # name, type of the items, type of the count or ""
_Element = tuple[str, int, list[_Property]]


def _ply(data: bytes) -> Content:
    format, elements, body = _ply_header(data)
    rows: Iterator[Any] | _Binary
    if format == "ascii":
        rows = (line.split() for line in _plain(body).split(b"\n") if line.strip())
    else:
        rows = _Binary(body, "<" if format == "binary_little_endian" else ">")
    table: dict[str, list[dict[str, Any]]] = {}
    for name, count, properties in elements:
        if count > len(body):
            raise BrokenError(f"{count} rows of {name} in {len(body)} bytes")
        table[name] = []
        for _ in range(count):
            if isinstance(rows, _Binary):
                table[name].append(rows.row(properties))
            else:
                table[name].append(_text_row(next(rows, []), properties))
    left = rows.left() if isinstance(rows, _Binary) else next(rows, b"")
    if left not in (b"", b"\n", b"\r\n"):
        raise BrokenError("something follows the last row")
    if not table.get("vertex"):
        raise BrokenError("no vertices")
    return _ply_content(table)


def _ply_content(table: dict[str, list[dict[str, Any]]]) -> Content:
    vertex = table["vertex"]
    if any(not isinstance(vertex[0].get(axis), (int, float)) for axis in "xyz"):
        raise BrokenError("a vertex without x, y, z")
    points: list[Point] = [(float(v["x"]), float(v["y"]), float(v["z"])) for v in vertex]
    flaws: list[Flaw] = []
    _check_finite(points, flaws)
    triangles = 0
    for element in ("face", "tristrips"):
        for row in table.get(element, []):
            indices = row.get("vertex_indices", row.get("vertex_index"))
            if indices is None:
                break
            if not isinstance(indices, list) or any(isinstance(i, float) for i in indices):
                raise BrokenError("the indices are no list of whole numbers")
            triangles += max(len(indices) - 2, 0)
            if element == "face":
                _check_corners(indices, len(points), flaws)
            else:
                if any(i >= len(points) for i in indices):
                    raise BrokenError(f"a strip has index {max(indices)} of {len(points)}")
                if any(i < -1 for i in indices):
                    flaws.append(Flaw("a strip has an illegal index", ("W-BADINDEX",)))
    return Content(set(points), triangles, flaws)


def _ply_header(data: bytes) -> tuple[str, list[_Element], bytes]:
    if not re.match(rb"ply\r?\n|ply\r", data):
        raise BrokenError("no ply at the beginning")
    end = b"\r" if re.match(rb"ply\r(?!\n)", data) else b"\n"
    magic, format, elements = False, "", list[_Element]()
    while True:
        line, found, data = data.partition(end)
        if not found:
            raise BrokenError("the header has no end")
        words = line.decode("latin-1").split()
        match words:
            case ["end_header"]:
                break
            case [] | ["comment" | "obj_info", *_]:
                continue
            case ["ply"] if not magic:
                magic = True
            case ["format", name, "1.0"] if not format and not elements:
                format = name
            case ["element", name, count] if all(name != e[0] for e in elements):
                elements.append((name, _natural(count.encode()), []))
            case ["property", "list", count_type, type, name] if elements:
                if _PLY_TYPES.get(count_type, "f") in "fd":
                    raise BrokenError(f"the count of a list is {count_type}")
                _add_property(elements[-1][2], (name, _ply_type(type), _ply_type(count_type)))
            case ["property", type, name] if elements:
                _add_property(elements[-1][2], (name, _ply_type(type), ""))
            case _:
                raise BrokenError(f"{line!r} in the header")
    if any(count and not properties for _, count, properties in elements):
        raise BrokenError("an element without properties")
    if format not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise BrokenError(f"format {format!r}")
    return format, elements, data


def _ply_type(name: str) -> str:
    if name not in _PLY_TYPES:
        raise BrokenError(f"type {name!r}")
    return _PLY_TYPES[name]


def _add_property(properties: list[_Property], new: _Property) -> None:
    if any(new[0] == p[0] for p in properties):
        raise BrokenError(f"two properties are called {new[0]}")
    properties.append(new)


def _text_row(words: list[bytes], properties: list[_Property]) -> dict[str, Any]:
    rest = iter(words)
    row: dict[str, Any] = {}
    for name, type, count_type in properties:
        if count_type:
            count = _typed(next(rest, b""), count_type)
            row[name] = [_typed(next(rest, b""), type, name.startswith("vertex_ind")) for _ in range(count)]
        else:
            row[name] = _typed(next(rest, b""), type)
    if next(rest, None) is not None:
        raise BrokenError("a row holds more than its element has")
    return row


def _typed(word: bytes, type: str, is_index: bool = False) -> Any:
    value = _number(word)
    if type in "fd":
        return value
    low, high = _RANGES[type]
    if not math.isfinite(value) or value != int(value):
        raise BrokenError(f"{word!r} is no whole number")
    if is_index and value < 0:
        return int(value)
    if not low <= value < high:
        raise BrokenError(f"{word!r} does not fit its type")
    return int(value)


class _Binary:
    """Rows of a binary body."""

    def __init__(self, body: bytes, order: str) -> None:
        self.body, self.order, self.at = body, order, 0

    def left(self) -> bytes:
        return self.body[self.at :]

    def row(self, properties: list[_Property]) -> dict[str, Any]:
        row: dict[str, Any] = {}
        for name, type, count_type in properties:
            if count_type:
                (count,) = self._take(count_type, 1)
                row[name] = list(self._take(type, count))
            else:
                (row[name],) = self._take(type, 1)
        return row

    def _take(self, type: str, count: int) -> tuple[Any, ...]:
        size = struct.calcsize(self.order + type)
        if not 0 <= count * size <= len(self.body) - self.at:
            raise BrokenError("the body is too short")
        self.at += count * size
        return struct.unpack_from(f"{self.order}{count}{type}", self.body, self.at - count * size)


# STL


def _stl(data: bytes) -> Content:
    if len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        points: list[Point] = []
        for at in range(84, len(data), 50):
            numbers = struct.unpack_from("<9f", data, at + 12)
            points += [(numbers[i], numbers[i + 1], numbers[i + 2]) for i in (0, 3, 6)]
    else:
        points = _stl_text(data)
    flaws: list[Flaw] = []
    _check_finite(points, flaws)
    return Content(set(points), len(points) // 3, flaws)


def _stl_text(data: bytes) -> list[Point]:
    lines = [line.split() for line in _plain(data).split(b"\n") if line.strip()]
    at = 0
    points: list[Point] = []

    def expect(*wanted: bytes, more: bool = False) -> list[bytes]:
        nonlocal at
        words = lines[at] if at < len(lines) else []
        found = tuple(word.lower() for word in words[: len(wanted)])
        if found != wanted or (not more and len(words) > len(wanted)):
            raise BrokenError(f"expected {wanted!r}, found {words!r}")
        at += 1
        return words[len(wanted) :]

    while at < len(lines):
        expect(b"solid", more=True)
        while at < len(lines) and lines[at][0].lower() == b"facet":
            normal = expect(b"facet", b"normal", more=True)
            if len(normal) != 3 or not all(
                _NUMBER.fullmatch(word) or re.search(rb"(?i)nan|inf|#", word) for word in normal
            ):
                raise BrokenError(f"{normal!r} is no normal")
            expect(b"outer", b"loop")
            for _ in range(3):
                words = expect(b"vertex", more=True)
                if len(words) != 3:
                    raise BrokenError(f"{words!r} is no vertex")
                x, y, z = _numbers(words)
                points.append((x, y, z))
            expect(b"endloop")
            expect(b"endfacet")
        expect(b"endsolid", more=True)
    return points


# OFF


def _off(data: bytes) -> Content:
    data = re.sub(rb"#[^\n]*", b"", _plain(data))
    match = re.match(rb"\s*(ST)?(C)?(N)?OFF(?=\s|$)", data)
    if not match:
        raise BrokenError("no header of OFF")
    texture, color, normal = (bool(part) for part in match.groups())
    rows = [line.split() for line in data[match.end() :].split(b"\n") if line.strip()]
    if not rows or not 2 <= len(rows[0]) <= 3:
        raise BrokenError("no line of counts")
    vertices, faces = (_natural(word) for word in (rows[0] + [b"0"])[:2])
    for word in rows[0][2:]:
        _natural(word)
    if len(rows) != 1 + vertices + faces:
        raise BrokenError(f"{vertices} + {faces} rows are announced, {len(rows) - 1} there")
    points: list[Point] = []
    widths = set()
    for words in rows[1 : 1 + vertices]:
        numbers = _numbers(words)
        widths.add(len(numbers) - 3 - 3 * normal - 2 * texture)
        points.append(tuple(numbers[:3]))  # type: ignore[arg-type]
    if len(widths) > 1 or not widths <= ({3, 4} if color else {0, 3, 4}):
        raise BrokenError(f"vertices with {widths} numbers of colour")
    flaws: list[Flaw] = []
    _check_finite(points, flaws)
    triangles = 0
    for words in rows[1 + vertices :]:
        size = _natural(words[0])
        if len(words) - 1 - size not in (0, 1, 3, 4):
            raise BrokenError(f"a face of {size} with {len(words) - 1} numbers")
        for word in words[1 : 1 + size]:
            if not re.fullmatch(rb"-?\d+", word):
                raise BrokenError(f"{word!r} is no index")
        _numbers(words[1 + size :])
        _check_corners([int(word) for word in words[1 : 1 + size]], len(points), flaws)
        triangles += max(size - 2, 0)
    return Content(set(points), triangles, flaws)


# glTF

_COMPONENTS = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_SEMANTIC = re.compile(r"POSITION|NORMAL|TANGENT|(TEXCOORD|COLOR|JOINTS|WEIGHTS)_\d+|_.*", re.DOTALL)
_KNOWN_KEYS = {
    "node": "camera children skin matrix mesh rotation scale translation weights name",
    "mesh": "primitives weights name",
    "primitive": "attributes indices material mode targets",
    "accessor": "bufferView byteOffset componentType normalized count type max min sparse name",
    "bufferView": "buffer byteOffset byteLength byteStride target name",
    "buffer": "uri byteLength name",
}
_UNKNOWN = ("W-UNKNOWN",)


def _gltf(data: bytes) -> Content:
    text, chunk = _glb_chunks(data) if data.startswith(b"glTF") else (data, None)
    try:
        document = json.loads(text.decode("utf-8-sig"), object_pairs_hook=_without_repeats)
    except (ValueError, RecursionError) as error:
        raise BrokenError(str(error)) from None
    try:
        return _Gltf(document, chunk).content()
    except (KeyError, IndexError, TypeError, AttributeError, OverflowError) as error:
        raise BrokenError(f"{type(error).__name__} {error}") from None


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(dict(pairs)) != len(pairs):
        raise BrokenError("a key is there twice")
    return dict(pairs)


def _glb_chunks(data: bytes) -> tuple[bytes, bytes | None]:
    if len(data) < 20 or struct.unpack_from("<2I", data, 4) != (2, len(data)):
        raise BrokenError("version or length in the header")
    at, chunks = 12, []
    while at < len(data):
        if at + 8 > len(data):
            raise BrokenError("a chunk without a header")
        size, kind = struct.unpack_from("<I4s", data, at)
        if size % 4 or at + 8 + size > len(data):
            raise BrokenError(f"a chunk of {size} bytes")
        chunks.append((kind, data[at + 8 : at + 8 + size]))
        at += 8 + size
    if chunks[0][0] != b"JSON" or any(kind in (b"JSON", b"BIN\0") for kind, _ in chunks[2:]):
        raise BrokenError("the order of the chunks")
    return chunks[0][1], chunks[1][1] if len(chunks) > 1 and chunks[1][0] == b"BIN\0" else None


class _Gltf:
    def __init__(self, document: Any, chunk: bytes | None) -> None:
        self.json, self.chunk = document, chunk
        self.flaws: list[Flaw] = []
        if not re.fullmatch(r"2\.\d+", document["asset"]["version"]):
            raise BrokenError("asset.version")

    def content(self) -> Content:
        triangles = 0
        seen: set[int] = set()
        stack = list(self._roots())
        while stack:
            number = stack.pop()
            node = self._item("nodes", number, "node")
            if number in seen:
                raise BrokenError(f"node {number} is reached twice")
            seen.add(number)
            stack += node.get("children", [])
            self._check_transform(node)
            if "mesh" in node:
                mesh = self._item("meshes", node["mesh"], "mesh")
                if not isinstance(mesh["primitives"], list):
                    raise BrokenError("primitives")
                triangles += sum(self._primitive(p) for p in mesh["primitives"])
        return Content(None, triangles, self.flaws)

    def _roots(self) -> list[int]:
        if self.json.get("scenes"):
            scene: list[int] = self._item("scenes", self.json.get("scene", 0)).get("nodes", [])
            return scene
        nodes = self.json.get("nodes", [])
        children = {child for node in nodes for child in node.get("children", [])}
        return [i for i in range(len(nodes)) if i not in children]

    def _check_transform(self, node: dict[str, Any]) -> None:
        if "matrix" in node and {"translation", "rotation", "scale"} & node.keys():
            raise BrokenError("a node has a matrix and another transform")
        for key, count in (("matrix", 16), ("translation", 3), ("rotation", 4), ("scale", 3)):
            if key not in node:
                continue
            values = node[key]
            if not isinstance(values, list) or len(values) != count:
                raise BrokenError(f"{key} {values!r}")
            if not all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in values):
                raise BrokenError(f"{key} {values!r}")
            if not all(math.isfinite(x) for x in values):
                self.flaws.append(Flaw(f"{key} is not finite", ("W-NONFINITE",)))
            elif key == "rotation" and abs(math.hypot(*values) - 1) > 0.01:
                raise BrokenError(f"rotation {values!r} is no unit quaternion")

    def _primitive(self, primitive: dict[str, Any]) -> int:
        """How many triangles it has."""
        self._check_keys(primitive, "primitive")
        mode = primitive.get("mode", 4)
        if not _is_natural(mode) or mode > 6:
            raise BrokenError(f"mode {mode!r}")
        attributes = primitive["attributes"]
        if not attributes or not all(_SEMANTIC.fullmatch(name) for name in attributes):
            raise BrokenError(f"attributes {list(attributes)!r}")
        if mode < 4:
            return 0
        if "material" in primitive:
            self._item("materials", primitive["material"])
        points, component, _ = self._accessor(attributes["POSITION"], "VEC3")
        if component != "f" and "KHR_mesh_quantization" not in self.json.get("extensionsRequired", []):
            raise BrokenError("positions are whole numbers")
        if not all(math.isfinite(x) for point in points for x in point):
            self.flaws.append(Flaw("a position is not finite", ("W-NONFINITE",)))
        for name in ("TEXCOORD_0", "COLOR_0"):
            if name in attributes:
                types = ("VEC2",) if name == "TEXCOORD_0" else ("VEC3", "VEC4")
                values, kind, normalized = self._accessor(attributes[name], *types)
                if len(values) != len(points):
                    raise BrokenError(f"{name} has {len(values)} values for {len(points)} vertices")
                if (
                    kind != "f"
                    and not normalized
                    and "KHR_mesh_quantization" not in self.json.get("extensionsRequired", [])
                ):
                    raise BrokenError(f"{name} is of whole numbers, not normalised")
                if not all(math.isfinite(x) for value in values for x in value):
                    self.flaws.append(Flaw(f"{name} is not finite", ("W-NONFINITE",)))
        count = len(points)
        if "indices" in primitive:
            indices, component, _ = self._accessor(primitive["indices"], "SCALAR")
            if component not in "BHI":
                raise BrokenError("indices are not unsigned")
            if max(indices)[0] >= len(points):
                raise BrokenError(f"index {max(indices)} of {len(points)}")
            count = len(indices)
        if count < 3 or (mode == 4 and count % 3):
            raise BrokenError(f"{count} indices")
        return count // 3 if mode == 4 else count - 2

    def _accessor(self, number: int, *types: str) -> tuple[list[tuple[float, ...]], str, bool]:
        entry = self._item("accessors", number, "accessor")
        component, count = _COMPONENTS[entry["componentType"]], _positive(entry["count"])
        if entry["type"] not in types:
            raise BrokenError(f"accessor {number} is {entry['type']}")
        width = _WIDTHS[entry["type"]]
        normalized = entry.get("normalized", False)
        if not isinstance(normalized, bool):
            raise BrokenError("normalized")
        if "bufferView" in entry:
            offset = entry.get("byteOffset", 0)
            values = self._view(entry["bufferView"], offset, count, component * width)
        else:
            if "sparse" not in entry or count > 10**7:
                raise BrokenError(f"accessor {number} has no data")
            values = [(0.0,) * width] * count
        if "sparse" in entry:
            self._fill(values, entry["sparse"], component * width)
        return values, component, normalized

    def _fill(self, values: list[tuple[float, ...]], sparse: dict[str, Any], row: str) -> None:
        count = _positive(sparse["count"])
        where, what = sparse["indices"], sparse["values"]
        kind = _COMPONENTS[where["componentType"]]
        rows = self._view(where["bufferView"], where.get("byteOffset", 0), count, kind)
        new = self._view(what["bufferView"], what.get("byteOffset", 0), count, row)
        places = [int(r) for (r,) in rows]
        if kind not in "BHI" or places != sorted(set(places)) or places[-1] >= len(values):
            raise BrokenError("sparse indices")
        for place, value in zip(places, new, strict=True):
            values[place] = value

    def _view(self, number: int, offset: Any, count: int, row: str) -> list[tuple[float, ...]]:
        view = self._item("bufferViews", number, "bufferView")
        size, item = struct.calcsize("<" + row), struct.calcsize("<" + row[0])
        stride = view.get("byteStride", size)
        if "byteStride" in view and not (_is_natural(stride) and 4 <= stride <= 252 and stride % 4 == 0):
            raise BrokenError(f"byteStride {stride!r}")
        begin, length = view.get("byteOffset", 0), _positive(view["byteLength"])
        buffer = self._buffer(view["buffer"])
        if not _is_natural(begin) or not _is_natural(offset) or begin + length > len(buffer):
            raise BrokenError(f"bufferView {number} beyond its buffer")
        if (begin + offset) % item or stride < size or offset + stride * (count - 1) + size > length:
            raise BrokenError(f"bufferView {number} is too short, or off the beat of its numbers")
        return [struct.unpack_from("<" + row, buffer, begin + offset + i * stride) for i in range(count)]

    def _buffer(self, number: int) -> bytes:
        entry = self._item("buffers", number, "buffer")
        length = _positive(entry["byteLength"])
        uri = entry.get("uri")
        if uri is None:
            data = self.chunk if number == 0 else None
        elif uri.startswith("data:") and ";base64," in uri:
            try:
                data = base64.b64decode(uri.partition(",")[2], validate=True)
            except binascii.Error as error:
                raise BrokenError(str(error)) from None
        else:
            raise BrokenError(f"{uri[:40]!r} is not there")
        if data is None or len(data) < length:
            raise BrokenError(f"buffer {number} is shorter than {length}")
        return data[:length]

    def _item(self, kind: str, number: Any, what: str = "") -> dict[str, Any]:
        if not _is_natural(number):
            raise BrokenError(f"{number!r} as an index")
        entry: dict[str, Any] = self.json[kind][number]
        if what:
            self._check_keys(entry, what)
        return entry

    def _check_keys(self, entry: dict[str, Any], what: str) -> None:
        unknown = entry.keys() - {*_KNOWN_KEYS[what].split(), "extensions", "extras"}
        if unknown:
            self.flaws.append(Flaw(f"{what} has {sorted(unknown)}", _UNKNOWN))


def _is_natural(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _positive(value: Any) -> int:
    if not _is_natural(value) or not value:
        raise BrokenError(f"{value!r} should be a count")
    return int(value)


_PARSERS: dict[str, Callable[[bytes], Content]] = {
    "obj": _obj, "ply": _ply, "stl": _stl, "off": _off, "gltf": _gltf, "glb": _gltf,
}  # fmt: skip
