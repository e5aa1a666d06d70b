"""glTF 2.0, as JSON with its buffers or as one GLB.

Only what makes a surface is read: nodes with their transforms, triangles, texture coordinates, vertex
colours, names of materials.
Source: Khronos, glTF 2.0 specification, ISO/IEC 12113:2022.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import CorruptError, LimitError, Note, UnsupportedError
from weathercoat.mesh.formats.gltf_document import (
    FLOATS,
    MAX_CORNERS,
    NORMALISED,
    UNSIGNED,
    GltfDocument,
    PlacedNode,
    check_index,
    malformed_is_corrupt,
    natural,
)
from weathercoat.mesh.formats.gltf_materials import read_materials
from weathercoat.mesh.formats.obj import number_groups
from weathercoat.mesh.formats.ply import strip_triangles
from weathercoat.mesh.formats.polygons import Polygons
from weathercoat.mesh.surface import Part

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
# Extensions that put the geometry of a primitive elsewhere.
_ELSEWHERE = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")
# What stays of a node: its name, its place, what hangs below it, and what programs keep there.
_OF_NODES = ("name", "children", "matrix", "translation", "rotation", "scale", "extras")
_SEMANTIC = re.compile(r"POSITION|NORMAL|TANGENT|(TEXCOORD|COLOR|JOINTS|WEIGHTS)_[0-9]+|_.*", re.DOTALL)


@dataclass
class _Parts:
    """What the primitives give, one entry each."""

    positions: list[NDArray[np.float64]] = field(default_factory=list)
    triangles: list[NDArray[np.int64]] = field(default_factory=list)
    uv: list[NDArray[np.float64] | None] = field(default_factory=list)
    colors: list[NDArray[np.float64] | None] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    normals: list[NDArray[np.float64] | None] = field(default_factory=list)
    parts: list[Part] = field(default_factory=list)
    nodes: list[int] = field(default_factory=list)
    corners: int = 0


def read_gltf(data: bytes, folder: Path | None) -> Polygons:
    """The triangles of the default scene, with all transforms applied; mirrored faces are turned back.

    Errors: CorruptError, UnsupportedError, SecurityError, MissingFileError.
    """
    with malformed_is_corrupt():
        document = GltfDocument(data, folder)
        placed = [node for node in document.placed_nodes() if "mesh" in node.entry]
        result = gather_polygons(document, placed)
        result.tree = tuple(
            {key: node[key] for key in _OF_NODES if key in node} for node in document.json.get("nodes", [])
        )
        result.notes += _lost(document) if len(result.sizes) else []
    return result


def gather_polygons(document: GltfDocument, placed: Iterable[PlacedNode]) -> Polygons:
    """The triangles of the meshes of nodes, each under its matrix; those of two nodes are never welded.

    Call it within `malformed_is_corrupt`.
    """
    parts = _Parts()
    for number, node in enumerate(placed):
        _add_mesh(document, parts, number, node)
    if not parts.triangles:
        return Polygons(np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros(0, np.int64), shared=False)
    sizes = [len(p) for p in parts.positions]
    first = np.cumsum(sizes) - sizes
    triangles = np.concatenate([t + f for t, f in zip(parts.triangles, first, strict=True)])
    part = np.repeat(np.arange(len(sizes)), [len(t) for t in parts.triangles])
    face_group, groups = number_groups(part, parts.names)
    corners = triangles.ravel()
    uv = _joined(parts.uv, sizes, np.zeros(2))
    normals = _joined(parts.normals, sizes, np.zeros(3))
    result = Polygons(
        positions=np.concatenate(parts.positions),
        corners=corners,
        sizes=np.full(len(triangles), 3, np.int64),
        uv=None if uv is None else uv[corners],
        face_group=face_group,
        groups=groups,
        colors=_joined(parts.colors, sizes, np.ones(4)),
        normals=None if normals is None else normals[corners],
        face_part=part.astype(np.int32),
        parts=tuple(parts.parts),
        materials=read_materials(document),
        part=np.repeat(parts.nodes, sizes),
        single_precision=True,
        shared=False,
    )
    result.tidy_attributes()
    return result


def _lost(document: GltfDocument) -> list[Note]:
    """Notes on what cannot be kept."""
    targets = sum(bool(p.get("targets")) for m in document.json.get("meshes", []) for p in m["primitives"])
    lost = (
        ("W-SKIN", len(document.json.get("skins", [])), "skins: skinned meshes are read unposed"),
        ("W-ANIMATION", len(document.json.get("animations", [])), "animations cannot be kept"),
        ("W-MORPH", targets, "primitives have morph targets, which cannot be kept"),
    )
    return [Note(code, count, text) for code, count, text in lost if count] + passed_over(document)


def passed_over(document: GltfDocument) -> list[Note]:
    """Notes on pictures that are missing, and on keys of what has been read that glTF does not know."""
    unknown = f"properties that glTF does not know: {', '.join(document.unknown)[:200]}"
    found = (
        ("W-MATERIAL", document.missing_images(), "pictures are not beside the model"),
        ("W-UNKNOWN", len(document.unknown), unknown),
    )
    return [Note(code, count, text) for code, count, text in found if count]


def _add_mesh(document: GltfDocument, parts: _Parts, number: int, placed: PlacedNode) -> None:
    node, matrix = placed.entry, placed.matrix
    check_index(node["mesh"], document.json.get("meshes", []), "mesh")
    mesh = document.json["meshes"][node["mesh"]]
    document.note_unknown(mesh, "mesh")
    if not isinstance(mesh["primitives"], list):
        raise CorruptError("primitives are no list")
    for primitive in mesh["primitives"]:
        document.note_unknown(primitive, "primitive")
        mode = natural(primitive.get("mode", _TRIANGLES), "mode")
        attributes = primitive["attributes"]
        for name in attributes:
            if not _SEMANTIC.fullmatch(name):
                raise CorruptError(f"mesh {mesh.get('name', node['mesh'])!r} has an attribute {name[:40]!r}")
        if mode > _FAN or not attributes:
            raise CorruptError(f"a primitive has mode {mode} and {len(attributes)} attributes")
        if mode < _TRIANGLES:
            continue
        for extension in _ELSEWHERE:
            if extension in primitive.get("extensions", {}) and "bufferView" not in document.accessor_entry(
                attributes["POSITION"]
            ):
                raise UnsupportedError(f"a mesh is stored by the extension {extension}")
        local = document.accessor(attributes["POSITION"], ("VEC3",), FLOATS)
        indices = np.arange(len(local))
        if "indices" in primitive:
            listed = document.accessor(primitive["indices"], ("SCALAR",), UNSIGNED)
            indices = listed.ravel().astype(np.int64)
        triangles = _triangles(indices, mode, len(local), mesh.get("name", node["mesh"]))
        parts.corners += 3 * len(triangles)
        if parts.corners > MAX_CORNERS:
            raise LimitError(f"the instances have more than {MAX_CORNERS // 3} triangles together")
        # Without BLAS, whose results differ in the last bit from machine to machine.
        with np.errstate(invalid="ignore", over="ignore"):
            world = (
                local[:, :1] * matrix[:3, 0] + local[:, 1:2] * matrix[:3, 1] + local[:, 2:] * matrix[:3, 2]
            )
            parts.positions.append(world + matrix[:3, 3])
            mirrored = np.linalg.det(matrix[:3, :3]) < 0
        parts.triangles.append(triangles[:, [0, 2, 1]] if mirrored else triangles)
        parts.names.append(_name(document, primitive, mesh, node))
        parts.parts.append(
            Part(
                str(node.get("name") or mesh.get("name") or "default"),
                primitive.get("material", -1),
                placed.number,
                tuple(matrix.ravel().tolist()),
            )
        )
        parts.nodes.append(number)
        normals = _attribute(document, attributes, "NORMAL", len(local), ("VEC3",))
        parts.normals.append(None if normals is None else _turned(normals, matrix))
        uv = _attribute(document, attributes, "TEXCOORD_0", len(local), ("VEC2",))
        # glTF counts v from the top of the image, a Surface from the bottom, as OBJ does
        parts.uv.append(None if uv is None else np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1))
        colors = _attribute(document, attributes, "COLOR_0", len(local), ("VEC3", "VEC4"))
        parts.colors.append(None if colors is None else _encode_srgb(colors))


def _name(
    document: GltfDocument, primitive: dict[str, Any], mesh: dict[str, Any], node: dict[str, Any]
) -> str:
    names = [mesh.get("name"), node.get("name")]
    if "material" in primitive:
        check_index(primitive["material"], document.json.get("materials", []), "material")
        names.insert(0, document.json["materials"][primitive["material"]].get("name"))
    return next((str(name) for name in names if name), "default")


def _attribute(
    document: GltfDocument, attributes: dict[str, int], name: str, count: int, types: tuple[str, ...]
) -> NDArray[np.float64] | None:
    if name not in attributes:
        return None
    values = document.accessor(attributes[name], types, NORMALISED)
    if len(values) != count:
        raise CorruptError(f"{name} has {len(values)} values for {count} vertices")
    return values


def _turned(normals: NDArray[np.float64], matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normals (n, 3) under a matrix, of any length: by its cofactors, which also serve where it is flat."""
    a, b, c = matrix[:3, :3].T
    with np.errstate(invalid="ignore", over="ignore"):
        turned = (
            normals[:, :1] * np.cross(b, c)
            + normals[:, 1:2] * np.cross(c, a)
            + normals[:, 2:] * np.cross(a, b)
        )
        return turned * np.sign(np.linalg.det(matrix[:3, :3]))


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
