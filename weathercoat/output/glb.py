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
from numpy.typing import ArrayLike, NDArray

from weathercoat import __version__
from weathercoat.mesh.surface import Indices, Surface, Vectors, vertex_normals

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
class Part:
    """One node with one mesh.

    vertices (n, 3), in the axes of the model; faces (m, 3); normals (n, 3), unit; colors (n, 3), linear RGB 0
    to 1, or None; uv (n, 2), origin at the lower left as in OBJ, or None; scalars: custom attributes (n,),
    their names beginning with an underscore. A part without faces becomes a node without a mesh, since glTF
    has no empty ones.
    """

    name: str
    material: Material
    vertices: Vectors
    faces: Indices
    normals: Vectors
    colors: Vectors | None = None
    uv: Vectors | None = None
    scalars: Mapping[str, NDArray[Any]] = field(default_factory=dict)


def write_glb(
    target: Path | str | BinaryIO,
    parts: Sequence[Part],
    *,
    up: tuple[float, float, float] = (0.0, 1.0, 0.0),
    extras: Mapping[str, Any] | None = None,
) -> None:
    """Write parts as one GLB file to a path or a binary stream.

    glTF is y-up: everything is turned by the smallest rotation that takes `up` there. Positions are 32-bit
    floats about the centre of all parts, which the root node moves back, so that a model far from its origin
    keeps its shape. Raises OSError where the target cannot be written.
    """
    rotation = rotation_to_y(up)
    used = [part.vertices for part in parts if len(part.faces)]
    if used:
        lowest = np.min([vertices.min(axis=0) for vertices in used], axis=0)
        highest = np.max([vertices.max(axis=0) for vertices in used], axis=0)
        center = 0.5 * (lowest + highest)
    else:
        center = np.zeros(3)
    buffer = _Buffer()
    root: dict[str, Any] = {"name": "model", "children": list(range(1, len(parts) + 1))}
    root["translation"] = [float(x) for x in rotation @ center]
    nodes: list[dict[str, Any]] = [root]
    meshes: list[dict[str, Any]] = []
    materials: list[Material] = []
    for part in parts:
        node: dict[str, Any] = {"name": part.name}
        if len(part.faces):
            node["mesh"] = len(meshes)
            if part.material not in materials:
                materials.append(part.material)
            primitive = buffer.add_part(part, center, rotation)
            primitive["material"] = materials.index(part.material)
            meshes.append({"name": part.name, "primitives": [primitive]})
        nodes.append(node)
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": f"weathercoat {__version__}", "extras": dict(extras or {})},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
    }
    if meshes:
        document["meshes"] = meshes
        document["materials"] = [_material_entry(material) for material in materials]
        document["accessors"] = buffer.accessors
        document["bufferViews"] = buffer.views
        document["buffers"] = [{"byteLength": buffer.length}]
    chunks = _frame(document, buffer.pieces)
    if isinstance(target, (str, Path)):
        with Path(target).open("wb") as stream:
            stream.writelines(chunks)
    else:
        target.writelines(chunks)


def surface_parts(surface: Surface) -> list[Part]:
    """One GLB part for each group of the surface that has faces."""
    parts = []
    for number, name in enumerate(surface.groups):
        chosen = surface.face_group == number
        if not chosen.any():
            continue
        group = surface.select_faces(chosen)
        normals = vertex_normals(group.vertices, group.faces)
        faces, source, uv = group.faces, np.arange(len(group.vertices)), None
        if group.uv is not None:
            faces, source, uv = split_at_seams(group)
        colors = None if group.colors is None else srgb_to_linear(group.colors[source, :3])
        shade = 1.0 if colors is not None else 0.5
        material = Material(name, metallic=0.0, roughness=0.6, double_sided=True, base_color=(shade,) * 3)
        parts.append(Part(name, material, group.vertices[source], faces, normals[source], colors, uv))
    return parts


def split_at_seams(surface: Surface) -> tuple[NDArray[np.int32], NDArray[np.intp], NDArray[np.float64]]:
    """Faces (m, 3) over k vertices of one texture coordinate each, the origins of these (k,), their uv (k,
    2)."""
    assert surface.uv is not None
    corners = np.column_stack([surface.faces.reshape(-1), surface.uv.reshape(-1, 2)])
    rows, first, corner = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    source = surface.faces.reshape(-1)[first]
    return corner.reshape(-1, 3).astype(np.int32), source.astype(np.intp), np.ascontiguousarray(rows[:, 1:])


