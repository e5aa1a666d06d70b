"""Binary glTF 2.0: writing triangle meshes with linear vertex colours, materials and custom attributes.

Source: Khronos glTF 2.0 specification, sections 3.7.2 (meshes), 3.9 (materials), 4 (GLB).
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from weathercoat import __version__
from weathercoat.mesh.formats.gltf_materials import texture_places
from weathercoat.mesh.materials import SourceMaterial, Texture
from weathercoat.mesh.surface import Indices, Vectors
from weathercoat.output.textures import gltf_picture

FLOAT, UINT32 = 5126, 5125
VERTEX_TARGET, INDEX_TARGET = 34962, 34963


@dataclass(frozen=True)
class Material:
    """A metallic-roughness material; `base_color` is linear RGB and multiplies the vertex colours.

    source: a material of the input that counts instead of all but the name and `double_sided`.
    """

    name: str
    metallic: float
    roughness: float
    double_sided: bool
    base_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    source: SourceMaterial | None = None


@dataclass(frozen=True)
class Sheet:
    """Triangles of one material, k vertices and m faces: a primitive of glTF.

    vertices (k, 3), in the axes of the model; faces (m, 3); normals (k, 3), unit; colors (k, 3), linear RGB
    0 to 1, or None; uv (k, 2), origin at the lower left as in OBJ, or None; scalars: custom attributes
    (k,), whose names begin with an underscore. role: what it is of a snapshot, `film`, `back`, `rim`,
    `substrate` or `untouched`; part: the number in `Surface.parts` of what it is of, or -1; piece: the
    number of a loose piece of film from 1, 0 for what is none.
    """

    material: Material
    vertices: Vectors
    faces: Indices
    normals: Vectors
    colors: Vectors | None = None
    uv: Vectors | None = None
    scalars: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    role: str = ""
    part: int = -1
    piece: int = 0


@dataclass(frozen=True)
class Node:
    """A named node with one mesh. Sheets without faces are left out, since glTF has no empty ones.

    pivot: the point (3,) that the node stands at, and its vertices are about; None for that of the root.
    """

    name: str
    sheets: Sequence[Sheet]
    pivot: Vectors | None = None


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
    materials = MaterialTable(buffer)
    for node in nodes:
        entry: dict[str, Any] = {"name": node.name}
        origin = center if node.pivot is None else node.pivot
        if node.pivot is not None:
            entry["translation"] = [float(x) for x in rotation @ (node.pivot - center)]
        sheets = [sheet for sheet in node.sheets if len(sheet.faces)]
        primitives = []
        for sheet in sheets:
            number = materials.number(sheet.material)
            primitives.append({**buffer.add_sheet(sheet, origin, rotation), "material": number})
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
        materials.add_to(document)
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
        primitive: dict[str, Any] = {"attributes": attributes, "indices": self.add_indices(sheet.faces)}
        if sheet.role:
            primitive["extras"] = {"role": sheet.role, **({"part": sheet.part} if sheet.part >= 0 else {})}
        return primitive

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


class MaterialTable:
    """The materials of a document, with the textures that they show, whose pictures go into the buffer."""

    def __init__(self, buffer: GlbBuffer) -> None:
        self.buffer = buffer
        self.entries: list[dict[str, Any]] = []
        self.textures: list[dict[str, Any]] = []
        self.images: list[dict[str, Any]] = []
        self.samplers: list[dict[str, Any]] = []
        self.extensions: set[str] = set()
        self._pictures: list[bytes] = []
        self._known: list[Material] = []

    def number(self, material: Material) -> int:
        """The number of a material, which is added where it is new."""
        if material not in self._known:
            self._known.append(material)
            self.entries.append(
                material_entry(material) if material.source is None else self._own(material, material.source)
            )
        return self._known.index(material)

    def add_to(self, document: dict[str, Any]) -> None:
        """Put the lists into a document that has none of them."""
        for key in ("textures", "images", "samplers"):
            if getattr(self, key):
                document[key] = getattr(self, key)
        if self.entries:
            document["materials"] = self.entries
        if self.extensions:
            document["extensionsUsed"] = sorted(self.extensions)
        needed = [name for name in sorted(self.extensions) if name.startswith("EXT_texture_")]
        if needed:  # a picture of another format has nothing to fall back on
            document["extensionsRequired"] = needed

    def _own(self, material: Material, source: SourceMaterial) -> dict[str, Any]:
        """A material of the input; textures of other coordinates than the first, which are not kept, go, and
        so do those that cannot be decoded.
        """
        entry: dict[str, Any] = deepcopy(dict(source.entry))
        for holder, key in list(texture_places(entry)):
            place = holder[key]
            transform = place.get("extensions", {}).get("KHR_texture_transform", {})
            coordinates = transform.pop("texCoord", place.pop("texCoord", 0))
            picture = gltf_picture(source.textures[place["index"]].image)
            if coordinates != 0 or picture is None:
                del holder[key]
                continue
            place["index"] = self._texture(source.textures[place["index"]], *picture)
        self.extensions.update(_extensions_of(entry))
        return {**entry, "name": material.name, "doubleSided": material.double_sided}

    def _texture(self, texture: Texture, image: bytes, mime: str) -> int:
        """The number of a texture whose picture is given as glTF holds it."""
        if image not in self._pictures:
            self._pictures.append(image)
            view = self.buffer.add_bytes(image)
            named = {"name": texture.name} if texture.name else {}
            self.images.append({"bufferView": view, "mimeType": mime, **named})
        number = self._pictures.index(image)
        if mime in ("image/png", "image/jpeg"):
            entry: dict[str, Any] = {"source": number}
        else:
            name = f"EXT_texture_{mime.rpartition('/')[2]}"
            self.extensions.add(name)
            entry = {"extensions": {name: {"source": number}}}
        if texture.sampler:
            sampler = dict(texture.sampler)
            if sampler not in self.samplers:
                self.samplers.append(sampler)
            entry["sampler"] = self.samplers.index(sampler)
        if entry not in self.textures:
            self.textures.append(entry)
        return self.textures.index(entry)


def _extensions_of(part: Any) -> Iterator[str]:
    """The extensions that an entry uses."""
    if isinstance(part, dict):
        yield from part.get("extensions", {})
        for key, value in part.items():
            if key != "extras":
                yield from _extensions_of(value)


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
