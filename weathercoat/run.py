"""One asset, from file to finished folder."""

from __future__ import annotations

import fnmatch
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, fields
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import numpy as np

from weathercoat.compile import Compiling, remove_unused, watch_compiling
from weathercoat.config.load import LoadedConfig
from weathercoat.config.schema import Config
from weathercoat.deform.parameters import DeformParameters
from weathercoat.errors import CheckError, NoFacesError, Note, StrictError, WeathercoatError
from weathercoat.film.state import FilmParameters
from weathercoat.mesh.frame import make_frame
from weathercoat.mesh.read import read_stream, read_surface
from weathercoat.mesh.remesh import RemeshParameters, remesh
from weathercoat.mesh.surface import Surface
from weathercoat.output import folder as run_folder
from weathercoat.output.camera import Camera
from weathercoat.output.meshes import write_mesh
from weathercoat.output.pictures import (
    Image,
    PictureParameters,
    contact_sheet,
    frame_camera,
    render_snapshot,
    write_png,
)
from weathercoat.output.report import (
    make_report,
    make_timing,
    measure_snapshot,
    measure_surface,
    sha256,
    write_json,
)
from weathercoat.output.snapshots import write_snapshot_glb, write_snapshot_ply
from weathercoat.plan import make_plan
from weathercoat.sim.recorders import Recorder, run_simulation
from weathercoat.sim.simulation import Simulation, make_simulation
from weathercoat.sim.snapshot import Snapshot
from weathercoat.stain.color import Palette
from weathercoat.stain.rust import StainParameters

_Parameters = TypeVar("_Parameters", FilmParameters, DeformParameters, StainParameters)


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


