"""A run as one animated GLB: each snapshot is a node, and scale switches from one to the next.

Interpolation is STEP, so at any time one snapshot has the scale 1 and all others 0; the number of faces may
change. What is the same in several snapshots, such as the metal's positions, is stored once.
"""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import blake2b
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from weathercoat import __version__
from weathercoat.output.glb import GlbBuffer, MaterialTable, Node, rotation_to_y, write_document


class Moment(NamedTuple):
    """The nodes of a snapshot, with its step and age."""

    step: int
    age: float
    nodes: Sequence[Node]


class _SharedBuffer(GlbBuffer):
    """A buffer that stores equal arrays once."""

    def __init__(self) -> None:
        super().__init__()
        self._stored: dict[tuple[bytes, str], int] = {}

    def _append(self, content: bytes, target: int | None, accessor: dict[str, Any]) -> int:
        key = blake2b(content).digest(), f"{target} {accessor['type']} {accessor['componentType']}"
        if key not in self._stored:
            self._stored[key] = super()._append(content, target, accessor)
        return self._stored[key]


def write_glb_series(
    path: Path,
    moments: Sequence[Moment],
    still: Sequence[Node] = (),
    *,
    up: tuple[float, float, float] = (0.0, 1.0, 0.0),
    seconds: float = 0.5,
) -> None:
    """Write moments as an animation, each shown for `seconds`, and nodes that stand `still`.

    Raises OSError where the file cannot be written.
    """
    rotation = rotation_to_y(up)
    vertices = [s.vertices for m in moments for n in m.nodes for s in n.sheets if len(s.faces)]
    low = np.min([points.min(axis=0) for points in vertices], axis=0)
    high = np.max([points.max(axis=0) for points in vertices], axis=0)
    center = 0.5 * (low + high)
    buffer = _SharedBuffer()
    materials = MaterialTable(buffer)
    root: dict[str, Any] = {"name": "model", "translation": [float(x) for x in rotation @ center]}
    nodes: list[dict[str, Any]] = [root]
    meshes: list[dict[str, Any]] = []

    def add(node: Node) -> int:
        entry: dict[str, Any] = {"name": node.name}
        primitives = [
            {**buffer.add_sheet(sheet, center, rotation), "material": materials.number(sheet.material)}
            for sheet in node.sheets
            if len(sheet.faces)
        ]
        if primitives:
            entry["mesh"] = len(meshes)
            meshes.append({"name": node.name, "primitives": primitives})
        nodes.append(entry)
        return len(nodes) - 1

    tops, switched = [add(node) for node in still], []
    for number, moment in enumerate(moments):
        children = [add(node) for node in moment.nodes]
        shown = float(number == len(moments) - 1)  # programs that play nothing show the end
        nodes.append({"name": f"step_{moment.step}", "scale": [shown] * 3, "children": children})
        switched.append(len(nodes) - 1)
    root["children"] = tops + switched
    document: dict[str, Any] = {
        "asset": {
            "version": "2.0",
            "generator": f"weathercoat {__version__}",
            "extras": {"steps": [m.step for m in moments], "ages": [m.age for m in moments]},
        },
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": meshes,
        "animations": [_animation(buffer, switched, seconds)],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
    }
    materials.add_to(document)
    document["buffers"] = [{"byteLength": buffer.length}]
    write_document(path, document, buffer.pieces)


def _animation(buffer: GlbBuffer, switched: Sequence[int], seconds: float) -> dict[str, Any]:
    """Scales that show each of the nodes in turn; the last one stays for as long as the others."""
    count = len(switched)
    times = np.arange(count + 1) * seconds
    clock = buffer.add(times, "SCALAR", target=None)
    buffer.accessors[clock] |= {"min": [float(times[0])], "max": [float(np.float32(times[-1]))]}
    samplers, channels = [], []
    for place, node in enumerate(switched):
        scale = np.zeros((count + 1, 3))
        scale[place] = 1.0
        if place == count - 1:
            scale[-1] = 1.0
        samplers.append(
            {"input": clock, "output": buffer.add(scale, "VEC3", target=None), "interpolation": "STEP"}
        )
        channels.append({"sampler": place, "target": {"node": node, "path": "scale"}})
    return {"name": "ageing", "samplers": samplers, "channels": channels}
