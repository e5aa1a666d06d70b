"""A generated scene to try the tool on: a workshop's yard of fifty painted parts, ten meshes, one camera.

A shed with a corrugated roof shelters lockers, barrels and gears; a fence, pipes, barrels and a sign stand in
the open. Metres, y up, the ground at 0. The camera walks past the front in ten seconds.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from weathercoat import __version__
from weathercoat.errors import UsageError
from weathercoat.mesh import shapes
from weathercoat.mesh.surface import Surface
from weathercoat.output.folder import whole_file
from weathercoat.output.glb import GlbBuffer, Material, material_entry, write_document
from weathercoat.output.sheets import METAL_CREASE, make_sheet, srgb_to_linear
from weathercoat.scene.camera_node import add_camera
from weathercoat.scene.graph import CameraPath

_ROOF_SLOPE = math.degrees(math.atan(0.4 / 2.6))

YARD_YAML = """\
# A yard of fifty painted parts in yard.glb; the weathering follows from where each of them stands.
scene: {glb}
ground: 0
config: standard
set:
  quality: auto
camera:
  image_height: 1080
rules:
  - match: ground            # concrete
    weathered: off
  - match: "shed/*"
    set: {{appearance.paint: "#7d8b86"}}
  - match: "*barrel*"
    set: {{appearance.paint: "#2f5f9e"}}
  - match: "shed/store/locker*"
    set: {{appearance.paint: "#5d7f5b"}}
  - match: "fence/*"
    set: {{appearance.paint: "#d8d4c8"}}
  - match: "sign*"
    set: {{appearance.paint: "#c8a024"}}
    variants: each
  - match: "gear*"
    set: {{appearance.paint: "#a43a2a"}}
