"""A glTF 2.0 document: its JSON, its buffers, the tree of its nodes, and the numbers of its accessors.

Every accessor is checked against its buffer. Buffers lie in the file or beside it, never elsewhere.
Source: Khronos, glTF 2.0 specification, ISO/IEC 12113:2022.
"""

from __future__ import annotations

import base64
import binascii
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import (
    AccessError,
    CorruptError,
    MissingFileError,
    SecurityError,
    UnsupportedError,
)

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_QUANTIZED = "KHR_mesh_quantization"
# Required extensions that leave the geometry as it is, or that are followed here.
_HARMLESS = (
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_",
    "KHR_xmp",
    _QUANTIZED,
)
MAX_CORNERS = 300_000_000
_MAX_ROTATION_ERROR = 0.02
# Component types and whether they are normalised, without quantisation.
FLOATS = frozenset({(5126, False)})
NORMALISED = frozenset({(5126, False), (5121, True), (5123, True)})
UNSIGNED = frozenset({(5121, False), (5123, False), (5125, False)})
# Transforms of a node in the order of `trs_matrices`, with their values where it has none.
AT_REST = {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]}
_KEYS = {
    kind: frozenset({*keys.split(), "name", "extensions", "extras"})
    for kind, keys in {
        "node": "camera children skin matrix mesh rotation scale translation weights",
        "mesh": "primitives weights",
        "primitive": "attributes indices material mode targets",
        "accessor": "bufferView byteOffset componentType normalized count type max min sparse",
        "bufferView": "buffer byteOffset byteLength byteStride target",
        "buffer": "uri byteLength",
    }.items()
}


class PlacedNode(NamedTuple):
    """A node of the scene: its number and that of its parent (-1 for none), its entry, and its matrix to the
    world, float64 (4, 4).
    """

    number: int
    parent: int
    entry: dict[str, Any]
    matrix: NDArray[np.float64]


@contextmanager
def malformed_is_corrupt() -> Iterator[None]:
    """Turn what Python raises where JSON has other types than glTF asks for into CorruptError."""
    try:
        yield
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise CorruptError(f"the JSON does not follow glTF 2.0: {type(error).__name__} {error}") from None


