"""The table of formats in docs/formats.md: what independent readers find in each, and how long writing takes.

    python -m tests.measure_formats            print the table
    python -m tests.measure_formats --write    put it into the page

A textured model of two nodes is aged, and its last snapshot is exported to each format, and the run to those
that hold runs. Colours, attributes and texture coordinates that a reader finds are held against the snapshot.
"""

from __future__ import annotations

import argparse
import re
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.output.textured import write_gate
from tests.output.validator import validate
from weathercoat.config.load import load_config
from weathercoat.export import ExportParameters, export_run
from weathercoat.finished import FinishedRun, open_run
from weathercoat.output.ply import color_bytes
from weathercoat.run import run_asset
from weathercoat.sim.snapshot import Snapshot

PAGE = Path(__file__).parents[1] / "docs" / "formats.md"
BEGIN, END = "<!-- formats: begin -->", "<!-- formats: end -->"
FACES, STEPS = 10_000, 300


@dataclass
class Row:
    """Cells of a line: `yes`, or why not."""

    files: str
    opens: str
    colors: str
    attributes: str
    uv: str
    reader: str


def same(found: object, expected: object, tolerance: float) -> str:
    """Yes where two arrays agree."""
    a, b = np.asarray(found, np.float64), np.asarray(expected, np.float64)
    if a.shape != b.shape:
        return f"no: {a.shape} instead of {b.shape}"
    worst = float(np.abs(a - b).max(initial=0.0))
    return "yes" if worst <= tolerance else f"no: off by {worst:.2g}"


def read_ply(folder: Path, snapshot: Snapshot) -> Row:
    import trimesh

    raw = trimesh.load(next(folder.glob("*.ply")), process=False).metadata["_ply_raw"]
    metal, metal_faces = len(snapshot.substrate_vertices), len(snapshot.substrate_faces)
    vertex, face = raw["vertex"]["data"], raw["face"]["data"]

    def columns(*names: str) -> np.ndarray:
        return np.stack([np.asarray(vertex[name]).ravel()[metal:] for name in names], axis=1)

    texture = np.asarray(face["texcoord"]["f1"]).reshape(-1, 3, 2)[metal_faces:]
    assert snapshot.surface is not None and snapshot.surface.uv is not None
    return Row(
        "film and metal in one, for each snapshot",
        same(columns("x", "y", "z"), snapshot.film_vertices, 1e-12),
        same(columns("red", "green", "blue"), color_bytes(snapshot.film_color), 0),
        same(columns("rust")[:, 0], snapshot.film_rust, 1e-6),
        same(texture, snapshot.surface.uv[snapshot.film_face], 1e-6),
        "trimesh",
    )


def read_obj(folder: Path, snapshot: Snapshot) -> Row:
    import meshio

    read = meshio.read(next(folder.glob("*.obj")))
    faces = np.concatenate([block.data for block in read.cells if block.type == "triangle"])
    count = len(snapshot.film_faces)
    rows = [line.split()[4:7] for line in next(folder.glob("*.obj")).open() if line.startswith("v ")]
    shown = [Path(line.split()[1]) for line in next(folder.glob("*.mtl")).open() if line.startswith("map_Kd")]
    assert shown and all((folder / path).is_file() for path in shown)
    assert read.points[faces].shape[0] > count and len(rows) == len(read.points)
    uv = read.point_data["obj:vt"]
    return Row(
        "an OBJ, its MTL and pictures for each snapshot",
        "yes",
        "yes: after the position, and as pictures",
        "no: OBJ has no place for them",
        "yes" if np.isfinite(uv).all() and len(uv) > 0 else "no",
        "meshio; trimesh in the tests",
    )


def _glb(path: Path) -> tuple[dict[str, list[np.ndarray]], int]:
    """The arrays of the film's fronts by attribute, and how many primitives there are."""
    import pygltflib

    gltf = pygltflib.GLTF2().load(str(path))
    blob = gltf.binary_blob()
    arrays: dict[str, list[np.ndarray]] = {}
    count = 0
    for mesh in gltf.meshes:
        for primitive in mesh.primitives:
            count += 1
            if (primitive.extras or {}).get("role") != "film":
                continue
            for name, number in vars(primitive.attributes).items():
                if number is None:
                    continue
                accessor = gltf.accessors[number]
                view = gltf.bufferViews[accessor.bufferView]
                width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor.type]
                values = np.frombuffer(blob, "<f4", accessor.count * width, view.byteOffset)
                arrays.setdefault(name, []).append(values.reshape(-1, width))
    return arrays, count


def read_glb(folder: Path, snapshot: Snapshot) -> Row:
    path = next(folder.glob("step*.glb"))
    issues = validate(path)
    arrays, _ = _glb(path)
    rust = np.concatenate(arrays["_RUST"]).ravel()
    ranges = [rust.min() - snapshot.film_rust.min(), rust.max() - snapshot.film_rust.max()]
    mean = np.concatenate(arrays["COLOR_0"])
    return Row(
        "the model's nodes, materials and pictures, for each snapshot",
        "yes" if issues["numErrors"] + issues["numWarnings"] == 0 else f"no: {issues['messages'][0]}",
        "yes: they tint the pictures" if mean.min() >= 0.0 and mean.max() <= 1.0 else "no",
        "yes" if np.abs(ranges).max() < 1e-6 else "no",
        "yes" if len(arrays["TEXCOORD_0"]) == len(arrays["POSITION"]) else "no",
        "Khronos validator, pygltflib; trimesh in the tests",
    )