def srgb_to_linear(colors: ArrayLike) -> Vectors:
    """Linear values of sRGB values 0 to 1 (IEC 61966-2-1)."""
    value = np.clip(np.asarray(colors, np.float64), 0.0, 1.0)
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def rotation_to_y(up: tuple[float, float, float]) -> Vectors:
    """The smallest rotation, (3, 3), that takes the unit vector `up` to +y."""
    x, y, z = np.asarray(up, np.float64) / np.linalg.norm(up)
    if y < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    # Rodrigues: v = up × y = (-z, 0, x), R = I + [v] + [v]² / (1 + y)
    cross = np.array([[0.0, -x, 0.0], [x, 0.0, z], [0.0, -z, 0.0]])
    return np.eye(3) + cross + np.einsum("ij,jk->ik", cross, cross) / (1.0 + y)


class _Buffer:
    """The binary chunk in the making, with its views and accessors."""

    def __init__(self) -> None:
        self.pieces: list[bytes] = []
        self.length = 0
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add_part(self, part: Part, center: Vectors, rotation: Vectors) -> dict[str, Any]:
        """Add a part's arrays; the primitive that refers to them."""
        positions = np.einsum("ij,nj->ni", rotation, part.vertices - center)
        normals = np.einsum("ij,nj->ni", rotation, part.normals)
        missing = np.linalg.norm(normals, axis=1) < 0.5
        normals[missing] = (0.0, 1.0, 0.0)
        attributes = {
            "POSITION": self.add(positions, "VEC3", bounds=True),
            "NORMAL": self.add(normals, "VEC3"),
        }
        if part.colors is not None:
            attributes["COLOR_0"] = self.add(part.colors, "VEC3")
        if part.uv is not None:
            attributes["TEXCOORD_0"] = self.add(
                np.array([0.0, 1.0]) + part.uv * np.array([1.0, -1.0]), "VEC2"
            )
        for name, values in part.scalars.items():
            attributes[name] = self.add(values, "SCALAR")
        return {"attributes": attributes, "indices": self.add_indices(part.faces)}

    def add(self, values: NDArray[Any], kind: str, *, bounds: bool = False) -> int:
        """Add 32-bit floats, with their bounds where the format asks for them; the accessor's number."""
        stored = np.ascontiguousarray(values, "<f4")
        accessor = {"componentType": FLOAT, "count": len(stored), "type": kind}
        if bounds:
            accessor["min"] = [float(x) for x in stored.min(axis=0)]
            accessor["max"] = [float(x) for x in stored.max(axis=0)]
        return self._append(stored.tobytes(), VERTEX_TARGET, accessor)

    def add_indices(self, faces: Indices) -> int:
        """Add the corners of faces; the accessor's number."""
        content = np.ascontiguousarray(faces, "<u4").tobytes()
        return self._append(
            content, INDEX_TARGET, {"componentType": UINT32, "count": 3 * len(faces), "type": "SCALAR"}
        )

    def _append(self, content: bytes, target: int, accessor: dict[str, Any]) -> int:
        self.views.append(
            {"buffer": 0, "byteOffset": self.length, "byteLength": len(content), "target": target}
        )
        self.pieces.append(content)
        self.length += len(content)
        self.accessors.append({"bufferView": len(self.views) - 1, **accessor})
        return len(self.accessors) - 1


def _material_entry(material: Material) -> dict[str, Any]:
    return {
        "name": material.name,
        "doubleSided": material.double_sided,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*material.base_color, 1.0],
            "metallicFactor": material.metallic,
            "roughnessFactor": material.roughness,
        },
    }


def _frame(document: dict[str, Any], pieces: list[bytes]) -> list[bytes]:
    """The file: header, JSON chunk padded with spaces, binary chunk, whose pieces are multiples of 4
    bytes."""
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    length = sum(map(len, pieces))
    total = 12 + 8 + len(text) + (8 + length if pieces else 0)
    head = [struct.pack("<4sII", b"glTF", 2, total), struct.pack("<I4s", len(text), b"JSON"), text]
    return head + ([struct.pack("<I4s", length, b"BIN\0"), *pieces] if pieces else [])