class GltfDocument:
    """The JSON of a file and its buffers, which are loaded when something asks for them.

    json: as it stands in the file. required: extensions that the file asks for. unknown: keys that glTF does
    not know, of what has been looked at. Methods raise CorruptError, UnsupportedError, SecurityError,
    MissingFileError or AccessError; call them within `malformed_is_corrupt`.
    """

    def __init__(self, data: bytes, folder: Path | None, follows: tuple[str, ...] = ()) -> None:
        """follows: extensions that may be required, since the caller heeds them."""
        self.folder = folder
        text, self.chunk = _chunks(data) if data.startswith(b"glTF") else (data, None)
        try:
            self.json: dict[str, Any] = json.loads(
                text.decode("utf-8-sig"), object_pairs_hook=_without_repeats
            )
        except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
            raise CorruptError(f"the JSON is broken: {error}") from None
        if not isinstance(self.json, dict):
            raise CorruptError("the JSON is no object")
        version = self.json["asset"]["version"]
        if not isinstance(version, str) or not re.fullmatch(r"2\.[0-9]+", version):
            raise UnsupportedError(f"glTF version {str(version)[:20]!r} is not supported, only 2")
        self.required = self.json.get("extensionsRequired", [])
        for name in self.required:
            if not str(name).startswith(_HARMLESS) and name not in follows:
                raise UnsupportedError(f"the extension {str(name)[:60]!r} is required")
        self.buffers: dict[int, bytes] = {}
        self.unknown: dict[str, None] = {}

    def placed_nodes(self) -> list[PlacedNode]:
        """The nodes of the default scene, parents before their children, without recursion."""
        nodes = self.json.get("nodes", [])
        stack = [(i, -1, np.eye(4)) for i in reversed(self._roots(nodes))]
        seen = np.zeros(len(nodes), bool)
        placed = []
        while stack:
            i, parent, outer = stack.pop()
            check_index(i, nodes, "node")
            if seen[i]:
                raise CorruptError(f"node {i} is reached twice: the nodes are no tree")
            seen[i] = True
            self.note_unknown(nodes[i], "node")
            with np.errstate(invalid="ignore", over="ignore"):
                matrix = np.einsum("ij,jk->ik", outer, node_matrix(nodes[i]))
            placed.append(PlacedNode(i, parent, nodes[i], matrix))
            stack += [(child, i, matrix) for child in reversed(nodes[i].get("children", []))]
        return placed

    def missing_images(self) -> int:
        """How many pictures that the file names are not beside it."""
        missing = 0
        for image in self.json.get("images", []):
            uri = image.get("uri")
            if uri is None or uri.startswith("data:"):
                continue
            try:
                missing += self.folder is None or not self.beside(uri).is_file()
            except (SecurityError, OSError):
                missing += 1
        return int(missing)

    def _roots(self, nodes: list[dict[str, Any]]) -> list[int]:
        scenes = self.json.get("scenes", [])
        if scenes:
            scene = self.json.get("scene", 0)
            check_index(scene, scenes, "scene")
            return list(scenes[scene].get("nodes", []))
        children = {child for node in nodes for child in node.get("children", [])}
        return [i for i in range(len(nodes)) if i not in children]

    def note_unknown(self, entry: dict[str, Any], kind: str) -> None:
        """Keep in mind the keys that no `kind` has: one of them may be a misspelt part of the surface."""
        for key in entry:
            if key in _KEYS[kind]:
                continue
            self.unknown.setdefault(f"{key[:40]!r} of a {kind}")

    def accessor_entry(self, index: int) -> dict[str, Any]:
        check_index(index, self.json.get("accessors", []), "accessor")
        entry: dict[str, Any] = self.json["accessors"][index]
        return entry

    def accessor(self, index: int, types: tuple[str, ...], components: frozenset[Any]) -> NDArray[np.float64]:
        """The values of an accessor, (count, width).

        components: what the component type and whether it is normalised may be; with quantisation, anything.
        """
        entry = self.accessor_entry(index)
        self.note_unknown(entry, "accessor")
        if entry["type"] not in types:
            raise CorruptError(f"accessor {index} is of type {entry['type']}, expected {' or '.join(types)}")
        component = (entry["componentType"], entry.get("normalized", False))
        if not isinstance(component[1], bool):
            raise CorruptError(f"accessor {index} has a normalized that is neither true nor false")
        if component not in components and (components is UNSIGNED or _QUANTIZED not in self.required):
            raise CorruptError(f"accessor {index} cannot have the component type {component[0]} here")
        width, kind = _WIDTHS[entry["type"]], np.dtype(_COMPONENTS[entry["componentType"]])
        count = positive(entry["count"], "count")
        if "bufferView" in entry:
            values = self._view(entry["bufferView"], entry.get("byteOffset", 0), count, width, kind, index)
        else:
            if "sparse" not in entry or count > MAX_CORNERS:
                raise CorruptError(f"accessor {index} has no data")
            values = np.zeros((count, width), kind)
        if "sparse" in entry:
            values = self._filled(values, entry["sparse"], index)
        if kind.kind == "f" or not entry.get("normalized", False):
            return values.astype(np.float64)
        return np.maximum(values.astype(np.float64) / np.iinfo(kind).max, -1.0)

    def _filled(self, values: NDArray[Any], sparse: dict[str, Any], index: int) -> NDArray[Any]:
        count = positive(sparse["count"], "count")
        where, what = sparse["indices"], sparse["values"]
        kind = np.dtype(_COMPONENTS[where["componentType"]])
        rows = self._view(where["bufferView"], where.get("byteOffset", 0), count, 1, kind, index).ravel()
        new = self._view(
            what["bufferView"], what.get("byteOffset", 0), count, values.shape[1], values.dtype, index
        )
        if kind.kind != "u" or (np.diff(rows.astype(np.int64)) <= 0).any() or rows[-1] >= len(values):
            raise CorruptError(
                f"accessor {index} has sparse indices that do not rise, or beyond {len(values)}"
            )
        values = values.copy()
        values[rows] = new
        return values

    def _view(
        self, view_index: int, offset: int, count: int, width: int, kind: np.dtype[Any], accessor: int
    ) -> NDArray[Any]:
        """`count` rows of `width` numbers from a buffer view."""
        views = self.json.get("bufferViews", [])
        check_index(view_index, views, "bufferView")
        view = views[view_index]
        self.note_unknown(view, "bufferView")
        row = width * kind.itemsize
        stride = natural(view.get("byteStride", row), "byteStride")
        begin = natural(view.get("byteOffset", 0), "byteOffset")
        length = positive(view["byteLength"], "byteLength")
        buffer = self.buffer(view["buffer"])
        if begin + length > len(buffer):
            raise CorruptError(
                f"bufferView {view_index} ends at byte {begin + length}, its buffer at {len(buffer)}"
            )
        offset = natural(offset, "byteOffset")
        needed = offset + stride * (count - 1) + row
        if "byteStride" in view and (stride % 4 or not 4 <= stride <= 252):
            raise CorruptError(f"bufferView {view_index} has a byteStride of {stride}")
        if stride < row or needed > length:
            raise CorruptError(f"accessor {accessor} needs {needed} bytes, its bufferView has {length}")
        if (begin + offset) % kind.itemsize:
            raise CorruptError(
                f"accessor {accessor} begins at byte {begin + offset}, no multiple of {kind.itemsize}"
            )
        return np.ndarray((count, width), kind, buffer, begin + offset, (stride, kind.itemsize))

    def buffer(self, index: int) -> bytes:
        entries = self.json.get("buffers", [])
        check_index(index, entries, "buffer")
        if index not in self.buffers:
            self.buffers[index] = self._load_buffer(index, entries[index])
        return self.buffers[index]

    def _load_buffer(self, index: int, entry: dict[str, Any]) -> bytes:
        self.note_unknown(entry, "buffer")
        announced = positive(entry["byteLength"], "byteLength")
        uri = entry.get("uri")
        if uri is None:
            if index != 0 or self.chunk is None:
                raise MissingFileError(f"buffer {index} names no file")
            data = self.chunk
        elif uri.startswith("data:"):
            head, _, body = uri.partition(",")
            if not head.endswith(";base64"):
                raise UnsupportedError("a data URI that is not base64")
            try:
                data = base64.b64decode(body, validate=True)
            except binascii.Error as error:
                raise CorruptError(f"buffer {index}: {error}") from None
        else:
            data = self._load_beside(uri, announced)
        if len(data) < announced:
            raise CorruptError(f"buffer {index} is announced with {announced} bytes, but holds {len(data)}")
        return data[:announced]

    def _load_beside(self, uri: str, length: int) -> bytes:
        path = self.beside(uri)
        try:
            if not path.is_file():
                raise MissingFileError(f"{uri!r} is not beside the model")
            with path.open("rb") as stream:
                return stream.read(length)
        except OSError as error:
            raise AccessError(f"{uri!r} cannot be read: {error.strerror}") from None

    def beside(self, uri: str) -> Path:
        """The path of a relative URI, which must stay within the model's folder, links included."""
        name = unquote(uri)
        path = Path(name.replace("\\", "/"))
        if ":" in name.split("/")[0] or path.is_absolute() or ".." in path.parts or "\0" in name:
            raise SecurityError(f"{uri[:80]!r} leads out of the model's folder")
        if self.folder is None:
            raise MissingFileError(f"{uri!r} cannot be found: the model came without a folder")
        full = (self.folder / path).resolve()
        if not full.is_relative_to(self.folder.resolve()):
            raise SecurityError(f"{uri[:80]!r} leads out of the model's folder")
        return full


