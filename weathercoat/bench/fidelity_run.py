"""A run as a viewer sees it: its figures at several ages, and its film and its pictures at a few."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.config.schema import Config
from weathercoat.mesh.surface import Surface, face_areas, vertex_normals
from weathercoat.output.camera import Camera, make_camera
from weathercoat.output.display import Normalisation
from weathercoat.output.pictures import Image, PictureParameters, render_snapshot
from weathercoat.output.rays import make_rays
from weathercoat.output.report import measure_snapshot
from weathercoat.recording import picture_parameters
from weathercoat.run import prepare_simulation, remesh_painted
from weathercoat.sim.simulation import Simulation
from weathercoat.sim.snapshot import Snapshot

QUANTITIES = ("separated", "lost", "rusted", "crack_length", "rim_length")
_RUSTED = 0.1  # rust of the metal that shows
_MARGIN = 0.02
_SMALL = 200  # pixels of height, below which a picture is smoothed more, since it has few
_OUTLINE_HEIGHT = 240


@dataclass(frozen=True)
class View:
    """Where the part is seen from: the same for every run of it. Lengths are in sizes of the part.

    pixels_per_size: of a picture one pixel high, at the middle of the part.
    """

    camera: Camera
    parameters: PictureParameters
    up: tuple[float, float, float]
    pixels_per_size: float

    def draw(self, snapshot: Snapshot, height: int) -> Image:
        """The picture of a snapshot, `height` pixels high."""
        aspect = self.parameters.width / self.parameters.height
        parameters = replace(
            self.parameters,
            width=round(height * aspect),
            height=height,
            samples=2 if height >= _SMALL else 6,
        )
        return render_snapshot(snapshot, parameters, up=self.up, camera=self.camera)

    def outline(self, snapshot: Snapshot) -> NDArray[np.bool_]:
        """Which pixels show film."""
        height = _OUTLINE_HEIGHT
        width = round(height * self.parameters.width / self.parameters.height)
        if len(snapshot.film_faces) == 0:
            return np.zeros(height * width, np.bool_)
        place = Normalisation.of(snapshot)
        film, metal = place(snapshot.film_vertices), place(snapshot.substrate_vertices)
        behind = metal - 1e-3 * snapshot.substrate_normals  # so that attached film lies before it
        rays = make_rays(
            np.concatenate([film, behind]),
            np.concatenate([snapshot.film_faces, snapshot.substrate_faces + np.int32(len(film))]),
        )
        directions = self.camera.directions(np.arange(height), np.arange(width), width, height)
        origins = np.tile(self.camera.position.astype(np.float32), (len(directions), 1))
        face, _ = rays.nearest(origins, directions)
        return (face >= 0) & (face < len(snapshot.film_faces))  # type: ignore[no-any-return]


def make_view(part: Surface, config: Config) -> View:
    """The view that frames a part as the preview of a run does, but fills the picture."""
    parameters = picture_parameters(config)
    size = part.size()
    low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
    placed = (part.vertices - 0.5 * (low + high)) / size
    camera = make_camera(
        placed,
        vertex_normals(part.vertices, part.faces),
        part.up,
        aspect=parameters.width / parameters.height,
        azimuth=parameters.azimuth,
        elevation=parameters.elevation,
        margin=_MARGIN,
    )
    depth = float(-camera.position @ camera.forward)
    return View(camera, parameters, part.up, 1.0 / (2.0 * camera.tangent_y * depth))


@dataclass(frozen=True)
class Observed:
    """What a run came to.

    seconds: of remeshing and of the steps, CPU time of this process, or wall time where several threads
    share the steps. curves: each of `QUANTITIES` at each age, shares of the area, or a length in sizes.
    snapshots: at the ages of pictures.
    """

    seconds: Mapping[str, float]
    curves: Mapping[str, Sequence[float]]
    snapshots: tuple[Snapshot, ...]


def observe(
    part: Surface, config: Config, ages: Sequence[float], picture_ages: Sequence[float], threads: int = 1
) -> Observed:
    """Run a part by a config, remeshed by it; ages are shares of the run."""
    clock = time.process_time if threads == 1 else time.perf_counter
    started = clock()
    meshed = remesh_painted(part, config)
    remeshed = clock()
    simulation = prepare_simulation(meshed, config, part, threads=threads)
    due = {round(age * simulation.steps) for age in ages}
    drawn = {round(age * simulation.steps) for age in picture_ages}
    rows: list[dict[str, float]] = []
    snapshots = []
    spent = clock() - remeshed
    while simulation.step_count < simulation.steps:
        started_step = clock()
        simulation.step()
        spent += clock() - started_step
        if simulation.step_count in due | drawn:
            snapshot = simulation.snapshot()
            if simulation.step_count in due:
                rows.append(_figures(snapshot, simulation))
            if simulation.step_count in drawn:
                snapshots.append(snapshot)
    return Observed(
        {"remesh": remeshed - started, "steps": spent},
        {name: [row[name] for row in rows] for name in QUANTITIES},
        tuple(snapshots),
    )


def _figures(snapshot: Snapshot, simulation: Simulation) -> dict[str, float]:
    figures: dict[str, Any] = measure_snapshot(snapshot)
    areas = face_areas(snapshot.substrate_vertices, snapshot.substrate_faces)
    is_rusted = snapshot.substrate_rust[snapshot.substrate_faces].mean(axis=1) > _RUSTED
    return {
        "separated": figures["affected_share"],
        "lost": figures["lost_share"],
        "rusted": float(areas[is_rusted].sum() / areas.sum()),
        "crack_length": figures["crack_length"] / simulation.frame.size,
        "rim_length": figures["outline_length"] / simulation.frame.size,
    }
