"""The aged scene as one GLB, which loads as the input did: the same nodes, names, transforms and cameras.

A node whose object was aged shows the mesh of its variant instead of its own; nothing else about it changes.
Objects of one variant share one mesh. What was read from YAML has a node for each object.

Vertices are 32-bit floats. Where a mesh lies so far from its own origin that these would be coarse, its
node gets a child that holds the mesh about its centre and moves it back; the node's own transform is never
touched.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from weathercoat import __version__
from weathercoat.mesh.formats.gltf_document import malformed_is_corrupt
from weathercoat.mesh.surface import Surface, Vectors
from weathercoat.output.folder import whole_file
from weathercoat.output.glb import GlbBuffer, Material, Sheet, material_entry, rotation_to_y, write_document
from weathercoat.output.sheets import surface_nodes
from weathercoat.output.snapshots import film_sheets, metal_sheets
from weathercoat.scene.camera_node import add_camera
from weathercoat.scene.graph import AgedMesh, Scene, SceneObject, place
from weathercoat.scene.read_glb import instance_matrices
from weathercoat.scene.retained import INSTANCING, retain

# Distance from the origin, in diagonals, beyond which vertices are held about their centre: it costs 4 bits.
_FAR = 16.0
_SECONDS_BETWEEN_VIEWS = 1.0


def write_scene(
    target: Path | str | BinaryIO,
    scene: Scene,
    aged: Mapping[str, str],
    films: Mapping[str, AgedMesh],
    *,
    overwrite: bool = False,
) -> None:
    """Write the scene as GLB to a path, where it appears once it is whole, or to a binary stream.

    aged: the variant that each object shows, by the object's name; objects that are not in it stay as they
    are. films: the variants, each asked for once, so that the mapping may read them from files. Objects of
    YAML files that stay as they are keep their vertex colours or are grey, since their textures are not read.

    Raises OutputExistsError, OutputError; KeyError for a variant that is not there.
    """
    if isinstance(target, (str, Path)):
        with whole_file(target, overwrite=overwrite) as stream:
            write_scene(stream, scene, aged, films)
        return
    writer = _Writer(scene, dict(aged), films)
    document = writer.of_objects() if scene.source is None else writer.of_source()
    document["asset"]["generator"] = f"weathercoat {__version__}"
    for key, values in (
        ("accessors", writer.buffer.accessors),
        ("bufferViews", writer.buffer.views),
        ("materials", writer.materials),
    ):
        if values:
            document[key] = values
    document["buffers"] = [{"byteLength": writer.buffer.length}]
    write_document(target, document, writer.buffer.pieces)


@dataclass
class _Shown:
    """A mesh of the output: its number, and where the centre that it is stored about lies, or None."""

    number: int
    center: Vectors | None


@dataclass
class _Writer:
    scene: Scene
    aged: dict[str, str]
    films: Mapping[str, AgedMesh]
    buffer: GlbBuffer = field(default_factory=GlbBuffer)
    materials: list[dict[str, Any]] = field(default_factory=list)
    meshes: list[dict[str, Any]] = field(default_factory=list)
    shown: dict[str, _Shown] = field(default_factory=dict)
    unaged: dict[str, _Shown] = field(default_factory=dict)
    own_materials: dict[str, int] = field(default_factory=dict)

    def of_source(self) -> dict[str, Any]:
        """The document that the scene was read from, with the meshes of variants."""
        source = self.scene.source
        assert source is not None
        placed: dict[int, list[SceneObject]] = {}
        for thing in self.scene.objects:
            if thing.node is not None:
                placed.setdefault(thing.node, []).append(thing)
        replaced = {n for n, things in placed.items() if all(t.name in self.aged for t in things)}
        entries = source.json.get("nodes", [])
        shown = [node["mesh"] for n, node in enumerate(entries) if "mesh" in node and n not in replaced]
        with malformed_is_corrupt():
            document = retain(source, self.buffer, shown)
        self.meshes = document["meshes"]
        self.materials = document.pop("materials", [])
        self.own_materials = _named_once(self.materials)
        for n, things in placed.items():
            if any(t.name in self.aged for t in things):
                self._dress(document, n, things)
        if not self.meshes:
            del document["meshes"]
        _drop_instancing(document)
        return document

    def _dress(self, document: dict[str, Any], number: int, things: Sequence[SceneObject]) -> None:
        """Give the objects of a node the meshes of their variants."""
        nodes = document["nodes"]
        node = nodes[number]
        variants = {self.aged.get(thing.name) for thing in things}
        if things[0].instance is None:
            del node["mesh"]
            self._show(nodes, node, self._variant(self.aged[things[0].name]))
            return
        if len(variants) == 1:
            one = self._variant(self.aged[things[0].name])
            if one.center is None:
                node["mesh"] = one.number
                return
        source = self.scene.source
        assert source is not None
        own = node.pop("mesh", None)
        attributes = source.json["nodes"][number]["extensions"][INSTANCING]["attributes"]
        del node["extensions"][INSTANCING]
        if not node["extensions"]:
            del node["extensions"]
        for thing, matrix in zip(things, instance_matrices(source, attributes), strict=True):
            child = {
                "name": f"{node.get('name', 'instance')}/{thing.instance}",
                "matrix": _column_major(matrix),
            }
            node.setdefault("children", []).append(len(nodes))
            nodes.append(child)
            if thing.name in self.aged:
                self._show(nodes, child, self._variant(self.aged[thing.name]))
            else:
                child["mesh"] = own

    def of_objects(self) -> dict[str, Any]:
        """A document with a node for each object, and one above them that turns the scene upright."""
        nodes: list[dict[str, Any]] = []
        tops = []
        for thing in self.scene.objects:
            tops.append(len(nodes))
            node: dict[str, Any] = {"name": thing.name}
            if not np.array_equal(thing.transform, np.eye(4)):
                node["matrix"] = _column_major(thing.transform)
            nodes.append(node)
            variant = self.aged.get(thing.name)
            self._show(nodes, node, self._unaged(thing.mesh) if variant is None else self._variant(variant))
        document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"name": self.scene.name}],
            "nodes": nodes,
            "meshes": self.meshes,
        }
        if self.scene.camera is not None:
            tops.append(len(nodes))
            add_camera(document, self.buffer, self.scene.camera, self.scene.up, _SECONDS_BETWEEN_VIEWS)
        if self.scene.up != (0.0, 1.0, 0.0):
            upright = np.eye(4)
            upright[:3, :3] = rotation_to_y(self.scene.up)
            nodes.append({"name": "upright", "matrix": _column_major(upright), "children": tops})
            tops = [len(nodes) - 1]
        document["scenes"][0]["nodes"] = tops
        return document

    def _show(self, nodes: list[dict[str, Any]], node: dict[str, Any], mesh: _Shown) -> None:
        """Let a node show a mesh, by way of a child where that is stored about its centre."""
        if mesh.center is None:
            node["mesh"] = mesh.number
            return
        node.setdefault("children", []).append(len(nodes))
        nodes.append({"translation": mesh.center.tolist(), "mesh": mesh.number})

    def _variant(self, key: str) -> _Shown:
        """The mesh of a variant, which is made when it is first asked for."""
        if key not in self.shown:
            film = self.films[key]
            sheets = [
                *film_sheets(film.snapshot, film.thickness, film.back_color),
                *metal_sheets(film.snapshot),
            ]
            numbers = [self._material(sheet.material) for sheet in sheets]
            for sheet in _sheets(film.untouched):
                sheets.append(sheet)
                own = self.own_materials.get(sheet.material.name)
                numbers.append(self._material(sheet.material) if own is None else own)
            # a matrix that is its own transpose turns normals back as its inverse turns points
            back: Vectors = np.linalg.inv(film.stretch).astype(np.float64)
            sheets = [_stretched(sheet, back, film.stretch) for sheet in sheets]
            self.shown[key] = self._add_mesh(key, sheets, numbers)
        return self.shown[key]

    def _unaged(self, mesh: str) -> _Shown:
        """The mesh of an object of a YAML file that stays as it is."""
        if mesh not in self.unaged:
            sheets = _sheets(self.scene.meshes[mesh])
            self.unaged[mesh] = self._add_mesh(mesh, sheets, [self._material(s.material) for s in sheets])
        return self.unaged[mesh]

    def _add_mesh(self, name: str, sheets: Sequence[Sheet], materials: Sequence[int]) -> _Shown:
        used = [(sheet, number) for sheet, number in zip(sheets, materials, strict=True) if len(sheet.faces)]
        center = _far_center([sheet for sheet, _ in used])
        origin = np.zeros(3) if center is None else center
        primitives = [{**self.buffer.add_sheet(sheet, origin), "material": number} for sheet, number in used]
        self.meshes.append({"name": name, "primitives": primitives})
        return _Shown(len(self.meshes) - 1, center)

    def _material(self, material: Material) -> int:
        """The number of a material, which is added where it is new."""
        entry = material_entry(material)
        if entry not in self.materials:
            self.materials.append(entry)
        return self.materials.index(entry)


def _sheets(surface: Surface | None) -> list[Sheet]:
    """A surface that carries no film, group by group."""
    nodes = [] if surface is None else surface_nodes(surface)
    return [sheet for node in nodes for sheet in node.sheets]


def _stretched(sheet: Sheet, points: Vectors, normals: Vectors) -> Sheet:
    """A sheet whose points and normals are multiplied by a matrix (3, 3) each."""
    if (points == np.eye(3)).all():
        return sheet
    turned = place(sheet.normals, normals)
    length = np.linalg.norm(turned, axis=1, keepdims=True)
    return replace(
        sheet,
        vertices=place(sheet.vertices, points),
        normals=np.divide(turned, length, out=np.zeros_like(turned), where=length > 0),
    )


def _far_center(sheets: Sequence[Sheet]) -> Vectors | None:
    """The centre of what lies far from the origin for its size, else None."""
    if not sheets:
        return None
    low = np.min([sheet.vertices.min(axis=0) for sheet in sheets], axis=0)
    high = np.max([sheet.vertices.max(axis=0) for sheet in sheets], axis=0)
    center: Vectors = 0.5 * (low + high)
    return center if np.linalg.norm(center) > _FAR * np.linalg.norm(high - low) else None


def _named_once(materials: Sequence[Any]) -> dict[str, int]:
    """Numbers of the materials that have a name of their own and use no texture coordinates but the first."""
    found: dict[str, list[int]] = {}
    for number, material in enumerate(materials):
        name = material.get("name") if isinstance(material, dict) else None
        if isinstance(name, str) and not _has_other_coordinates(material):
            found.setdefault(name, []).append(number)
    return {name: numbers[0] for name, numbers in found.items() if len(numbers) == 1}


def _has_other_coordinates(part: Any) -> bool:
    if isinstance(part, dict):
        return bool(part.get("texCoord")) or any(map(_has_other_coordinates, part.values()))
    return isinstance(part, list) and any(map(_has_other_coordinates, part))


def _drop_instancing(document: dict[str, Any]) -> None:
    """Forget the extension of instances where no node has them any more."""
    if any(INSTANCING in node.get("extensions", {}) for node in document.get("nodes", [])):
        return
    for key in ("extensionsUsed", "extensionsRequired"):
        if INSTANCING in document.get(key, []):
            document[key] = [name for name in document[key] if name != INSTANCING]
            if not document[key]:
                del document[key]


def _column_major(matrix: Vectors) -> list[float]:
    """A matrix (4, 4) as glTF has it."""
    return [float(x) for x in matrix.T.ravel()]