def run_asset(
    loaded: LoadedConfig,
    model: str | Path | BinaryIO,
    out: str | Path,
    *,
    format: str | None = None,
    overwrite: bool = False,
    strict: bool = False,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
    log: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Age one model and write the folder `out`, whole or not at all; returns the report, with the timing as
    `timing`.

    model: a path, or a binary stream, for which `format` may be given. strict: any warning ends the run with
    StrictError. threads: how many share a step's work; their number changes no result. progress: called with
    the steps done and their number. log: called with each warning and with what was done, a line each.
    Errors: those of reading, of remeshing, and of `output.folder.RunFolder`.
    """
    say = log or (lambda line: None)
    watch = Stopwatch()
    with report_compiling(say), run_folder.RunFolder(out, overwrite=overwrite) as folder:
        with watch.time("read"):
            surface, inputs = _read(model, format, loaded.config)
        name = next(iter(inputs))
        with name_errors(name):
            report_notes(surface.notes, name, say, strict=strict)
            painted, untouched = split_paint(surface, loaded.config)
            plan = make_plan(loaded, painted, len(surface.faces))
            config = plan.loaded.config
            if plan.quality is not None:
                say(f"quality {plan.quality['asked']}: {plan.quality['why']}")
            with watch.time("remesh"):
                meshed = remesh_painted(painted, config)
            report_notes(meshed.notes[len(surface.notes) :], name, say, strict=strict)
            with watch.time("prepare"):
                simulation = prepare_simulation(meshed, config, painted, threads=threads)
        recorder = _SnapshotRecorder(folder, config, untouched, watch)
        due = config.snapshots.due(config.ageing.steps)
        run_simulation(simulation, [Recorder(due, recorder.record)], progress)

        if untouched is not None:
            with watch.time("write"):
                write_mesh(folder / "untouched.ply", untouched)
        if config.output.preview:
            with watch.time("pictures"):
                recorder.write_preview(folder / run_folder.PREVIEW)
        report = make_report(
            config=config.as_dict(),
            seed=config.seed,
            inputs=inputs,
            meshes={"input": measure_surface(surface), "film": measure_surface(simulation.surface)},
            notes=meshed.notes,
            quality=plan.quality,
            stopped=f"reached the end: step {simulation.step_count}, age {simulation.age:g}",
            solver=asdict(simulation.solving),
            snapshots=recorder.figures,
        )
        write_json(folder / run_folder.REPORT, report)
        around = {
            key: watch.seconds.get(key, 0.0) for key in ("read", "remesh", "prepare", "write", "pictures")
        }
        rows = {**simulation.seconds, "mesh": watch.seconds.get("mesh", 0.0)}
        timing = make_timing(rows, around)
        write_json(folder / run_folder.TIMING, timing)
    return {**report, "timing": timing}


def _read(model: str | Path | BinaryIO, format: str | None, config: Config) -> tuple[Surface, dict[str, str]]:
    """The repaired surface, and the SHA-256 of its file by name."""
    if isinstance(model, (str, Path)):
        surface = read_surface(model, format=format, up=config.model.up)
        return surface, {Path(model).name: sha256(Path(model))}
    content = model.read()
    return read_stream(BytesIO(content), format=format, up=config.model.up), {"-": sha256(content)}


@contextmanager
def report_compiling(say: Callable[[str], None]) -> Iterator[Compiling]:
    """Explain the wait where the block compiles kernels, and say how long it took; kernels of other versions
    that nobody has used for a month go.
    """
    with watch_compiling(
        lambda: say("compiling, which takes up to a minute after an installation; later runs start at once")
    ) as compiling:
        yield compiling
    if compiling.kernels:
        say(f"compiled {compiling.kernels} kernels in {compiling.seconds:.1f} s")
        remove_unused()


@contextmanager
def name_errors(name: str) -> Iterator[None]:
    """Name the model in errors of rooms that know no files."""
    try:
        yield
    except WeathercoatError as error:
        error.file = error.file or name
        raise


def report_notes(
    notes: Sequence[Note], name: str, say: Callable[[str], None], *, strict: bool = False
) -> None:
    """Say each note; raises StrictError for the first where `strict`."""
    for note in notes:
        say(f"{name}: {note.code}({note.count}): {note.message}")
    if strict and notes:
        first = notes[0]
        raise StrictError(f"{first.code}({first.count}): {first.message}", file=name)


def remesh_painted(painted: Surface, config: Config) -> Surface:
    """The surface as the config wants it for the simulation: remeshed, or as it is."""
    wanted = config.remesh
    if not wanted:
        return painted
    return remesh(
        painted, RemeshParameters(faces=wanted.faces, crease_angle=wanted.crease_angle, seed=config.seed)
    )


def split_paint(surface: Surface, config: Config) -> tuple[Surface, Surface | None]:
    """The faces that carry paint, and the others, or None; by the names of material groups or objects.

    Names that fit no group are noted. Raises NoFacesError where nothing is left to paint.
    """
    only, excluded = config.paint.only, config.paint.excluded
    idle = [name for name in (*only, *excluded) if not fnmatch.filter(surface.groups, name)]
    if idle:
        what = (
            f"names of paint.only and paint.except fit none of {', '.join(surface.groups)}: {', '.join(idle)}"
        )
        surface = surface.with_notes(Note("W-GROUP", len(idle), what))

    def is_painted(group: str) -> bool:
        wanted = not only or any(fnmatch.fnmatchcase(group, pattern) for pattern in only)
        return wanted and not any(fnmatch.fnmatchcase(group, pattern) for pattern in excluded)

    painted_groups = np.array([is_painted(group) for group in surface.groups])
    keep = painted_groups[surface.face_group]
    if keep.all():
        return surface, None
    if not keep.any():
        raise NoFacesError(
            "no face carries paint by paint.only and paint.except",
            file=surface.name,
            remedy=f"the model's groups are {', '.join(surface.groups)}",
        )
    return surface.select_faces(keep), surface.select_faces(~keep)


def prepare_simulation(
    surface: Surface, config: Config, painted: Surface | None = None, *, threads: int = 1
) -> Simulation:
    """A simulation of a surface by a config, at age 0.

    painted: the surface before remeshing, whose frame places noise and defects, so that they lie alike at
    every resolution. Raises CheckError where the surface is no oriented manifold.
    """
    colors = config.appearance
    try:
        return make_simulation(
            surface,
            film=fill(FilmParameters, config),
            deform=fill(DeformParameters, config),
            stain=fill(StainParameters, config),
            palette=Palette(
                paint=_unit_color(colors.paint),
                metal=_unit_color(colors.metal),
                rust=_unit_color(colors.rust),
            ),
            steps=config.ageing.steps,
            duration=config.ageing.duration,
            seed=config.seed,
            frame=None if painted is None else make_frame(painted),
            threads=threads,
        )
    except ValueError as error:
        raise CheckError(f"the mesh for the simulation is no manifold: {error}", file=surface.name) from error


def fill(kind: type[_Parameters], config: Config) -> _Parameters:
    """The parameters of a core room from the config: the field `adhesion_base` is the key `adhesion.base`."""
    values = {}
    for parameter in fields(kind):
        section, _, key = parameter.name.partition("_")
        values[parameter.name] = getattr(getattr(config, section), key)
    return kind(**values)


def picture_parameters(config: Config) -> PictureParameters:
    """How the pictures of a run are taken."""
    colors = config.appearance
    return PictureParameters(
        width=config.output.picture_width,
        height=config.output.picture_height,
        film_thickness=colors.thickness,
        paint=_unit_color(colors.paint),
        primer=_unit_color(colors.back),
        metal=_unit_color(colors.metal),
        rust_body=_unit_color(colors.rust),
        dust=_unit_color(colors.dust),
    )


def _unit_color(color: tuple[int, int, int]) -> tuple[float, float, float]:
    return color[0] / 255, color[1] / 255, color[2] / 255


class _SnapshotRecorder:
    """Writes each snapshot as it is due and keeps its figures and its picture."""

    def __init__(self, folder: Path, config: Config, untouched: Surface | None, watch: Stopwatch) -> None:
        self.folder = folder / run_folder.SNAPSHOTS
        self.folder.mkdir()
        self.config = config
        self.untouched = untouched
        self.watch = watch
        self.figures: list[dict[str, Any]] = []
        self.images: list[Image] = []
        self.labels: list[str] = []
        self.camera: Camera | None = None

    def record(self, simulation: Simulation) -> None:
        """Write the snapshot of this moment in every wanted format, measure and draw it."""
        with self.watch.time("mesh"):
            snapshot = simulation.snapshot()
        with self.watch.time("write"):
            self._write(snapshot, simulation)
            residual = simulation.residual()
            size = simulation.frame.size
            self.figures.append(
                measure_snapshot(
                    snapshot,
                    flake_areas=np.asarray(simulation.flake_areas) * size**2,
                    strain=residual.strain_rms,
                    residual=residual.angle_rms,
                    energy=residual.energy,
                    imbalance=residual.imbalance,
                )
            )
        if self.config.output.preview:
            with self.watch.time("pictures"):
                self._draw(snapshot, simulation.surface.up)

    def _write(self, snapshot: Snapshot, simulation: Simulation) -> None:
        stem = run_folder.snapshot_stem(snapshot.step, simulation.steps)
        if "ply" in self.config.output.formats:
            write_snapshot_ply(self.folder, snapshot, stem)
        if "glb" in self.config.output.formats:
            write_snapshot_glb(
                self.folder / f"{stem}.glb",
                snapshot,
                thickness=self.config.appearance.thickness * simulation.frame.size,
                back_color=_unit_color(self.config.appearance.back),
                up=simulation.surface.up,
                untouched=self.untouched,
            )

    def _draw(self, snapshot: Snapshot, up: tuple[float, float, float]) -> None:
        parameters = picture_parameters(self.config)
        # of what does not move, and so the same for all snapshots
        self.camera = self.camera or frame_camera(snapshot, parameters, up=up, untouched=self.untouched)
        self.images.append(
            render_snapshot(snapshot, parameters, up=up, untouched=self.untouched, camera=self.camera)
        )
        self.labels.append(f"age {snapshot.age:g}")

    def write_preview(self, path: Path) -> None:
        """Put the pictures of all snapshots on one sheet."""
        write_png(path, contact_sheet(self.images, self.labels))
