"""A model's parts as one GLB: the nodes that it had, with their names, transforms and children, and new
meshes.

Each node that showed faces gets a mesh of the sheets of its parts, in the axes of the node. Models of formats
without nodes get a node for each object. Where an axis other than y points up, or positions lie so far from
their node's origin that 32 bits would be coarse, a node above or below moves them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from weathercoat import __version__
from weathercoat.mesh.surface import Surface, Vectors
from weathercoat.output.glb import (
    GlbBuffer,
    Material,
    MaterialTable,
    Sheet,
    rotation_to_y,
    write_document,
)
from weathercoat.output.sheets import METAL_CREASE, make_sheet, srgb_to_linear

_FAR = 16.0  # diagonals from the origin beyond which vertices are held about their centre: it costs 4 bits
_FLAT = 1e-12  # of the largest singular value: nodes flatter than this have no axes of their own


def part_sheets(surface: Surface) -> list[Sheet]:
    """A sheet for each part of a surface that carries no film, in its own material or else a neutral grey."""
    if surface.face_part is None or not surface.parts:
        return []
    sheets = []
    for number in np.unique(surface.face_part).tolist():
        own = surface.select_faces(surface.face_part == number)
        part = surface.parts[number]
        source = surface.materials[part.material] if part.material >= 0 else None
        name = part.name if source is None else source.name
        shade = 1.0 if own.colors is not None else 0.5
        sheets.append(
            make_sheet(
                Material(
                    name,
                    0.0,
                    0.6,
                    double_sided=True,
                    base_color=(shade,) * 3,
                    source=source if source is not None and source.entry else None,
                ),
                own.vertices,
                own.faces,
                crease=METAL_CREASE,
                colors=None if own.colors is None else srgb_to_linear(own.colors[:, :3]),
                uv=own.uv,
                normals=own.normals,
                role="untouched",
                part=number,
            )
        )
    return sheets


def write_parts_glb(
    target: Path | str | BinaryIO,
    surface: Surface,
    sheets: Sequence[Sheet],
    *,
    up: tuple[float, float, float],
    extras: Mapping[str, Any] | None = None,
) -> None:
    """Write sheets, each of a part of `surface`, as one GLB with the nodes of the model.

    up: the model's axis against gravity, which is turned to glTF's +y. Raises OSError where the target cannot
    be written.
    """
    buffer = GlbBuffer()
    materials = MaterialTable(buffer)
    nodes, tops, shown, frames = _tree(surface)
    meshes: list[dict[str, Any]] = []
    for number, parts in shown.items():
        own = [sheet for sheet in sheets if sheet.part in parts and len(sheet.faces)]
        if own:
            frame = frames[number]
            singular = np.linalg.svd(frame[:3, :3], compute_uv=False)
            if singular[2] <= _FLAT * singular[0]:
                # nothing that is flattened can be brought back: it hangs beside the node, where it is seen
                name = f"{nodes[number].get('name', 'node')} flattened"
                number, frame = len(nodes), np.eye(4)
                nodes.append({"name": name})
                tops.append(number)
            _show(nodes, number, own, frame, buffer, materials, meshes)
    if up != (0.0, 1.0, 0.0):
        upright = np.eye(4)
        upright[:3, :3] = rotation_to_y(up)
        nodes.append({"name": "upright", "matrix": upright.T.ravel().tolist(), "children": tops})
        tops = [len(nodes) - 1]
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": f"weathercoat {__version__}", "extras": dict(extras or {})},
        "scene": 0,
        "scenes": [{"name": surface.name, "nodes": tops}],
        "nodes": nodes,
        "meshes": meshes,
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": buffer.length}],
    }
    materials.add_to(document)
    write_document(target, {key: value for key, value in document.items() if value != []}, buffer.pieces)


_Tree = tuple[list[dict[str, Any]], list[int], dict[int, list[int]], dict[int, Vectors]]


def _tree(surface: Surface) -> _Tree:
    """Nodes, the numbers of the top ones, the parts that each node shows, and its matrix to the model's
    axes.
    """
    shown: dict[int, list[int]] = {}
    frames: dict[int, Vectors] = {}
    if surface.tree:
        nodes = [dict(node) for node in surface.tree]
        below = {child for node in nodes for child in node.get("children", [])}
        tops = [number for number in range(len(nodes)) if number not in below]
        for number, part in enumerate(surface.parts):
            shown.setdefault(part.node, []).append(number)
            frames[part.node] = np.reshape(part.matrix, (4, 4))
        return nodes, tops, shown, frames
    names: dict[str, int] = {}
    for number, part in enumerate(surface.parts):
        shown.setdefault(names.setdefault(part.name, len(names)), []).append(number)
    nodes = [{"name": name} for name in names]
    return nodes, list(range(len(nodes))), shown, dict.fromkeys(range(len(nodes)), np.eye(4))


def _show(
    nodes: list[dict[str, Any]],
    number: int,
    sheets: Sequence[Sheet],
    frame: Vectors,
    buffer: GlbBuffer,
    materials: MaterialTable,
    meshes: list[dict[str, Any]],
) -> None:
    """Let a node show sheets that are given in the model's axes."""
    node = nodes[number]
    back: Vectors = np.linalg.inv(frame).astype(np.float64)
    local = [_localised(sheet, back, frame[:3, :3]) for sheet in sheets]
    low = np.min([sheet.vertices.min(axis=0) for sheet in local], axis=0)
    high = np.max([sheet.vertices.max(axis=0) for sheet in local], axis=0)
    center: Vectors = 0.5 * (low + high)
    if np.linalg.norm(center) > _FAR * np.linalg.norm(high - low):
        node["children"] = [*node.get("children", []), len(nodes)]
        nodes.append({"translation": center.tolist(), "mesh": len(meshes)})
    else:
        center = np.zeros(3)
        node["mesh"] = len(meshes)
    primitives = [
        {**buffer.add_sheet(sheet, center), "material": materials.number(sheet.material)} for sheet in local
    ]
    meshes.append({"name": str(node.get("name", f"mesh_{len(meshes)}")), "primitives": primitives})


def _localised(sheet: Sheet, back: Vectors, linear: Vectors) -> Sheet:
    """A sheet in the axes of a node: `back` (4, 4) leads there, `linear` (3, 3) is the node's own matrix."""
    if (back == np.eye(4)).all():
        return sheet
    normals = np.einsum("ni,ij->nj", sheet.normals, linear)  # by the transpose of what normals turn with
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    mirrored = np.linalg.det(linear) < 0.0
    return replace(
        sheet,
        vertices=np.einsum("ij,nj->ni", back[:3, :3], sheet.vertices) + back[:3, 3],
        normals=np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0),
        faces=sheet.faces[:, [0, 2, 1]] if mirrored else sheet.faces,
    )