"""


def _meshes() -> dict[str, tuple[Surface, str]]:
    """The surfaces and colours of the yard, by name."""
    return {
        "ground": (shapes.make_box(13.0, 0.1, 9.0, cells=1), "#8d8a82"),
        "post": (shapes.make_box(0.1, 1.0, 0.1, cells=10), "#7d8b86"),
        "roof-sheet": (
            shapes.make_corrugated_sheet(1.56, 3.7, 0.18, 0.045, 0.008, edge_length=0.09),
            "#7d8b86",
        ),
        "plate": (shapes.make_box(1.25, 1.95, 0.012, cells=16), "#7d8b86"),
        "bracket": (shapes.make_bracket(), "#7d8b86"),
        "locker": (shapes.make_box(0.8, 1.6, 0.45, cells=12), "#5d7f5b"),
        "barrel": (shapes.make_barrel(segments=64), "#2f5f9e"),
        "gear": (shapes.make_gear(0.36, teeth=16, tooth=0.07, bore=0.09, thickness=0.1), "#a43a2a"),
        "rail": (shapes.make_pipe(0.028, 0.006, 0.9, segments=24, rows=40), "#d8d4c8"),
        "pipe": (shapes.make_pipe(0.2, 0.02, 2.4, segments=48, rows=48), "#58777f"),
        "sign": (shapes.make_sign(1.0, 0.62, 0.015), "#c8a024"),
    }


@dataclass(frozen=True)
class _Thing:
    """A node: its mesh, or None for a group; angles in degrees about x, y and z, at most one of them."""

    name: str
    mesh: str | None
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    about_x: float = 0.0
    about_y: float = 0.0
    about_z: float = 0.0
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    children: Sequence[_Thing] = field(default=())

    def entry(self) -> dict[str, Any]:
        """The node of glTF, without its mesh and its children."""
        half = np.radians([self.about_x, self.about_y, self.about_z]) / 2
        turn = [*np.sin(half).tolist(), float(np.prod(np.cos(half)))]
        entry: dict[str, Any] = {"name": self.name}
        for key, value, rest in (
            ("translation", list(self.position), [0.0] * 3),
            ("rotation", turn, [0.0, 0.0, 0.0, 1.0]),
            ("scale", list(self.scale), [1.0] * 3),
        ):
            if value != rest:
                entry[key] = value
        return entry


def _things() -> list[_Thing]:
    return [
        _Thing("ground", "ground", (0.3, -0.1, -0.8)),
        _Thing("shed", None, children=[*_shed(), _Thing("store", None, children=list(_store()))]),
        _Thing("fence", None, children=list(_fence())),
        _Thing("stack", None, (2.7, 0.0, -0.9), about_y=9.0, children=list(_stack())),
        _Thing("barrel-4", "barrel", (1.75, 0.0, -2.2), about_y=70.0),
        _Thing("barrel-5", "barrel", (2.5, 0.302, 0.35), about_z=90.0),
        _Thing("plate-5", "plate", (1.02, 0.0, -3.27), about_x=-11.0),
    ]


def _shed() -> Iterator[_Thing]:
    """Six posts, a roof of four sheets, a wall of four plates with a sign, and brackets under the eaves."""
    across = (-4.4, -1.9, 0.6)
    for i, (z, height) in enumerate(((-1.0, 2.6), (-3.6, 2.2))):
        for j, x in enumerate(across):
            yield _Thing(f"post-{3 * i + j + 1}", "post", (x, 0.0, z), scale=(1.0, height, 1.0))
    for i in range(4):
        x = -4.15 + 1.5 * i
        # every other sheet overlaps its neighbours from above
        yield _Thing(
            f"roof-{i + 1}", "roof-sheet", (x, 2.71 + 0.012 * (i % 2), -0.5), about_x=-90.0 - _ROOF_SLOPE
        )
    for i in range(4):
        yield _Thing(f"plate-{i + 1}", "plate", (-3.775 + 1.25 * i, 0.06, -3.66))
    for i, (x, z) in enumerate(((-4.4, -0.94), (-1.9, -0.94), (0.6, -0.94), (-1.9, -3.54))):
        # upside down, so that its shelf is at the top
        yield _Thing(f"bracket-{i + 1}", "bracket", (x, 2.58 if z > -2 else 2.18, z), scale=(0.4, -0.4, 0.4))
    yield _Thing("sign-1", "sign", (-1.0, 1.25, -3.64))


def _store() -> Iterator[_Thing]:
    """What stands under the roof."""
    yield _Thing("locker-1", "locker", (-3.85, 0.0, -3.3))
    yield _Thing("locker-2", "locker", (-2.98, 0.0, -3.28), about_y=-4.0)
    for i, (x, z, turn) in enumerate(((-1.35, -3.15, 0.0), (-0.68, -3.2, 40.0), (-0.98, -2.5, 100.0))):
        yield _Thing(f"barrel-{i + 1}", "barrel", (x, 0.0, z), about_y=turn)
    yield _Thing("gear-1", "gear", (0.12, 0.0, -3.38), about_x=-14.0)
    yield _Thing("gear-2", "gear", (-2.3, 0.05, -1.9), about_x=-90.0)


def _fence() -> Iterator[_Thing]:
    """Six posts with two rails between each pair, and a sign."""
    for i in range(6):
        yield _Thing(f"fence-post-{i + 1}", "post", (1.7 + 0.9 * i, 0.0, -3.9), scale=(0.7, 1.15, 0.7))
    for i in range(10):
        column, row = divmod(i, 2)
        # lying along x, from the post on the right to that on the left
        yield _Thing(f"rail-{i + 1}", "rail", (2.6 + 0.9 * column, 0.5 + 0.48 * row, -3.9), about_z=90.0)
    yield _Thing("sign-2", "sign", (3.95, 0.62, -3.84))


def _stack() -> Iterator[_Thing]:
    """Three pipes, the third on the two others, and a gear against them."""
    for i, (y, z) in enumerate(((0.2, 0.0), (0.2, -0.402), (0.548, -0.201))):
        yield _Thing(f"pipe-{i + 1}", "pipe", (2.4 + 0.1 * i, y, z), about_z=90.0)
    yield _Thing("gear-3", "gear", (0.7, 0.0, 0.52), about_x=-22.0)


# Where the camera is and what it looks at, view by view.
_SECONDS_BETWEEN_VIEWS = 2.5
_WALK = ((-5.6, 1.7, 4.2), (-2.9, 1.65, 3.7), (0.2, 1.6, 4.3), (3.2, 1.65, 3.8), (5.6, 1.7, 4.4))
_TARGETS = ((-1.8, 1.0, -2.0), (-1.5, 1.0, -2.2), (-0.4, 0.9, -2.0), (0.8, 0.9, -2.0), (1.2, 0.9, -2.0))
_FIELD_OF_VIEW = 50.0


def write_yard_files(path: Path, *, overwrite: bool = False) -> tuple[Path, Path]:
    """Write the yard as .glb, and beside it the scene file with its rules as .yaml; returns both.

    path: either of them. Raises UsageError for another extension, OutputExistsError, OutputError.
    """
    if path.suffix not in (".glb", ".yaml"):
        raise UsageError(
            f"a scene is not written as {path.suffix or 'a file without extension'}",
            remedy="use .glb or .yaml",
        )
    nodes, rules = path.with_suffix(".glb"), path.with_suffix(".yaml")
    with whole_file(nodes, overwrite=overwrite) as stream, whole_file(rules, overwrite=overwrite) as text:
        write_yard(stream)
        text.write(YARD_YAML.format(glb=json.dumps(nodes.name)).encode())
    return nodes, rules


def write_yard(target: Path | str | BinaryIO) -> None:
    """Write the yard as GLB; the same bytes each time. Raises OSError."""
    buffer = GlbBuffer()
    surfaces = _meshes()
    meshes: list[dict[str, Any]] = []
    materials: list[dict[str, Any]] = []
    for name, (surface, color) in surfaces.items():
        red, green, blue = srgb_to_linear([int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)]).tolist()
        material = Material(name, 0.0, 0.6, double_sided=False, base_color=(red, green, blue))
        sheet = make_sheet(material, surface.vertices, surface.faces, crease=METAL_CREASE)
        primitive = {**buffer.add_sheet(sheet, np.zeros(3)), "material": len(materials)}
        materials.append(material_entry(material))
        meshes.append({"name": name, "primitives": [primitive]})
    number = {name: i for i, name in enumerate(surfaces)}
    nodes: list[dict[str, Any]] = []

    def add(thing: _Thing) -> int:
        entry = thing.entry()
        if thing.mesh is not None:
            entry["mesh"] = number[thing.mesh]
        nodes.append(entry)
        place = len(nodes) - 1
        if thing.children:
            entry["children"] = [add(child) for child in thing.children]
        return place

    tops = [add(thing) for thing in _things()]
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": f"weathercoat {__version__}"},
        "scene": 0,
        "scenes": [{"name": "yard", "nodes": [*tops, len(nodes)]}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
    }
    away = np.array(_TARGETS) - np.array(_WALK)
    camera = CameraPath(np.array(_WALK), away / np.linalg.norm(away, axis=1, keepdims=True), _FIELD_OF_VIEW)
    add_camera(document, buffer, camera, (0.0, 1.0, 0.0), _SECONDS_BETWEEN_VIEWS)
    document["accessors"], document["bufferViews"] = buffer.accessors, buffer.views
    document["buffers"] = [{"byteLength": buffer.length}]
    write_document(target, document, buffer.pieces)