def _chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """The JSON and the binary chunk of a GLB."""
    if len(data) < 20:
        raise CorruptError(f"a GLB begins with 20 bytes of header, the file has {len(data)}")
    version, length = (int.from_bytes(data[i : i + 4], "little") for i in (4, 8))
    if version != 2:
        raise UnsupportedError(f"GLB version {version} is not supported, only 2")
    if length != len(data):
        raise CorruptError(f"the header says {length} bytes, the file holds {len(data)}")
    at = 12
    chunks = []
    while at < len(data):
        size = int.from_bytes(data[at : at + 4], "little")
        if size % 4:
            raise CorruptError(f"a chunk has {size} bytes, which is no multiple of 4")
        if at + 8 + size > len(data):
            raise CorruptError(f"a chunk says {size} bytes, the file holds {len(data) - at - 8}")
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + size]))
        at += 8 + size
    if chunks[0][0] != b"JSON":
        raise CorruptError("the first chunk is not JSON")
    if any(kind in (b"JSON", b"BIN\0") for kind, _ in chunks[2:]):
        raise CorruptError("a chunk of JSON or of binary data is there twice, or too late")
    return chunks[0][1], chunks[1][1] if len(chunks) > 1 and chunks[1][0] == b"BIN\0" else None


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    entry = dict(pairs)
    if len(entry) < len(pairs):
        raise CorruptError("an object of the JSON has a key twice")
    return entry


