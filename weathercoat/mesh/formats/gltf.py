"""glTF 2.0, as JSON with its buffers or as one GLB.

Only what makes a surface is read: nodes with their transforms, triangles, texture coordinates, vertex
colours, names of materials. Every accessor is checked against its buffer. Buffers lie in the file or beside
it, never elsewhere.
Source: Khronos, glTF 2.0 specification, ISO/IEC 12113:2022.
"""

from __future__ import annotations

import base64
import binascii
import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import (
    AccessError,
    CorruptError,
    LimitError,
    MissingFileError,
    Note,
    SecurityError,
    UnsupportedError,
)
from weathercoat.mesh.formats.obj import number_groups
from weathercoat.mesh.formats.ply import strip_triangles
from weathercoat.mesh.formats.polygons import Polygons

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
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
# Extensions that put the geometry of a primitive elsewhere.
_ELSEWHERE = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")
_MAX_CORNERS = 300_000_000
_MAX_ROTATION_ERROR = 0.02
_SEMANTIC = re.compile(r"POSITION|NORMAL|TANGENT|(TEXCOORD|COLOR|JOINTS|WEIGHTS)_[0-9]+|_.*", re.DOTALL)
# Component types and whether they are normalised, without quantisation.
_FLOATS = frozenset({(5126, False)})
_NORMALISED = frozenset({(5126, False), (5121, True), (5123, True)})
_UNSIGNED = frozenset({(5121, False), (5123, False), (5125, False)})
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


@dataclass
class _Parts:
    """What the primitives give, one entry each."""

    positions: list[NDArray[np.float64]] = field(default_factory=list)
    triangles: list[NDArray[np.int64]] = field(default_factory=list)
    uv: list[NDArray[np.float64] | None] = field(default_factory=list)
    colors: list[NDArray[np.float64] | None] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    nodes: list[int] = field(default_factory=list)
    corners: int = 0


def read_gltf(data: bytes, folder: Path | None) -> Polygons:
    """The triangles of the default scene, with all transforms applied; mirrored faces are turned back.

    Errors: CorruptError, UnsupportedError, SecurityError, MissingFileError.
    """
    try:
        return _Document(data, folder).polygons()
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise CorruptError(f"the JSON does not follow glTF 2.0: {type(error).__name__} {error}") from None


