"""Scenes from glTF: every node with a mesh is an object, and every mesh is read once.

Source: Khronos, glTF 2.0 specification; EXT_mesh_gpu_instancing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import (
    CorruptError,
    LimitError,
    NoAreaError,
    NoFacesError,
    Note,
    WeathercoatError,
)
from weathercoat.mesh.formats.gltf import gather_polygons, passed_over
from weathercoat.mesh.formats.gltf_document import (
    FLOATS,
    GltfDocument,
    PlacedNode,
    check_index,
    malformed_is_corrupt,
    trs_matrices,
)
from weathercoat.mesh.repair import repair
from weathercoat.mesh.surface import Surface
from weathercoat.scene.cameras import animated_nodes, read_cameras
from weathercoat.scene.graph import Scene, SceneObject, unique_names
from weathercoat.scene.retained import INSTANCING, check_retained

# Shortest over longest axis of a transform below which what it places has no body: well above the rounding of
# stretches, and below the thinnest sheet that is made of a block.
FLATTEST = 1e-4


def parse_glb(data: bytes, path: Path, *, max_faces: int) -> Scene:
    """The scene in a GLB or glTF file that holds `data`; `path` is where its other files lie.

    Errors: as `read_surface`, and NoFacesError where no node has a mesh with faces.
    """
    with malformed_is_corrupt():
        return _Reader(GltfDocument(data, path.parent, follows=(INSTANCING,)), max_faces).scene(path.stem)


@dataclass
class _Reader:
    document: GltfDocument
    max_faces: int
    surfaces: dict[int, Surface | None] = field(default_factory=dict)

    def scene(self, name: str) -> Scene:
        nodes = self.document.placed_nodes()
        meshes = self.document.json.get("meshes", [])
        keys = unique_names([(str(mesh.get("name") or f"mesh_{i}"),) for i, mesh in enumerate(meshes)])
        objects, paths, notes = [], [], []
        parents = {node.number: node for node in nodes}
        for node in nodes:
            if "mesh" not in node.entry:
                continue
            number = node.entry["mesh"]
            check_index(number, meshes, "mesh")
            if self._surface(number, keys[number]) is None:
                continue
            path = _path(parents, node)
            for instance, matrix in self._matrices(node):
                if not np.isfinite(matrix).all():
                    raise CorruptError(f"the transform of node {node.number} is not finite")
                paths.append(path if instance is None else (*path[:-1], f"{path[-1]}/{instance}"))
                kept = _why_kept(node.entry, meshes[number], matrix)
                objects.append(SceneObject("", keys[number], matrix, node.number, instance, kept))
        if not objects:
            raise NoFacesError("the scene has no mesh with faces")
        named = [
            replace(thing, name=unique, path="/".join(path))
            for unique, path, thing in zip(unique_names(paths), paths, objects, strict=True)
        ]
        check_retained(self.document)
        camera, passed = read_cameras(self.document, nodes)
        notes += passed + self._notes(nodes, named) + passed_over(self.document)
        return Scene(
            name=name,
            meshes={keys[i]: surface for i, surface in self.surfaces.items() if surface is not None},
            objects=tuple(named),
            camera=camera,
            source=self.document,
            notes=tuple(notes),
        )

    def _surface(self, number: int, key: str) -> Surface | None:
        """The surface of a mesh in its own coordinates; None where it has no faces."""
        if number not in self.surfaces:
            self.surfaces[number] = self._read(number, key)
        return self.surfaces[number]

    def _read(self, number: int, key: str) -> Surface | None:
        try:
            # Numbers that are not finite, or too large, are found and reported by the checks, not by NumPy.
            with np.errstate(invalid="ignore", over="ignore"):
                polygons = gather_polygons(self.document, [PlacedNode(-1, -1, {"mesh": number}, np.eye(4))])
                faces = sum(len(s.faces) for s in self.surfaces.values() if s is not None)
                if faces + len(polygons.sizes) > self.max_faces:
                    raise LimitError(f"the meshes have more than {self.max_faces} triangles together")
                return repair(polygons, up=(0.0, 1.0, 0.0), name=key, format="glb", max_faces=self.max_faces)
        except (NoFacesError, NoAreaError):
            return None
        except WeathercoatError as error:
            error.message = f"mesh {key!r}: {error.message}"
            raise

    def _matrices(self, node: PlacedNode) -> list[tuple[int | None, NDArray[np.float64]]]:
        """Where a node places its mesh: once, or for each of its instances, with their numbers."""
        extension = node.entry.get("extensions", {}).get(INSTANCING)
        if extension is None:
            return [(None, node.matrix)]
        placed = np.einsum(
            "ij,njk->nik", node.matrix, instance_matrices(self.document, extension["attributes"])
        )
        return list(enumerate(placed))

    def _notes(self, nodes: Sequence[PlacedNode], objects: Sequence[SceneObject]) -> list[Note]:
        kept = [o for o in objects if o.kept]
        names = ", ".join(f"{o.name} ({o.kept})" for o in kept[:5])
        empty = sum(surface is None for surface in self.surfaces.values())
        moved, moving = animated_nodes(self.document), 0
        above = {node.number: node.parent for node in nodes}
        drifting = {-1: False}
        for node in nodes:
            drifting[node.number] = node.number in moved or drifting[above[node.number]]
        moving = sum(drifting[o.node] for o in objects if o.node is not None)
        found = (
            ("W-OBJECT", len(kept), f"objects stay as they are: {names}"),
            ("W-OBJECT", empty, "meshes without faces, or whose faces have no area, stay as they are"),
            ("W-ANIMATION", moving, "objects move; they are weathered where they stand at rest"),
        )
        return [Note(code, count, text) for code, count, text in found if count]


def _path(nodes: dict[int, PlacedNode], node: PlacedNode) -> tuple[str, ...]:
    """The names from the root down to a node; one that has none is `node_7`."""
    names = []
    while True:
        names.append(str(node.entry.get("name") or f"node_{node.number}"))
        if node.parent < 0:
            return tuple(reversed(names))
        node = nodes[node.parent]


def _why_kept(entry: dict[str, Any], mesh: dict[str, Any], matrix: NDArray[np.float64]) -> str:
    if "skin" in entry:
        return "it is skinned"
    if any(primitive.get("targets") for primitive in mesh["primitives"]):
        return "it has morph targets"
    return "" if has_body(matrix) else "its transform flattens it"


def has_body(matrix: NDArray[np.float64]) -> bool:
    """Whether a transform leaves what it places an extent along all axes."""
    lengths = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    return bool(lengths[2] > FLATTEST * lengths[0])


def instance_matrices(document: GltfDocument, attributes: dict[str, int]) -> NDArray[np.float64]:
    """Matrices (n, 4, 4) of the instances of a node."""
    kinds = (
        ("TRANSLATION", "VEC3", FLOATS, [0.0, 0.0, 0.0]),
        ("ROTATION", "VEC4", FLOATS | {(5120, True), (5122, True)}, [0.0, 0.0, 0.0, 1.0]),
        ("SCALE", "VEC3", FLOATS, [1.0, 1.0, 1.0]),
    )
    values = {
        name: document.accessor(attributes[name], (width,), components)
        for name, width, components, _ in kinds
        if name in attributes
    }
    count = {len(v) for v in values.values()}
    if len(count) != 1:
        raise CorruptError(f"{INSTANCING} has attributes of different lengths, or none that it knows")
    n = count.pop()
    return trs_matrices(*(values.get(name, np.tile(rest, (n, 1))) for name, _, _, rest in kinds))
