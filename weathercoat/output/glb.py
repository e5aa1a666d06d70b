"""Binary glTF 2.0: writing triangle meshes with linear vertex colours, materials and custom attributes.

Source: Khronos glTF 2.0 specification, sections 3.7.2 (meshes), 3.9 (materials), 4 (GLB).
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from weathercoat import __version__
from weathercoat.mesh.surface import Indices, Vectors

FLOAT, UINT32 = 5126, 5125
VERTEX_TARGET, INDEX_TARGET = 34962, 34963


@dataclass(frozen=True)
class Material:
    """A metallic-roughness material; `base_color` is linear RGB and multiplies the vertex colours."""

    name: str
    metallic: float
    roughness: float
    double_sided: bool
    base_color: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Sheet:
    """Triangles of one material, k vertices and m faces: a primitive of glTF.

    vertices (k, 3), in the axes of the model; faces (m, 3); normals (k, 3), unit; colors (k, 3), linear RGB 0
    to 1, or None; uv (k, 2), origin at the lower left as in OBJ, or None; scalars: custom attributes (k,),
    whose names begin with an underscore.
    """

    material: Material
    vertices: Vectors
    faces: Indices
    normals: Vectors
    colors: Vectors | None = None
    uv: Vectors | None = None
    scalars: Mapping[str, NDArray[Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class Node:
    """A named node with one mesh. Sheets without faces are left out, since glTF has no empty ones."""

    name: str
    sheets: Sequence[Sheet]


def write_glb(
    target: Path | str | BinaryIO,
    nodes: Sequence[Node],
    *,
    up: tuple[float, float, float] = (0.0, 1.0, 0.0),
    extras: Mapping[str, Any] | None = None,
) -> None:
    """Write nodes as one GLB file to a path or a binary stream.

    glTF is y-up: everything is turned by the smallest rotation that takes `up` there. Positions are 32-bit
    floats about the centre of all vertices, to which the root node moves them, so that a model far from its
    origin keeps its shape. Raises OSError where the target cannot be written.
    """
    rotation = rotation_to_y(up)
    center = _center([sheet.vertices for node in nodes for sheet in node.sheets if len(sheet.faces)])
    buffer = GlbBuffer()
    root: dict[str, Any] = {"name": "model", "translation": [float(x) for x in rotation @ center]}
    entries: list[dict[str, Any]] = [root]
    meshes: list[dict[str, Any]] = []
    materials: list[Material] = []
    for node in nodes:
        entry: dict[str, Any] = {"name": node.name}
        sheets = [sheet for sheet in node.sheets if len(sheet.faces)]
        primitives = []
        for sheet in sheets:
            if sheet.material not in materials:
                materials.append(sheet.material)
            primitives.append(
                {**buffer.add_sheet(sheet, center, rotation), "material": materials.index(sheet.material)}
            )
        if primitives:
            entry["mesh"] = len(meshes)
            meshes.append({"name": node.name, "primitives": primitives})
        entries.append(entry)
    if nodes:
        root["children"] = list(range(1, len(entries)))
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": f"weathercoat {__version__}", "extras": dict(extras or {})},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": entries,
    }
    if meshes:
        document["meshes"] = meshes
        document["materials"] = [material_entry(material) for material in materials]
        document["accessors"] = buffer.accessors
        document["bufferViews"] = buffer.views
        document["buffers"] = [{"byteLength": buffer.length}]
    write_document(target, document, buffer.pieces)


def rotation_to_y(up: tuple[float, float, float]) -> Vectors:
    """The smallest rotation (3, 3) of `up` to +y, after half a turn about x where it points down."""
    x, y, z = np.asarray(up, np.float64) / np.linalg.norm(up)
    if y < 0.0:
        return rotation_to_y((x, -y, -z)) * (1.0, -1.0, -1.0)
    # Rodrigues: v = up × y = (-z, 0, x), R = I + [v] + [v]² / (1 + y)
    cross = np.array([[0.0, -x, 0.0], [x, 0.0, z], [0.0, -z, 0.0]])
    return np.eye(3) + cross + np.einsum("ij,jk->ik", cross, cross) / (1.0 + y)


def _center(clouds: list[Vectors]) -> Vectors:
    """Centre of the bounding box of all points; the origin where there are none."""
    if not clouds:
        return np.zeros(3)
    lowest = np.min([points.min(axis=0) for points in clouds], axis=0)
    highest = np.max([points.max(axis=0) for points in clouds], axis=0)
    return 0.5 * (lowest + highest)


class GlbBuffer:
    """The binary chunk in the making, with its views and accessors: pieces of a multiple of 4 bytes each."""

    def __init__(self) -> None:
        self.pieces: list[bytes] = []
        self.length = 0
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add_sheet(self, sheet: Sheet, center: Vectors, rotation: Vectors | None = None) -> dict[str, Any]:
        """Add a sheet's arrays about `center` (3,), turned by `rotation` (3, 3); the primitive that refers
        to them, without its material.
        """
        turn = np.eye(3) if rotation is None else rotation
        normals = np.einsum("ij,nj->ni", turn, sheet.normals)
        normals[np.linalg.norm(normals, axis=1) < 0.5] = (0.0, 1.0, 0.0)
        positions = np.einsum("ij,nj->ni", turn, sheet.vertices - center)
        attributes = {
            "POSITION": self.add(positions, "VEC3", bounds=True),
            "NORMAL": self.add(normals, "VEC3"),
        }
        if sheet.colors is not None:
            attributes["COLOR_0"] = self.add(sheet.colors, "VEC3")
        if sheet.uv is not None:
            attributes["TEXCOORD_0"] = self.add(sheet.uv * (1.0, -1.0) + (0.0, 1.0), "VEC2")
        for name, values in sheet.scalars.items():
            attributes[name] = self.add(values, "SCALAR")
        return {"attributes": attributes, "indices": self.add_indices(sheet.faces)}

    def add(
        self, values: NDArray[Any], kind: str, *, bounds: bool = False, target: int | None = VERTEX_TARGET
    ) -> int:
        """Add 32-bit floats, with their bounds where the format asks for them; the accessor's number.

        target: None for what belongs to no vertices.
        """
        stored = np.ascontiguousarray(values, "<f4")
        accessor = {"componentType": FLOAT, "count": len(stored), "type": kind}
        if bounds:
            accessor["min"] = [float(x) for x in stored.min(axis=0)]
            accessor["max"] = [float(x) for x in stored.max(axis=0)]
        return self._append(stored.tobytes(), target, accessor)

    def add_indices(self, faces: Indices) -> int:
        """Add the corners of faces; the accessor's number."""
        content = np.ascontiguousarray(faces, "<u4").tobytes()
        return self._append(
            content, INDEX_TARGET, {"componentType": UINT32, "count": 3 * len(faces), "type": "SCALAR"}
        )

    def add_bytes(self, content: bytes, **view: Any) -> int:
        """Add bytes with a view of them, which gets the other entries given; the view's number."""
        self.views.append({**view, "buffer": 0, "byteOffset": self.length, "byteLength": len(content)})
        padded = content + bytes(-len(content) % 4)
        self.pieces.append(padded)
        self.length += len(padded)
        return len(self.views) - 1

    def _append(self, content: bytes, target: int | None, accessor: dict[str, Any]) -> int:
        view = self.add_bytes(content) if target is None else self.add_bytes(content, target=target)
        self.accessors.append({"bufferView": view, **accessor})
        return len(self.accessors) - 1


def material_entry(material: Material) -> dict[str, Any]:
    """A material as glTF has it."""
    return {
        "name": material.name,
        "doubleSided": material.double_sided,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*material.base_color, 1.0],
            "metallicFactor": material.metallic,
            "roughnessFactor": material.roughness,
        },
    }


def write_document(target: Path | str | BinaryIO, document: Mapping[str, Any], pieces: list[bytes]) -> None:
    """Write a document and the pieces of its binary chunk as GLB; raises OSError.

    The header and the JSON, padded with spaces, come first; pieces are multiples of 4 bytes.
    """
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    length = sum(map(len, pieces))
    total = 12 + 8 + len(text) + (8 + length if pieces else 0)
    chunks = [struct.pack("<4sII", b"glTF", 2, total), struct.pack("<I4s", len(text), b"JSON"), text]
    chunks += [struct.pack("<I4s", length, b"BIN\0"), *pieces] if pieces else []
    if isinstance(target, (str, Path)):
        with Path(target).open("wb") as stream:
            stream.writelines(chunks)
    else:
        target.writelines(chunks)
