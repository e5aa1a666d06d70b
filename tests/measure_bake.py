"""Measure whether baked maps look as the simulated mesh does: `python -m tests.measure_bake RUN...`.

The input in its baked maps and the simulated mesh are drawn by the same renderer, from the same camera under
the same light, from three sides, near (the model fills the picture) and from afar (a quarter of that). A row
for each snapshot:

run, step       what was compared
mean            mean absolute difference of the pixels of the model, of 255
FLIP            mean over the pixels of the model, 0 to 1
lift            mean height of what of the film has lifted, in sizes: relief that maps do not have
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from weathercoat.baking import prepare_baker
from weathercoat.comparison.flip import flip_map
from weathercoat.finished import FinishedRun, open_run
from weathercoat.output.display import (
    DisplayMesh,
    Normalisation,
    join_meshes,
    make_display_mesh,
    make_textured_mesh,
)
from weathercoat.output.maps.bake import Baker, MapParameters
from weathercoat.output.materials import make_material
from weathercoat.output.pictures import PictureParameters, frame_camera, render_mesh
from weathercoat.output.shading import to_linear
from weathercoat.recording import picture_parameters
from weathercoat.run import painted_faces
from weathercoat.sim.snapshot import Snapshot

SIDES = (32.0, 152.0, 272.0)
SHOWN = ("base_color", "orm", "normal")


def baked_mesh(baker: Baker, snapshot: Snapshot, size: int) -> DisplayMesh:
    """The input in its maps, as pictures show it."""
    normalise = Normalisation.of(snapshot)
    with tempfile.TemporaryDirectory() as folder:
        about = baker.bake(snapshot, MapParameters(size, size, maps=SHOWN), Path(folder), threads=2)
        meshes = []
        for tile, entry in zip(baker.layout.tiles, about["tiles"], strict=True):
            maps = [np.asarray(Image.open(Path(folder) / entry["files"][name])) for name in SHOWN]
            chosen = np.zeros(len(baker.surface.faces), np.bool_)
            chosen[tile.faces] = True
            part = replace(baker.surface.select_faces(chosen), uv=tile.uv)
            meshes.append(make_textured_mesh(normalise(part.vertices), part, make_material(*maps)))
    return join_meshes(meshes)


def simulated_mesh(finished: FinishedRun, snapshot: Snapshot, look: PictureParameters) -> DisplayMesh:
    """The simulated mesh, as pictures show it."""
    return make_display_mesh(
        snapshot,
        Normalisation.of(snapshot),
        film_thickness=look.film_thickness,
        metal_thickness=0.0,
        paint=to_linear(look.paint),
        untouched=finished.untouched,
        look=look.look,
    )


def compare(
    finished: FinishedRun, baker: Baker, snapshot: Snapshot, size: int, shrink: int, save: Path | None
) -> tuple[float, float]:
    """Mean difference and FLIP over the model's pixels, from all sides."""
    look = replace(picture_parameters(finished.config), width=640 // shrink, height=480 // shrink)
    meshes = [simulated_mesh(finished, snapshot, look), baked_mesh(baker, snapshot, size)]
    differences, flips = [], []
    for azimuth in SIDES:
        seen = replace(look, azimuth=azimuth)
        camera = frame_camera(snapshot, seen, up=finished.up, untouched=finished.untouched)
        placed = Normalisation.of(snapshot)(snapshot.substrate_vertices)
        ground = (float((placed @ np.asarray(finished.up)).min()), 1.6 * float(np.abs(placed).max()))
        pictures = [render_mesh(mesh, camera, seen, up=finished.up, ground=ground) for mesh in meshes]
        if save is not None and azimuth == SIDES[0]:
            Image.fromarray(np.concatenate(pictures, axis=1)).save(save)
        is_model = np.abs(pictures[0].astype(int) - pictures[0][0, 0]).max(axis=2) > 24
        differences.append(np.abs(pictures[0].astype(float) - pictures[1])[is_model].mean())
        flips.append(flip_map(*pictures)[is_model].mean())
    return float(np.mean(differences)), float(np.mean(flips))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--model", type=Path)
    parser.add_argument("--size", type=int, default=2048)
    parser.add_argument("--save", type=Path, help="a folder for the pictures side by side")
    arguments = parser.parse_args()
    print(f"{'run':20} {'step':>6} {'mean':>6} {'FLIP':>6} {'mean, afar':>11} {'FLIP, afar':>11} {'lift':>7}")
    for run in arguments.runs:
        finished = open_run(run)
        surface = finished.read_model(arguments.model)
        baker = prepare_baker(
            surface,
            painted_faces(surface, finished.config),
            finished.read_snapshot(),
            finished.config,
            up=finished.up,
            atlas_size=arguments.size if surface.uv is None else None,
        )
        for step in finished.steps:
            snapshot = finished.read_snapshot(step)
            if snapshot.surface is not None:
                whole = replace(snapshot.surface, parts=surface.parts, materials=surface.materials)
                snapshot = replace(snapshot, surface=whole)
            values = []
            for shrink, name in ((1, "near"), (4, "afar")):
                save = arguments.save and arguments.save / f"{run.name}_{step}_{name}.png"
                values += compare(finished, baker, snapshot, arguments.size, shrink, save)
            rest = snapshot.substrate_vertices[snapshot.film_origin]
            away = np.linalg.norm(snapshot.film_vertices - rest, axis=1) / baker.size
            lift = away[snapshot.separated].mean() if snapshot.separated.any() else 0.0
            print(
                f"{run.name:20} {step:6} {values[0]:6.2f} {values[1]:6.3f} {values[2]:11.2f} "
                f"{values[3]:11.3f} {lift:7.4f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