class _Document:
    def __init__(self, data: bytes, folder: Path | None) -> None:
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
            if not str(name).startswith(_HARMLESS):
                raise UnsupportedError(f"the extension {str(name)[:60]!r} is required")
        self.buffers: dict[int, bytes] = {}
        self.unknown: dict[str, None] = {}

    def polygons(self) -> Polygons:
        parts = _Parts()
        for number, (node, matrix) in enumerate(self._placed_nodes()):
            self._add_mesh(parts, number, node, matrix)
        if not parts.triangles:
            return Polygons(np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros(0, np.int64), shared=False)
        sizes = [len(p) for p in parts.positions]
        first = np.cumsum(sizes) - sizes
        triangles = np.concatenate([t + f for t, f in zip(parts.triangles, first, strict=True)])
        part = np.repeat(np.arange(len(sizes)), [len(t) for t in parts.triangles])
        face_group, groups = number_groups(part, parts.names)
        corners = triangles.ravel()
        uv = _joined(parts.uv, sizes, np.zeros(2))
        result = Polygons(
            positions=np.concatenate(parts.positions),
            corners=corners,
            sizes=np.full(len(triangles), 3, np.int64),
            uv=None if uv is None else uv[corners],
            face_group=face_group,
            groups=groups,
            colors=_joined(parts.colors, sizes, np.ones(4)),
            part=np.repeat(parts.nodes, sizes),
            single_precision=True,
            shared=False,
            notes=self._lost(),
        )
        result.tidy_attributes()
        return result

    def _lost(self) -> list[Note]:
        """Notes on what cannot be kept."""
        targets = sum(bool(p.get("targets")) for m in self.json.get("meshes", []) for p in m["primitives"])
        lost = (
            ("W-SKIN", len(self.json.get("skins", [])), "skins: skinned meshes are read unposed"),
            ("W-ANIMATION", len(self.json.get("animations", [])), "animations cannot be kept"),
            ("W-MORPH", targets, "primitives have morph targets, which cannot be kept"),
            ("W-MATERIAL", self._missing_images(), "pictures are not beside the model"),
            (
                "W-UNKNOWN",
                len(self.unknown),
                f"properties that glTF does not know: {', '.join(self.unknown)[:200]}",
            ),
        )
        return [Note(code, count, text) for code, count, text in lost if count]

    def _missing_images(self) -> int:
        missing = 0
        for image in self.json.get("images", []):
            uri = image.get("uri")
            if uri is None or uri.startswith("data:"):
                continue
            try:
                missing += self.folder is None or not self._beside(uri).is_file()
            except (SecurityError, OSError):
                missing += 1
        return int(missing)

    def _placed_nodes(self) -> list[tuple[dict[str, Any], NDArray[np.float64]]]:
        """The nodes of the scene with a mesh, and their matrices to the world, without recursion."""
        nodes = self.json.get("nodes", [])
        stack = [(i, np.eye(4)) for i in reversed(self._roots(nodes))]
        seen = np.zeros(len(nodes), bool)
        placed = []
        while stack:
            i, outer = stack.pop()
            _check_index(i, nodes, "node")
            if seen[i]:
                raise CorruptError(f"node {i} is reached twice: the nodes are no tree")
            seen[i] = True
            self._note_unknown(nodes[i], "node")
            with np.errstate(invalid="ignore", over="ignore"):
                matrix = np.einsum("ij,jk->ik", outer, _matrix(nodes[i]))
            if "mesh" in nodes[i]:
                placed.append((nodes[i], matrix))
            stack += [(child, matrix) for child in reversed(nodes[i].get("children", []))]
        return placed

    def _roots(self, nodes: list[dict[str, Any]]) -> list[int]:
        scenes = self.json.get("scenes", [])
        if scenes:
            scene = self.json.get("scene", 0)
            _check_index(scene, scenes, "scene")
            return list(scenes[scene].get("nodes", []))
        children = {child for node in nodes for child in node.get("children", [])}
        return [i for i in range(len(nodes)) if i not in children]

    def _add_mesh(
        self, parts: _Parts, number: int, node: dict[str, Any], matrix: NDArray[np.float64]
    ) -> None:
        _check_index(node["mesh"], self.json.get("meshes", []), "mesh")
        mesh = self.json["meshes"][node["mesh"]]
        self._note_unknown(mesh, "mesh")
        if not isinstance(mesh["primitives"], list):
            raise CorruptError("primitives are no list")
        for primitive in mesh["primitives"]:
            self._note_unknown(primitive, "primitive")
            mode = _natural(primitive.get("mode", _TRIANGLES), "mode")
            attributes = primitive["attributes"]
            for name in attributes:
                if not _SEMANTIC.fullmatch(name):
                    raise CorruptError(
                        f"mesh {mesh.get('name', node['mesh'])!r} has an attribute {name[:40]!r}"
                    )
            if mode > _FAN or not attributes:
                raise CorruptError(f"a primitive has mode {mode} and {len(attributes)} attributes")
            if mode < _TRIANGLES:
                continue
            for extension in _ELSEWHERE:
                if extension in primitive.get("extensions", {}) and "bufferView" not in self._accessor_entry(
                    attributes["POSITION"]
                ):
                    raise UnsupportedError(f"a mesh is stored by the extension {extension}")
            local = self._accessor(attributes["POSITION"], ("VEC3",), _FLOATS)
            indices = np.arange(len(local))
            if "indices" in primitive:
                listed = self._accessor(primitive["indices"], ("SCALAR",), _UNSIGNED)
                indices = listed.ravel().astype(np.int64)
            triangles = _triangles(indices, mode, len(local), mesh.get("name", node["mesh"]))
            parts.corners += 3 * len(triangles)
            if parts.corners > _MAX_CORNERS:
                raise LimitError(f"the instances have more than {_MAX_CORNERS // 3} triangles together")
            # Without BLAS, whose results differ in the last bit from machine to machine.
            with np.errstate(invalid="ignore", over="ignore"):
                world = (
                    local[:, :1] * matrix[:3, 0]
                    + local[:, 1:2] * matrix[:3, 1]
                    + local[:, 2:] * matrix[:3, 2]
                )
                parts.positions.append(world + matrix[:3, 3])
                mirrored = np.linalg.det(matrix[:3, :3]) < 0
            parts.triangles.append(triangles[:, [0, 2, 1]] if mirrored else triangles)
            parts.names.append(self._name(primitive, mesh, node))
            parts.nodes.append(number)
            uv = self._attribute(attributes, "TEXCOORD_0", len(local), ("VEC2",))
            # glTF counts v from the top of the image, a Surface from the bottom, as OBJ does
            parts.uv.append(None if uv is None else np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1))
            colors = self._attribute(attributes, "COLOR_0", len(local), ("VEC3", "VEC4"))
            parts.colors.append(None if colors is None else _encode_srgb(colors))

    def _name(self, primitive: dict[str, Any], mesh: dict[str, Any], node: dict[str, Any]) -> str:
        names = [mesh.get("name"), node.get("name")]
        if "material" in primitive:
            _check_index(primitive["material"], self.json.get("materials", []), "material")
            names.insert(0, self.json["materials"][primitive["material"]].get("name"))
        return next((str(name) for name in names if name), "default")

    def _attribute(
        self, attributes: dict[str, int], name: str, count: int, types: tuple[str, ...]
    ) -> NDArray[np.float64] | None:
        if name not in attributes:
            return None
        values = self._accessor(attributes[name], types, _NORMALISED)
        if len(values) != count:
            raise CorruptError(f"{name} has {len(values)} values for {count} vertices")
        return values

    def _note_unknown(self, entry: dict[str, Any], kind: str) -> None:
        """Keep in mind the keys that no `kind` has: one of them may be a misspelt part of the surface."""
        for key in entry.keys() - _KEYS[kind]:
            self.unknown.setdefault(f"{key[:40]!r} of a {kind}")

    def _accessor_entry(self, index: int) -> dict[str, Any]:
        _check_index(index, self.json.get("accessors", []), "accessor")
        entry: dict[str, Any] = self.json["accessors"][index]
        return entry

    def _accessor(
        self, index: int, types: tuple[str, ...], components: frozenset[Any]
    ) -> NDArray[np.float64]:
        """The values of an accessor, (count, width).

        components: what the component type and whether it is normalised may be; with quantisation, anything.
        """
        entry = self._accessor_entry(index)
        self._note_unknown(entry, "accessor")
        if entry["type"] not in types:
            raise CorruptError(f"accessor {index} is of type {entry['type']}, expected {' or '.join(types)}")
        component = (entry["componentType"], entry.get("normalized", False))
        if not isinstance(component[1], bool):
            raise CorruptError(f"accessor {index} has a normalized that is neither true nor false")
        if component not in components and (components is _UNSIGNED or _QUANTIZED not in self.required):
            raise CorruptError(f"accessor {index} cannot have the component type {component[0]} here")
        width, kind = _WIDTHS[entry["type"]], np.dtype(_COMPONENTS[entry["componentType"]])
        count = _positive(entry["count"], "count")
        if "bufferView" in entry:
            values = self._view(entry["bufferView"], entry.get("byteOffset", 0), count, width, kind, index)
        else:
            if "sparse" not in entry or count > _MAX_CORNERS:
                raise CorruptError(f"accessor {index} has no data")
            values = np.zeros((count, width), kind)
        if "sparse" in entry:
            values = self._filled(values, entry["sparse"], index)
        if kind.kind == "f" or not entry.get("normalized", False):
            return values.astype(np.float64)
        return np.maximum(values.astype(np.float64) / np.iinfo(kind).max, -1.0)

    def _filled(self, values: NDArray[Any], sparse: dict[str, Any], index: int) -> NDArray[Any]:
        count = _positive(sparse["count"], "count")
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
        _check_index(view_index, views, "bufferView")
        view = views[view_index]
        self._note_unknown(view, "bufferView")
        row = width * kind.itemsize
        stride = _natural(view.get("byteStride", row), "byteStride")
        begin = _natural(view.get("byteOffset", 0), "byteOffset")
        length = _positive(view["byteLength"], "byteLength")
        buffer = self._buffer(view["buffer"])
        if begin + length > len(buffer):
            raise CorruptError(
                f"bufferView {view_index} ends at byte {begin + length}, its buffer at {len(buffer)}"
            )
        offset = _natural(offset, "byteOffset")
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

    def _buffer(self, index: int) -> bytes:
        entries = self.json.get("buffers", [])
        _check_index(index, entries, "buffer")
        if index not in self.buffers:
            self.buffers[index] = self._load_buffer(index, entries[index])
        return self.buffers[index]

    def _load_buffer(self, index: int, entry: dict[str, Any]) -> bytes:
        self._note_unknown(entry, "buffer")
        announced = _positive(entry["byteLength"], "byteLength")
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
        path = self._beside(uri)
        try:
            if not path.is_file():
                raise MissingFileError(f"{uri!r} is not beside the model")
            with path.open("rb") as stream:
                return stream.read(length)
        except OSError as error:
            raise AccessError(f"{uri!r} cannot be read: {error.strerror}") from None

    def _beside(self, uri: str) -> Path:
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


