"""Reading the GLB files of a run: nodes, their primitives, and the arrays of those.

A reader of its own. Source: Khronos glTF 2.0 specification, sections 3.6 (binary data) and 4 (GLB).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.verification.fields import is_number, read_object, take
from weathercoat.verification.findings import BrokenFileError

_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}
_KINDS = {5126: np.dtype("<f4"), 5125: np.dtype("<u4")}
_ATTRIBUTE_TYPES = {"POSITION": "VEC3", "NORMAL": "VEC3", "COLOR_0": "VEC3", "TEXCOORD_0": "VEC2"}


@dataclass(frozen=True)
class Primitive:
    """Triangles of one material: attributes by their names, float32 (n,), (n, 2) or (n, 3); indices uint32
    (m, 3); bounds float64 (2, 3), what the accessor of the positions says is their minimum and maximum.
    """

    material: str
    attributes: dict[str, NDArray[np.float32]]
    indices: NDArray[np.uint32]
    bounds: NDArray[np.float64]


@dataclass(frozen=True)
class Glb:
    """step and age of `asset.extras`; translation (3,) of the node `model`; nodes below it by name, each
    with its primitives."""

    step: int
    age: float
    translation: NDArray[np.float64]
    nodes: tuple[tuple[str, tuple[Primitive, ...]], ...]

    def primitives(self, name: str) -> tuple[Primitive, ...]:
        """The primitives of the first node of a name; none where it has no mesh."""
        return next((primitives for node, primitives in self.nodes if node == name), ())


def read_glb(content: bytes) -> Glb:
    """A GLB file as a run writes it; raises BrokenFileError."""
    text, binary = _chunks(content)
    document = read_object(text)
    if take(document, "asset.version", str) != "2.0":
        raise BrokenFileError("is no glTF 2.0")
    if take(document, "buffers.0.byteLength", int, 0) != len(binary):
        raise BrokenFileError(f"its buffer is not the {len(binary):,} bytes of the binary chunk")
    root = take(document, f"scenes.{take(document, 'scene', int)}.nodes.0", int)
    model = take(document, f"nodes.{root}", dict)
    translation = take(model, "translation", list)
    if len(translation) != 3 or not all(map(is_number, translation)):
        raise BrokenFileError("the node model is moved by no three numbers")
    nodes = []
    for number in take(model, "children", list):
        node = take({"nodes": take(document, "nodes", list)}, f"nodes.{number}", dict)
        name = take(node, "name", str)
        primitives: list[Primitive] = []
        if "mesh" in node:
            mesh = take(document, f"meshes.{take(node, 'mesh', int)}", dict)
            primitives += [_primitive(document, binary, entry) for entry in take(mesh, "primitives", list)]
        nodes.append((name, tuple(primitives)))
    return Glb(
        step=take(document, "asset.extras.step", int),
        age=take(document, "asset.extras.age", float),
        translation=np.array(translation, np.float64),
        nodes=tuple(nodes),
    )


def _chunks(content: bytes) -> tuple[bytes, memoryview]:
    """The JSON chunk and the binary chunk, which may be missing."""
    if len(content) < 20:
        raise BrokenFileError("no GLB")
    magic, version, total, length, kind = struct.unpack_from("<4sIII4s", content)
    if magic != b"glTF" or version != 2 or kind != b"JSON":
        raise BrokenFileError("no GLB of version 2")
    if total != len(content):
        raise BrokenFileError(f"its header says {total:,} bytes, the file holds {len(content):,}")
    start = 20 + length
    if start == total:
        return content[20:], memoryview(b"")
    if length % 4 or start + 8 > total:
        raise BrokenFileError(f"its JSON chunk of {length:,} bytes does not fit")
    size, kind = struct.unpack_from("<I4s", content, start)
    if kind != b"BIN\0" or size % 4 or start + 8 + size != total:
        raise BrokenFileError(f"its binary chunk of {size:,} bytes does not fit")
    return content[20:start], memoryview(content)[start + 8 :]


def _primitive(document: dict[str, Any], binary: memoryview, entry: object) -> Primitive:
    attributes = {}
    numbers = take(entry, "attributes", dict)
    for name in numbers:
        expected = _ATTRIBUTE_TYPES.get(name, "SCALAR")
        attributes[name] = _array(document, binary, take(numbers, name, int), "<f4", expected)
    if "POSITION" not in attributes or len(set(map(len, attributes.values()))) != 1:
        raise BrokenFileError("a primitive's attributes are not all of one length")
    indices = _array(document, binary, take(entry, "indices", int), "<u4", "SCALAR")
    if len(indices) % 3 or take(entry, "mode", int, 4) != 4:
        raise BrokenFileError("a primitive is not made of triangles")
    accessor = take(document, f"accessors.{numbers['POSITION']}", dict)
    bounds = [take(accessor, "min", list), take(accessor, "max", list)]
    if any(len(bound) != 3 or not all(map(is_number, bound)) for bound in bounds):
        raise BrokenFileError("an accessor of positions has no bounds")
    material = take(document, f"materials.{take(entry, 'material', int)}.name", str)
    return Primitive(material, attributes, indices.reshape(-1, 3), np.array(bounds, np.float64))


def _array(document: dict[str, Any], binary: memoryview, number: int, kind: str, shape: str) -> NDArray[Any]:
    """The array of an accessor, a view of the binary chunk."""
    name = f"accessors.{number}"
    accessor = take(document, name, dict)
    view = take(document, f"bufferViews.{take(accessor, 'bufferView', int)}", dict)
    stored = _KINDS.get(take(accessor, "componentType", int))
    if stored != np.dtype(kind) or take(accessor, "type", str) != shape:
        raise BrokenFileError(f"{name} holds not what it is used for")
    count, width = take(accessor, "count", int), _WIDTHS[shape]
    inner = take(accessor, "byteOffset", int, 0)
    start, length = take(view, "byteOffset", int, 0), take(view, "byteLength", int)
    size = count * width * stored.itemsize
    fits = count >= 1 and inner >= 0 and start >= 0 and length >= 0
    if not fits or inner + size > length or start + length > len(binary) or (start + inner) % 4:
        raise BrokenFileError(f"{name} with {count:,} entries does not lie in the {len(binary):,} bytes")
    if "byteStride" in view or "sparse" in accessor or take(view, "buffer", int) != 0:
        raise BrokenFileError(f"{name} is laid out as no run writes it")
    found: NDArray[Any] = np.frombuffer(binary, stored, count * width, start + inner)
    return found.reshape(count, width) if width > 1 else found
