"""Measure reading and writing scenes: `python -m tests.measure_scenes [--meshes 200] [--objects 1000]`.

Balls of 5,120 faces, each with a bump of its own, stand in rows. CPU seconds, the median of three calls after
one that compiles or loads every kernel; written to memory.
"""

from __future__ import annotations

import argparse
import io
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.output.snapshots import make_snapshot
from weathercoat.mesh.shapes import make_sphere
from weathercoat.output.glb import GlbBuffer, Material, material_entry, write_document
from weathercoat.output.meshes import write_mesh
from weathercoat.output.sheets import make_sheet
from weathercoat.scene.graph import AgedMesh
from weathercoat.scene.read import read_scene
from weathercoat.scene.write import write_scene

_MATERIAL = Material("paint", metallic=0.0, roughness=0.5, double_sided=False)


def write_balls(path: Path, meshes: int, objects: int) -> None:
    """A GLB of so many objects that place so many meshes."""
    buffer, ball = GlbBuffer(), make_sphere(0.5, 4)
    entries = []
    for i in range(meshes):
        vertices = ball.vertices * (1.0 + 0.1 * np.sin(i + 5.0 * ball.vertices[:, :1]))
        sheet = make_sheet(_MATERIAL, vertices, ball.faces, crease=2.0)
        primitive = {**buffer.add_sheet(sheet, np.zeros(3)), "material": 0}
        entries.append({"name": f"ball-{i}", "primitives": [primitive]})
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(objects))}],
        "nodes": [
            {"name": f"object-{i}", "mesh": i % meshes, "translation": [i % 30, 0, i // 30]}
            for i in range(objects)
        ],
        "meshes": entries,
        "materials": [material_entry(_MATERIAL)],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": buffer.length}],
    }
    write_document(path, document, buffer.pieces)


def write_list(path: Path, objects: int) -> None:
    """A YAML file of so many objects of one model, which lies beside it."""
    write_mesh(path.with_suffix(".obj"), make_sphere(0.5, 4))
    rows = [
        f"  - {{name: object-{i}, model: {path.stem}.obj, position: [{i}, 0, 1], rotation: [0, {i}, 0]}}\n"
        for i in range(objects)
    ]
    path.write_text("objects:\n" + "".join(rows), encoding="utf-8")


def report(what: str, work: Callable[[], object]) -> None:
    """Print the median CPU seconds of a call."""
    work()
    seconds = []
    for _ in range(3):
        start = time.process_time()
        work()
        seconds.append(time.process_time() - start)
    print(f"{what:<24} {np.median(seconds):6.2f} s", flush=True)


def main() -> None:
    """Measure, and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--meshes", type=int, default=200)
    parser.add_argument("--objects", type=int, default=1000)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        balls, listed = Path(name) / "balls.glb", Path(name) / "list.yaml"
        write_balls(balls, arguments.meshes, arguments.objects)
        write_list(listed, arguments.objects)
        report("read GLB", lambda: read_scene(balls))
        report("read YAML", lambda: read_scene(listed))
        scene = read_scene(balls)
    print(f"{len(scene.objects)} objects, {sum(len(m.faces) for m in scene.meshes.values()):,} faces")
    films = {
        key: AgedMesh(make_snapshot(mesh=(mesh.vertices, mesh.faces), lost=500), 0.003, (0.5, 0.5, 0.5))
        for key, mesh in scene.meshes.items()
    }
    aged = {thing.name: thing.mesh for thing in scene.objects}
    report("write GLB, all aged", lambda: write_scene(io.BytesIO(), scene, aged, films))
    report("write GLB, none aged", lambda: write_scene(io.BytesIO(), scene, {}, films))


if __name__ == "__main__":
    main()
