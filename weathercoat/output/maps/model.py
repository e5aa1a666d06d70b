"""The input as it was read, in its baked maps: one GLB that any viewer opens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from weathercoat import __version__
from weathercoat.mesh.surface import Surface, Vectors
from weathercoat.output.glb import GlbBuffer, Material, Sheet, rotation_to_y, write_document
from weathercoat.output.maps.layout import Tile
from weathercoat.output.maps.tangents import Frames
from weathercoat.output.materials import face_materials
from weathercoat.output.sheets import split_corners

SHOWN = ("base_color", "orm", "normal")
_SAMPLER = {"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}


class TilePictures(NamedTuple):
    """A tile with its pictures, PNG of 8 bits, by the names in `SHOWN`."""

    tile: Tile
    pictures: Mapping[str, bytes]


def write_model(path: Path, surface: Surface, frames: Frames, tiles: Sequence[TilePictures]) -> None:
    """Write the surface as GLB, y-up, with a node for each of its parts, a material for each tile, and the
    tangents that its normal maps are written in.

    Raises OSError where the file cannot be written.
    """
    rotation = rotation_to_y(surface.up)
    center = 0.5 * (surface.vertices.min(axis=0) + surface.vertices.max(axis=0))
    buffer = GlbBuffer()
    tile_of, uv = np.zeros(len(surface.faces), np.int32), np.zeros((len(surface.faces), 3, 2))
    for number, (tile, _) in enumerate(tiles):
        tile_of[tile.faces], uv[tile.faces] = number, tile.uv
    names, owner = _parts(surface)
    root: dict[str, Any] = {"name": "model", "translation": [float(x) for x in rotation @ center]}
    nodes: list[dict[str, Any]] = [root]
    meshes: list[dict[str, Any]] = []
    for part, name in enumerate(names):
        primitives = []
        for number in np.unique(tile_of[owner == part]):
            chosen = np.flatnonzero((owner == part) & (tile_of == number))
            sheet, tangents = _sheet(surface, chosen, frames, uv)
            primitive = buffer.add_sheet(sheet, center, rotation)
            turned = np.einsum("ij,nj->ni", rotation, tangents[:, :3])
            primitive["attributes"]["TANGENT"] = buffer.add(np.column_stack([turned, tangents[:, 3]]), "VEC4")
            primitives.append({**primitive, "material": int(number)})
        if primitives:
            nodes.append({"name": name, "mesh": len(meshes)})
            meshes.append({"name": name, "primitives": primitives})
    root["children"] = list(range(1, len(nodes)))
    images: list[dict[str, Any]] = []
    materials = [_material(surface, each, buffer, images) for each in tiles]
    write_document(
        path,
        {
            "asset": {"version": "2.0", "generator": f"weathercoat {__version__}"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": nodes,
            "meshes": meshes,
            "materials": materials,
            "textures": [{"sampler": 0, "source": i} for i in range(len(images))],
            "images": images,
            "samplers": [_SAMPLER],
            "accessors": buffer.accessors,
            "bufferViews": buffer.views,
            "buffers": [{"byteLength": buffer.length}],
        },
        buffer.pieces,
    )


def _parts(surface: Surface) -> tuple[list[str], Any]:
    """Names of the parts of a surface, or of its groups, and the number of each face's."""
    if surface.face_part is not None and surface.parts:
        return [part.name for part in surface.parts], surface.face_part
    return list(surface.groups), surface.face_group


def _sheet(surface: Surface, chosen: Any, frames: Frames, uv: Vectors) -> tuple[Sheet, Vectors]:
    """The chosen faces (k,) as a sheet, and the tangents of its vertices with their handedness, (n, 4)."""
    part = surface.select_faces(np.isin(np.arange(len(surface.faces)), chosen))
    signs = np.repeat(frames.signs[chosen], 3).reshape(-1, 3, 1)
    each = np.concatenate([frames.normals[chosen], uv[chosen], frames.tangents[chosen], signs], axis=2)
    faces, source, values = split_corners(part.faces, each, len(part.vertices))
    unused = Material("", metallic=1.0, roughness=1.0, double_sided=True)
    sheet = Sheet(unused, part.vertices[source], faces, normals=values[:, :3], uv=values[:, 3:5])
    return sheet, _upright(values[:, 5:8], values[:, :3], values[:, 8])


def _upright(tangents: Vectors, normals: Vectors, signs: Vectors) -> Vectors:
    """Unit tangents at right angles to the normals, whatever these are where there are none, (n, 4)."""
    along = tangents - np.einsum("ij,ij->i", tangents, normals)[:, None] * normals
    spare = np.where(np.abs(normals[:, :1]) < 0.7, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    spare = np.cross(normals, spare)
    lacking = np.linalg.norm(along, axis=1) < 1e-6
    along[lacking] = spare[lacking]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = np.divide(along, length, out=np.tile([1.0, 0.0, 0.0], (len(along), 1)), where=length > 0.0)
    return np.column_stack([along, signs])


def _material(
    surface: Surface, tile: TilePictures, buffer: GlbBuffer, images: list[dict[str, Any]]
) -> dict[str, Any]:
    """The material of a tile, named as the only one of the input there, or else as its set of maps."""
    used = np.unique(face_materials(surface)[tile.tile.faces])
    name = tile.tile.name or "paint"
    if len(used) == 1 and used[0] >= 0:
        name = surface.materials[used[0]].name
    first = len(images)
    for kind in SHOWN:
        images.append(
            {"name": kind, "mimeType": "image/png", "bufferView": buffer.add_bytes(tile.pictures[kind])}
        )
    return {
        "name": name,
        "doubleSided": True,
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": first},
            "metallicRoughnessTexture": {"index": first + 1},
        },
        "occlusionTexture": {"index": first + 1},
        "normalTexture": {"index": first + 2},
    }
