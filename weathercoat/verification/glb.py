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
    (m, 3); bounds float64 (2, 3), what the accessor of the positions says is their minimum and maximum. role:
    what of a snapshot it is; part: the number of the model's part, or -1; matrix float64 (4, 4): from its
    node to the scene.
    """

    material: str
    attributes: dict[str, NDArray[np.float32]]
    indices: NDArray[np.uint32]
    bounds: NDArray[np.float64]
    role: str
    part: int
    matrix: NDArray[np.float64]

    def placed(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The positions (n, 3) in the scene, and how far the rounding of those stored can move each."""
        stored = self.attributes["POSITION"].astype(np.float64)
        linear = self.matrix[:3, :3]
        return (
            np.einsum("ij,nj->ni", linear, stored) + self.matrix[:3, 3],
            np.einsum("ij,nj->ni", np.abs(linear), np.abs(stored)),
        )

    @property
    def is_mirrored(self) -> bool:
        """Whether the scene shows its faces the other way round."""
        return bool(np.linalg.det(self.matrix[:3, :3]) < 0.0)


@dataclass(frozen=True)
class Glb:
    """step and age of `asset.extras`; primitives, those of the scene in the order of its nodes."""

    step: int
    age: float
    primitives: tuple[Primitive, ...]

    def of_role(self, role: str) -> tuple[Primitive, ...]:
        """The primitives of a role: film, back, rim, substrate, or another."""
        return tuple(primitive for primitive in self.primitives if primitive.role == role)


def read_glb(content: bytes) -> Glb:
    """A GLB file as a run writes it; raises BrokenFileError."""
    text, binary = _chunks(content)
    document = read_object(text)
    if take(document, "asset.version", str) != "2.0":
        raise BrokenFileError("is no glTF 2.0")
    if take(document, "buffers.0.byteLength", int, 0) != len(binary):
        raise BrokenFileError(f"its buffer is not the {len(binary):,} bytes of the binary chunk")
    primitives: list[Primitive] = []
    for node, matrix in _placed_nodes(document):
        if "mesh" in node:
            mesh = take(document, f"meshes.{take(node, 'mesh', int)}", dict)
            primitives += [
                _primitive(document, binary, entry, matrix) for entry in take(mesh, "primitives", list)
            ]
    return Glb(
        step=take(document, "asset.extras.step", int),
        age=take(document, "asset.extras.age", float),
        primitives=tuple(primitives),
    )


def _placed_nodes(document: dict[str, Any]) -> list[tuple[dict[str, Any], NDArray[np.float64]]]:
    """The nodes of the scene with their matrices to it, parents before children."""
    count = len(take(document, "nodes", list))
    tops = take(document, f"scenes.{take(document, 'scene', int)}.nodes", list)
    waiting = [(number, np.eye(4)) for number in reversed(tops)]
    placed: list[tuple[dict[str, Any], NDArray[np.float64]]] = []
    while waiting:
        number, outer = waiting.pop()
        if not isinstance(number, int) or not 0 <= number < count or len(placed) == count:
            raise BrokenFileError("its nodes are no tree")
        node = take(document, f"nodes.{number}", dict)
        matrix = outer @ _matrix(node)
        placed.append((node, matrix))
        waiting += [(child, matrix) for child in reversed(take(node, "children", list, []))]
    return placed


def _matrix(node: dict[str, Any]) -> NDArray[np.float64]:
    """The matrix of a node: its own, or of its translation, rotation and scale."""
    if "matrix" in node:
        return _numbers(node["matrix"], 16).reshape(4, 4).T
    x, y, z, w = _numbers(node.get("rotation", [0, 0, 0, 1]), 4)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = turn * _numbers(node.get("scale", [1, 1, 1]), 3)
    matrix[:3, 3] = _numbers(node.get("translation", [0, 0, 0]), 3)
    return matrix


def _numbers(values: object, count: int) -> NDArray[np.float64]:
    if not isinstance(values, list) or len(values) != count or not all(map(is_number, values)):
        raise BrokenFileError(f"a node is moved by no {count} numbers")
    return np.array(values, np.float64)


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


def _primitive(
    document: dict[str, Any], binary: memoryview, entry: object, matrix: NDArray[np.float64]
) -> Primitive:
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
    return Primitive(
        material,
        attributes,
        indices.reshape(-1, 3),
        np.array(bounds, np.float64),
        role=take(entry, "extras.role", str, ""),
        part=take(entry, "extras.part", int, -1),
        matrix=matrix,
    )


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