def node_matrix(node: dict[str, Any]) -> NDArray[np.float64]:
    """The matrix (4, 4) of a node, from its matrix or its translation, rotation (x, y, z, w) and scale."""
    if "matrix" in node:
        if node.keys() & {"translation", "rotation", "scale"}:
            raise CorruptError("a node has a matrix and another transform besides")
        return _numbers(node["matrix"], 16, "matrix").reshape(4, 4).T
    rest = {name: _numbers(node.get(name, value), len(value), name) for name, value in AT_REST.items()}
    return trs_matrices(*(rest[name][None] for name in AT_REST))[0]


def trs_matrices(
    translation: NDArray[np.float64], rotation: NDArray[np.float64], scale: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Matrices (k, 4, 4) of translations (k, 3), rotations (k, 4) as x, y, z, w, and scales (k, 3).

    Raises CorruptError for a rotation that is no unit quaternion.
    """
    x, y, z, w = rotation.T
    norm = x * x + y * y + z * z + w * w
    wrong = np.flatnonzero(~(np.abs(norm - 1.0) <= _MAX_ROTATION_ERROR))
    if len(wrong):
        raise CorruptError(f"the rotation {rotation[wrong[0]].tolist()} of a node is no unit quaternion")
    s = 2.0 / norm
    result = np.zeros((len(norm), 4, 4))
    result[:, 0, 0], result[:, 0, 1], result[:, 0, 2] = (
        1 - s * (y * y + z * z),
        s * (x * y - z * w),
        s * (x * z + y * w),
    )
    result[:, 1, 0], result[:, 1, 1], result[:, 1, 2] = (
        s * (x * y + z * w),
        1 - s * (x * x + z * z),
        s * (y * z - x * w),
    )
    result[:, 2, 0], result[:, 2, 1], result[:, 2, 2] = (
        s * (x * z - y * w),
        s * (y * z + x * w),
        1 - s * (x * x + y * y),
    )
    result[:, :3, :3] *= scale[:, None, :]
    result[:, :3, 3] = translation
    result[:, 3, 3] = 1.0
    return result


def _numbers(values: object, count: int, name: str) -> NDArray[np.float64]:
    if (
        not isinstance(values, list)
        or len(values) != count
        or not all(type(x) in (int, float) for x in values)
    ):
        raise CorruptError(f"{name} is {str(values)[:60]}, but must be a list of {count} numbers")
    return np.array(values, np.float64)


def check_index(index: object, items: list[Any], name: str) -> None:
    if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(items):
        raise CorruptError(f"{name} {index} does not exist: there are {len(items)}")


def natural(value: object, name: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise CorruptError(f"{name} is {value!r}, but must be a whole number from 0 on")
    return value


def positive(value: object, name: str) -> int:
    if natural(value, name) == 0:
        raise CorruptError(f"{name} is 0, but must be a whole number from 1 on")
    return int(value)  # type: ignore[call-overload, no-any-return]