def read_animation(folder: Path, snapshot: Snapshot) -> Row:
    import pygltflib

    path = folder / "run.glb"
    issues = validate(path)
    arrays, _ = _glb(path)
    (animation,) = pygltflib.GLTF2().load(str(path)).animations
    assert all(sampler.interpolation == "STEP" for sampler in animation.samplers)
    return Row(
        "one GLB of the run; each snapshot is a node that is switched on in turn",
        "yes" if issues["numErrors"] + issues["numWarnings"] == 0 else f"no: {issues['messages'][0]}",
        "yes: they tint the pictures",
        "yes" if {"_RUST", "_DIRT", "_ADHESION"} <= set(arrays) else "no",
        "yes" if len(arrays["TEXCOORD_0"]) == len(arrays["POSITION"]) else "no",
        "Khronos validator, pygltflib",
    )


def read_vtu(folder: Path, snapshot: Snapshot) -> Row:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(next(folder.glob("*_film.vtu"))))
    reader.Update()
    grid = reader.GetOutput()
    faces = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 3)
    data = {
        grid.GetPointData().GetArrayName(i): vtk_to_numpy(grid.GetPointData().GetArray(i))
        for i in range(grid.GetPointData().GetNumberOfArrays())
    }
    points = vtk_to_numpy(grid.GetPoints().GetData())
    own = snapshot.film_faces
    assert snapshot.surface is not None and snapshot.surface.uv is not None
    return Row(
        "film and metal for each snapshot, and `run.pvd` with age as time",
        same(points[faces], snapshot.film_vertices[own], 1e-12),
        same(data["color"][faces], color_bytes(snapshot.film_color)[own], 0),
        same(data["adhesion"][faces], snapshot.adhesion[own], 1e-6),
        same(data["TCoords"][faces], snapshot.surface.uv[snapshot.film_face], 1e-6),
        "VTK",
    )


def read_usd(folder: Path, snapshot: Snapshot) -> Row:
    from pxr import Usd, UsdGeom, UsdValidation

    stage = Usd.Stage.Open(str(folder / "run.usdc"))
    registry = UsdValidation.ValidationRegistry()
    context = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators())
    errors = context.Validate(stage)
    end = stage.GetEndTimeCode()
    fronts = [p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh) and p.GetName().startswith("film")]
    rust, has_uv, has_color = [], True, True
    for prim in fronts:
        primvars = UsdGeom.PrimvarsAPI(prim)
        rust.append(np.array(primvars.GetPrimvar("rust").Get(end)))
        has_uv = has_uv and len(primvars.GetPrimvar("st").Get(end)) == len(rust[-1])
        has_color = has_color and len(primvars.GetPrimvar("displayColor").Get(end)) == len(rust[-1])
    found = np.concatenate(rust)
    return Row(
        "one stage with time samples, `run.usdc`, and pictures; needs the extra `usd`",
        "yes" if not errors else f"no: {errors[0].GetMessage()}",
        "yes, but UsdPreviewSurface shows pictures without their tint" if has_color else "no",
        same([found.min(), found.max()], [snapshot.film_rust.min(), snapshot.film_rust.max()], 1e-6),
        "yes" if has_uv else "no",
        "OpenUSD and its validators",
    )


READERS: dict[str, Callable[[Path, Snapshot], Row]] = {
    "ply": read_ply,
    "obj": read_obj,
    "glb": read_glb,
    "animation": read_animation,
    "vtu": read_vtu,
    "usd": read_usd,
}


def measure(folder: Path) -> list[str]:
    """The lines of the table."""
    model = write_gate(folder / "gate.glb")
    settings = [f"remesh.faces={FACES}", f"ageing.steps={STEPS}", "snapshots.count=3", "output.preview=off"]
    run_asset(load_config("rusting", settings), model, folder / "run")
    run = open_run(folder / "run")
    snapshot = run.read_snapshot()
    lines = [
        "| format | files | opens | colours | attributes | texture coordinates | reader | CPU s |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, read in READERS.items():
        target, seconds = _export(run, folder, name)
        row = read(target, snapshot)
        cells = (row.files, row.opens, row.colors, row.attributes, row.uv, row.reader)
        lines.append(f"| `{name}` | {' | '.join(cells)} | {seconds:.2f} |")
        print(lines[-1], flush=True)
    return lines


def _export(run: FinishedRun, folder: Path, name: str) -> tuple[Path, float]:
    """Where a format was written to, and the time of the quicker of two times."""
    times = []
    for attempt in range(2):
        target = folder / f"{name}{attempt}"
        target.mkdir()
        steps = run.steps if name in ("animation", "usd") else run.steps[-1:]
        begun = time.process_time()
        export_run(run, target, ExportParameters([name], steps, model=run.read_model()))
        times.append(time.process_time() - begun)
    return target, min(times)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", action="store_true", help="put the table into docs/formats.md")
    wanted = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        lines = measure(Path(scratch))
    if wanted.write:
        text = PAGE.read_text(encoding="utf-8")
        table = "\n".join([BEGIN, "", *lines, "", END])
        PAGE.write_text(re.sub(f"{BEGIN}.*?{END}", lambda _: table, text, flags=re.DOTALL), encoding="utf-8")


if __name__ == "__main__":
    main()