def _matrix(node: dict[str, Any]) -> NDArray[np.float64]:
    """The matrix (4, 4) of a node, from its matrix or its translation, rotation (x, y, z, w) and scale."""
    if "matrix" in node:
        if node.keys() & {"translation", "rotation", "scale"}:
            raise CorruptError("a node has a matrix and another transform besides")
        return _numbers(node["matrix"], 16, "matrix").reshape(4, 4).T
    x, y, z, w = _numbers(node.get("rotation", [0, 0, 0, 1]), 4, "rotation")
    norm = x * x + y * y + z * z + w * w
    if abs(norm - 1.0) > _MAX_ROTATION_ERROR:
        raise CorruptError(f"the rotation {node['rotation']} of a node is no unit quaternion")
    s = 2.0 / norm
    result = np.eye(4)
    result[:3, :3] = [
        [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
        [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
        [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
    ]
    result[:3, :3] *= _numbers(node.get("scale", [1, 1, 1]), 3, "scale")
    result[:3, 3] = _numbers(node.get("translation", [0, 0, 0]), 3, "translation")
    return result


def _numbers(values: object, count: int, name: str) -> NDArray[np.float64]:
    if (
        not isinstance(values, list)
        or len(values) != count
        or not all(type(x) in (int, float) for x in values)
    ):
        raise CorruptError(f"{name} is {str(values)[:60]}, but must be a list of {count} numbers")
    return np.array(values, np.float64)


def _triangles(indices: NDArray[np.int64], mode: int, vertices: int, mesh: object) -> NDArray[np.int64]:
    """Triangles (t, 3) of a primitive; refuses an index beyond its vertices."""
    beyond = np.flatnonzero((indices < 0) | (indices >= vertices))
    if len(beyond):
        corner = int(beyond[0])
        face = corner // 3 if mode == _TRIANGLES else max(corner - 2, 0)
        raise CorruptError(
            f"face {face} (counted from 0) of mesh {mesh!r} has index {indices[corner]}, "
            f"but there are {vertices} vertices"
        )
    if len(indices) < 3 or (mode == _TRIANGLES and len(indices) % 3):
        raise CorruptError(f"mesh {mesh!r} has {len(indices)} indices, which make no triangles")
    if mode == _STRIP:
        return strip_triangles(indices, np.array([len(indices)]))
    if mode == _FAN:
        middle = np.full(len(indices) - 2, indices[0])
        return np.stack([middle, indices[1:-1], indices[2:]], axis=1)
    return indices.reshape(-1, 3)


def _joined(
    values: list[NDArray[np.float64] | None], sizes: list[int], default: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """The values of all parts; `default` where a part has none, None where no part has any."""
    if all(v is None for v in values):
        return None
    width = len(default)
    full = []
    for v, n in zip(values, sizes, strict=True):
        rows = np.tile(default, (n, 1))
        if v is not None:
            rows[:, : v.shape[1]] = v[:, :width]
        full.append(rows)
    return np.concatenate(full)


def _encode_srgb(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear colours as sRGB (IEC 61966-2-1); a fourth column, opacity, stays as it is, and so does what is
    not finite.
    """
    linear = np.where(np.isfinite(linear), np.clip(linear, 0.0, 1.0), np.nan)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    encoded[:, 3:] = linear[:, 3:]
    return encoded


def _check_index(index: object, items: list[Any], name: str) -> None:
    if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(items):
        raise CorruptError(f"{name} {index} does not exist: there are {len(items)}")


def _natural(value: object, name: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise CorruptError(f"{name} is {value!r}, but must be a whole number from 0 on")
    return value


def _positive(value: object, name: str) -> int:
    if _natural(value, name) == 0:
        raise CorruptError(f"{name} is 0, but must be a whole number from 1 on")
    return int(value)  # type: ignore[call-overload, no-any-return]
