"""What a run writes while it goes on: snapshots with their figures and pictures, and checkpoints."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from weathercoat.config.schema import Config
from weathercoat.mesh.surface import Surface
from weathercoat.output.camera import Camera
from weathercoat.output.checkpoints import Checkpoint, broken, write_checkpoint, write_surface
from weathercoat.output.folder import CHECKPOINT, SNAPSHOTS, snapshot_stem
from weathercoat.output.pictures import (
    Image,
    PictureParameters,
    contact_sheet,
    frame_camera,
    read_png,
    render_snapshot,
    write_png,
)
from weathercoat.output.report import measure_snapshot
from weathercoat.output.snapshots import Look, write_snapshot_glb, write_snapshot_ply
from weathercoat.sim.checkpoint import restore_state, state_arrays
from weathercoat.sim.simulation import Simulation
from weathercoat.sim.snapshot import Snapshot

UnitColor = tuple[float, float, float]


@dataclass
class Stopwatch:
    """Seconds by name."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def time(self, name: str) -> Iterator[None]:
        """Add the time that the block takes to `name`."""
        started = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - started


class SnapshotRecorder:
    """Writes each snapshot as it is due and keeps its figures and its picture."""

    def __init__(self, folder: Path, config: Config, untouched: Surface | None, watch: Stopwatch) -> None:
        self.folder = folder / SNAPSHOTS
        self.config = config
        self.untouched = untouched
        self.watch = watch
        self.figures: list[dict[str, Any]] = []
        self.images: list[Image] = []
        self.camera: Camera | None = None

    def record(self, simulation: Simulation) -> None:
        """Write the snapshot of this moment in every wanted format, measure and draw it."""
        with self.watch.time("mesh"):
            snapshot = simulation.snapshot()
        with self.watch.time("write"):
            self._write(snapshot, simulation)
            residual = simulation.residual()
            size = simulation.frame.size
            metres = self.config.metres_per_unit()
            figures = measure_snapshot(
                snapshot,
                flake_areas=np.asarray(simulation.flake_areas) * size**2,
                strain=residual.strain_rms,
                residual=residual.angle_rms,
                energy=residual.energy,
                imbalance=residual.imbalance,
                millimetres=None if metres is None else 1000.0 * metres,
            )
        if self.config.output.preview:
            with self.watch.time("pictures"):
                self.images.append(self._draw(snapshot, simulation.surface.up))
        self.figures.append(figures)

    def _write(self, snapshot: Snapshot, simulation: Simulation) -> None:
        self.folder.mkdir(exist_ok=True)
        stem = snapshot_stem(snapshot.step, simulation.steps)
        if "ply" in self.config.output.formats:
            write_snapshot_ply(self.folder, snapshot, stem)
        if "glb" in self.config.output.formats:
            write_snapshot_glb(
                self.folder / f"{stem}.glb",
                snapshot,
                thickness=self.config.appearance.thickness * simulation.frame.size,
                back_color=unit_color(self.config.appearance.back),
                look=Look(self.config.appearance.look, unit_color(self.config.appearance.rust)),
                up=simulation.surface.up,
                untouched=self.untouched,
            )

    def _draw(self, snapshot: Snapshot, up: tuple[float, float, float]) -> Image:
        parameters = picture_parameters(self.config)
        # of what does not move, and so the same for all snapshots
        self.camera = self.camera or frame_camera(snapshot, parameters, up=up, untouched=self.untouched)
        return render_snapshot(snapshot, parameters, up=up, untouched=self.untouched, camera=self.camera)

    def write_preview(self, path: Path) -> None:
        """Put the pictures of all snapshots on one sheet."""
        write_png(path, contact_sheet(self.images, [f"age {figures['age']:g}" for figures in self.figures]))


class CheckpointKeeper:
    """Writes a checkpoint whenever one is due, with all that the recorder of snapshots has until then.

    identity: what tells the run from others. surface: what was simulated, to be kept where it was remeshed.
    """

    def __init__(
        self,
        folder: Path,
        config: Config,
        surface: Surface,
        identity: Mapping[str, Any],
        recorder: SnapshotRecorder,
        watch: Stopwatch,
    ) -> None:
        self.folder = folder
        self.config = config
        self.surface = surface
        self.identity = identity
        self.recorder = recorder
        self.watch = watch
        self._since = time.monotonic()
        self._is_surface_kept = False
        self._pictures_kept = 0

    def restore(self, simulation: Simulation, checkpoint: Checkpoint, figures: list[dict[str, Any]]) -> None:
        """Bring the simulation, and the recorder with these figures, to where the checkpoint was written.

        Raises CorruptError where it is broken.
        """
        try:
            restore_state(simulation, checkpoint.arrays)
        except (KeyError, ValueError, IndexError, TypeError) as error:
            raise broken(self.folder / CHECKPOINT) from error
        self.recorder.figures.extend(figures)
        if self.config.output.preview:
            self.recorder.images.extend(read_png(self._picture(i, simulation)) for i in range(len(figures)))
        self._is_surface_kept = True
        self._pictures_kept = len(self.recorder.images)

    def consider(self, simulation: Simulation) -> None:
        """Write a checkpoint if one is due after this step."""
        wanted, step = self.config.checkpoint, simulation.step_count
        is_due = wanted.steps > 0 and step > 0 and step % wanted.steps == 0
        # a clock may be set, but the monotonic one does not go back
        if wanted.minutes > 0.0 and time.monotonic() - self._since >= 60.0 * wanted.minutes:
            is_due = True
        if is_due:
            self.write(simulation)

    def write(self, simulation: Simulation) -> None:
        """Write a checkpoint; all that it refers to is there before the state itself."""
        with self.watch.time("checkpoint"):
            (self.folder / CHECKPOINT).mkdir(exist_ok=True)
            if not self._is_surface_kept and self.config.remesh:
                write_surface(self.folder, self.surface)
            self._is_surface_kept = True
            for i in range(self._pictures_kept, len(self.recorder.images)):
                write_png(self._picture(i, simulation), self.recorder.images[i], compression=1)
            self._pictures_kept = len(self.recorder.images)
            about = {**self.identity, "snapshots": self.recorder.figures}
            write_checkpoint(self.folder, Checkpoint(state_arrays(simulation), about))
        self._since = time.monotonic()

    def finish(self, simulation: Simulation) -> None:
        """Keep the last state, or none, as the config wants it."""
        if self.config.checkpoint.keep:
            self.write(simulation)
        else:
            shutil.rmtree(self.folder / CHECKPOINT, ignore_errors=True)

    def _picture(self, snapshot: int, simulation: Simulation) -> Path:
        step = self.recorder.figures[snapshot]["step"]
        return self.folder / CHECKPOINT / f"{snapshot_stem(step, simulation.steps)}.png"


def picture_parameters(config: Config) -> PictureParameters:
    """How the pictures of a run are taken."""
    colors = config.appearance
    return PictureParameters(
        look=colors.look,
        width=config.output.picture_width,
        height=config.output.picture_height,
        film_thickness=colors.thickness,
        paint=unit_color(colors.paint),
        primer=unit_color(colors.back),
        metal=unit_color(colors.metal),
        rust_rim=unit_color(colors.young_rust),
        rust_body=unit_color(colors.rust),
        rust_core=unit_color(colors.old_rust),
        stain=unit_color(colors.stain),
        dust=unit_color(colors.dust),
    )


def unit_color(color: tuple[int, int, int]) -> UnitColor:
    """A colour of the config, 0 to 255, as shares of 1."""
    return color[0] / 255, color[1] / 255, color[2] / 255
