"""One asset, from file to finished folder."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, dataclass, fields, replace
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import numpy as np
from numpy.typing import NDArray

from weathercoat.baking import require_maps, write_run_maps
from weathercoat.compile import Compiling, remove_unused, watch_compiling
from weathercoat.config.load import LoadedConfig
from weathercoat.config.schema import Config
from weathercoat.cost import require_memory, require_memory_to_read
from weathercoat.deform.parameters import DeformParameters
from weathercoat.errors import (
    CheckError,
    NoFacesError,
    Note,
    ResumeError,
    StrictError,
    WeathercoatError,
    printable,
)
from weathercoat.film.state import FilmParameters
from weathercoat.finished import with_materials
from weathercoat.lock import LOCK
from weathercoat.masks.evaluate import make_changes, require_masks
from weathercoat.masks.files import NO_MASKS, MaskSource, hash_masks, mask_source
from weathercoat.memory import MemoryLimit, memory_limit
from weathercoat.mesh.frame import make_frame
from weathercoat.mesh.read import MAX_BYTES, name_of, read_stream, read_surface, side_files
from weathercoat.mesh.remesh import RemeshParameters, remesh
from weathercoat.mesh.surface import Place, Surface
from weathercoat.output.checkpoints import Checkpoint, read_kept_surface
from weathercoat.output.folder import (
    CHECKPOINT_STATE,
    PREVIEW,
    REPORT,
    SEVERITY,
    TIMING,
    UNTOUCHED,
    VIEWER,
    RunFolder,
    kept_in,
    snapshot_files,
)
from weathercoat.output.meshes import write_mesh
from weathercoat.output.report import (
    make_report,
    make_timing,
    manifest,
    measure_surface,
    rounded,
    sha256,
    write_json,
)
from weathercoat.output.severity import write_table
from weathercoat.output.snapshots import read_snapshot_ply
from weathercoat.plan import Plan, make_plan
from weathercoat.recording import (
    CheckpointKeeper,
    SnapshotRecorder,
    Stopwatch,
    picture_parameters,
    unit_color,
)
from weathercoat.resume import (
    fingerprint,
    identify,
    is_past,
    read_finished,
    recorded_figures,
    take_up,
)
from weathercoat.sim.recorders import Patience, Recorder, run_simulation
from weathercoat.sim.simulation import Simulation, make_simulation
from weathercoat.stain.color import Palette
from weathercoat.stain.rust import StainParameters
from weathercoat.until import Until, require_groups
from weathercoat.verification.run import require_whole

_Parameters = TypeVar("_Parameters", FilmParameters, DeformParameters, StainParameters)
_AROUND = (
    "read",
    "remesh",
    "prepare",
    "checkpoint",
    "write",
    "pictures",
    "maps",
    "check",
)  # what is timed beside the steps
# The key of the environment that each parameter is multiplied with.
_FACTORS = {
    "adhesion_decay_rate": "wear",
    "cohesion_decay_rate": "wear",
    "rust_source_rate": "corrosion",
    "rust_lifted_rate": "corrosion",
    "rust_bare_rate": "corrosion",
    "rust_runoff_length": "rain",
    "dust_rate": "dirt",
}


@dataclass(frozen=True)
class _Intake:
    """A model that was taken in: its surface, the parts with and without paint, SHA-256 by file name, and
    the plan of its run.
    """

    surface: Surface
    painted: Surface
    untouched: Surface | None
    inputs: dict[str, str]
    plan: Plan

    @property
    def name(self) -> str:
        return next(iter(self.inputs))


def run_asset(
    loaded: LoadedConfig,
    model: str | Path | BinaryIO,
    out: str | Path,
    *,
    format: str | None = None,
    overwrite: bool = False,
    resume: bool = False,
    strict: bool = False,
    check: bool = True,
    threads: int = 1,
    max_memory: int | None = None,
    progress: Callable[[int, int], None] | None = None,
    log: Callable[[str], None] | None = None,
    patience: Patience | None = None,
) -> dict[str, Any]:
    """Age one model and write the folder `out`, whole or not at all; returns the report, with the timing as
    `timing` unless nothing was left to do.

    model: a path, or a binary stream, for which `format` may be given. resume: go on from what an
    interrupted run left in `OUT.partial`, or extend the finished run in `out`; begin where there is neither.
    strict: any warning ends the run with StrictError. check: whether the result is verified before the folder
    is put in place; CheckError where it is not whole. threads: how many share a step's work; their number
    changes no result. max_memory: bytes; a run that is expected to need more is refused with LimitError, by
    default one that needs more than this process may use. progress: called with the steps done and their
    number. log: called with each warning and with what was done, a line each. patience: entered while steps
    are made; where it is asked to stop, a checkpoint is written first. Errors: those of reading, of
    remeshing, of `resume`, and of `output.folder.RunFolder`; one that leaves work to go on from says where in
    its notes.
    """
    say = log or (lambda line: None)
    watch = Stopwatch()
    run_folder = RunFolder(out, overwrite=overwrite, resume=resume)
    with report_compiling(say), _note_what_is_kept(run_folder), run_folder as folder:
        with watch.time("read"):
            intake = _take_in(loaded, model, format, say, memory_limit(max_memory), strict=strict)
        config = intake.plan.loaded.config
        identity = identify(config, intake.inputs)
        checkpoint = None
        was_interrupted = (folder / CHECKPOINT_STATE).is_file()
        if resume:
            finished = read_finished(run_folder.target, identity)
            if finished is not None:
                say(f"{out}: finished already")
                run_folder.abandon()
                return finished
            checkpoint = take_up(run_folder, config, identity, say)
        with name_errors(intake.name), watch.time("remesh"):
            meshed = _mesh(intake, checkpoint, folder)
        report_notes(meshed.notes[len(intake.surface.notes) :], intake.name, say, strict=strict)
        with name_errors(intake.name), watch.time("prepare"):
            simulation = prepare_simulation(
                meshed, config, intake.painted, threads=threads, masks=mask_source(loaded)
            )

        recorder = SnapshotRecorder(folder, config, intake.untouched, watch)
        keeper = CheckpointKeeper(folder, config, meshed, identity, recorder, watch)
        if checkpoint:
            keeper.restore(simulation, checkpoint, recorded_figures(checkpoint, config))
            say(f"going on from step {simulation.step_count:,} of {simulation.steps:,}")
        until = Until(config.ageing.until, simulation.surface)
        if checkpoint and is_past(checkpoint, config, until.reached(simulation)):
            if not was_interrupted:
                run_folder.clear()  # all that it holds is still in the finished folder
            what = f"step {checkpoint.step} is past {until.reached(simulation)}"
            raise ResumeError(what, file=str(out))
        due = config.snapshots.due(config.ageing.steps)
        recorders = [Recorder(due, recorder.record), Recorder(range(simulation.steps), keeper.consider)]
        with patience or nullcontext():
            run_simulation(
                simulation,
                recorders,
                progress,
                patience=patience,
                before_stop=keeper.write,
                is_enough=lambda now: until.reached(now) is not None,
            )
        stopped = until.why_it_ended(simulation)
        if config.ageing.until:
            say(stopped)
            if simulation.step_count not in due:
                recorder.record(simulation)
        keeper.finish(simulation)

        if intake.untouched is not None:
            with watch.time("write"):
                write_mesh(folder / UNTOUCHED, intake.untouched)
        if config.output.preview:
            with watch.time("pictures"):
                recorder.write_preview(folder / PREVIEW)
        if config.output.viewer:
            with watch.time("pictures"):
                _write_viewer(folder, config, simulation, recorder, intake.untouched)
        table = write_table(rounded(recorder.figures))
        (folder / SEVERITY).write_bytes(table.encode("utf-8", "backslashreplace"))
        if config.maps.when != "never":
            with watch.time("maps"):
                is_painted = painted_faces(intake.surface, config)
                write_run_maps(folder, intake.surface, is_painted, config, threads=threads)
        report = _report(intake, meshed.notes, simulation, recorder, stopped, folder)
        report["fingerprint"] = fingerprint(loaded, intake.inputs)
        write_json(folder / REPORT, report)
        if check:
            with watch.time("check"), name_errors(intake.name):
                require_whole(folder, ignored={LOCK})
        timing = make_timing(
            {**simulation.seconds, "mesh": watch.seconds.get("mesh", 0.0)},
            {key: watch.seconds.get(key, 0.0) for key in _AROUND},
        )
        write_json(folder / TIMING, timing)
    return {**report, "timing": timing}


def _write_viewer(
    folder: Path,
    config: Config,
    simulation: Simulation,
    recorder: SnapshotRecorder,
    untouched: Surface | None,
) -> None:
    """Write the page that shows the run, from the snapshots as they were written."""
    from weathercoat.output.viewer.page import write_page

    with (folder / VIEWER).open("wb") as stream:
        write_page(
            stream,
            [
                with_materials(read_snapshot_ply(path), simulation.surface)
                for path in snapshot_files(folder).values()
            ],
            rounded(recorder.figures),
            picture_parameters(config),
            name=simulation.surface.name,
            up=simulation.surface.up,
            untouched=untouched,
        )


def _take_in(
    loaded: LoadedConfig,
    model: str | Path | BinaryIO,
    format: str | None,
    say: Callable[[str], None],
    limit: MemoryLimit | None,
    *,
    strict: bool,
) -> _Intake:
    masks = hash_masks(loaded)
    surface, inputs = _read(model, format, loaded.config, limit)
    name = next(iter(inputs))
    with name_errors(name):
        report_notes(surface.notes, name, say, strict=strict)
        painted, untouched = split_paint(surface, loaded.config)
        require_maps(surface, loaded.config)
        require_masks(loaded.config.steering, painted, loaded.origins["steering"])
        require_groups(loaded.config.ageing.until, painted)
        plan = make_plan(loaded, painted, len(surface.faces))
        require_memory(plan.loaded.config, plan.model_faces, limit)
    if plan.quality is not None:
        say(f"quality {plan.quality['asked']}: {plan.quality['why']}")
    return _Intake(surface, painted, untouched, {**inputs, **masks}, plan)


def _mesh(intake: _Intake, checkpoint: Checkpoint | None, folder: Path) -> Surface:
    """The surface to simulate: the one that the checkpoint is of, or as the config wants it."""
    config = intake.plan.loaded.config
    if checkpoint and config.remesh:
        kept, model = read_kept_surface(folder), intake.surface
        return replace(kept, parts=model.parts, materials=model.materials, tree=model.tree)
    return placed_on(intake.surface, intake.painted, remesh_painted(intake.painted, config))


def _report(
    intake: _Intake,
    notes: Sequence[Note],
    simulation: Simulation,
    recorder: SnapshotRecorder,
    stopped: str,
    folder: Path,
) -> dict[str, Any]:
    """The content of `run.json` for a simulation at its end, with all other files in the folder."""
    config = intake.plan.loaded.config
    return make_report(
        config=config.as_dict(),
        seed=config.seed,
        inputs=intake.inputs,
        meshes={"input": measure_surface(intake.surface), "film": measure_surface(simulation.surface)},
        notes=notes,
        quality=intake.plan.quality,
        stopped=stopped,
        solver=asdict(simulation.solving),
        snapshots=recorder.figures,
        files=manifest(folder),
    )


@contextmanager
def _note_what_is_kept(run_folder: RunFolder) -> Iterator[None]:
    """Note on whatever ends the run early where its work is kept, if there is any to go on from."""
    try:
        yield
    except BaseException as error:
        if run_folder.is_kept:
            error.add_note(kept_in(run_folder.path))
        raise


def _read(
    model: str | Path | BinaryIO, format: str | None, config: Config, limit: MemoryLimit | None
) -> tuple[Surface, dict[str, str]]:
    """The repaired surface, and the SHA-256 of its file by name."""
    if isinstance(model, (str, Path)):
        require_memory_to_read(Path(model), limit)
        surface = read_surface(model, format=format, up=config.model.up)
        return surface, hash_inputs(Path(model))
    content = model.read(MAX_BYTES + 1)  # one too many is refused below
    return read_stream(BytesIO(content), format=format, up=config.model.up), {"-": sha256(content)}


def hash_job(loaded: LoadedConfig, model: Path) -> dict[str, str]:
    """SHA-256 of all files that a run needs, by name: those of the model, then those of its masks."""
    return {**hash_inputs(model), **hash_masks(loaded)}


def hash_inputs(model: Path) -> dict[str, str]:
    """SHA-256 of a model's file, and then of those beside it that it needs, by name.

    Raises AccessError where one cannot be read.
    """
    return {name_of(file): sha256(file) for file in (model, *side_files(model))}


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
        say(f"{printable(name)}: {note.line()}")
    if strict and notes:
        first = notes[0]
        raise StrictError(f"{first.code}({first.count}): {first.message}", file=name)


def placed_on(model: Surface, painted: Surface, meshed: Surface) -> Surface:
    """The surface `meshed`, made of the part `painted` of a model, with its places on the whole model."""
    place = meshed.place
    if place is None:  # it is the painted part as it was: each vertex lies at a corner of a face
        corner = np.zeros(len(meshed.vertices), np.int64)
        corner[meshed.faces.ravel()] = np.arange(meshed.faces.size)
        place = Place((corner // 3).astype(np.int32), np.eye(3)[corner % 3])
    if painted is not model:  # parts are left out by whole groups
        kept = np.flatnonzero(np.isin(model.face_group, painted.face_group)).astype(np.int32)
        place = Place(kept[place.face], place.barycentric)
    return replace(meshed, place=place)


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

    keep = painted_faces(surface, config)
    if keep.all():
        return surface, None
    if not keep.any():
        raise NoFacesError(
            "no face carries paint by paint.only and paint.except",
            file=surface.name,
            remedy=f"the model's groups are {', '.join(surface.groups)}",
        )
    return surface.select_faces(keep), surface.select_faces(~keep)


def painted_faces(surface: Surface, config: Config) -> NDArray[np.bool_]:
    """Whether each face of a model carries paint, (m,)."""
    only, excluded = config.paint.only, config.paint.excluded

    def is_painted(group: str) -> bool:
        wanted = not only or any(fnmatch.fnmatchcase(group, pattern) for pattern in only)
        return wanted and not any(fnmatch.fnmatchcase(group, pattern) for pattern in excluded)

    painted_groups = np.array([is_painted(group) for group in surface.groups])
    return painted_groups[surface.face_group]


def prepare_simulation(
    surface: Surface,
    config: Config,
    painted: Surface | None = None,
    *,
    threads: int = 1,
    masks: MaskSource = NO_MASKS,
) -> Simulation:
    """A simulation of a surface by a config, at age 0.

    painted: the surface before remeshing, whose frame places noise and defects, so that they lie alike at
    every resolution. masks: where `steering` and its files are from. Raises CheckError where the surface is
    no oriented manifold, and ConfigError where a mask does not fit it.
    """
    colors = config.appearance
    try:
        simulation = make_simulation(
            surface,
            film=fill(FilmParameters, config),
            deform=fill(DeformParameters, config),
            stain=fill(StainParameters, config),
            palette=Palette(
                paint=unit_color(colors.paint),
                metal=unit_color(colors.metal),
                rust=unit_color(colors.rust),
            ),
            steps=config.ageing.steps,
            duration=config.ageing.duration,
            seed=config.seed,
            frame=None if painted is None else make_frame(painted),
            threads=threads,
        )
    except ValueError as error:
        raise CheckError(f"the mesh for the simulation is no manifold: {error}", file=surface.name) from error
    if config.steering:
        simulation.steer(make_changes(config.steering, simulation, masks))
    return simulation


def fill(kind: type[_Parameters], config: Config) -> _Parameters:
    """The parameters of a core room from the config: the field `adhesion_base` is the key `adhesion.base`,
    times what the environment makes of it.
    """
    values = {}
    for parameter in fields(kind):
        section, _, key = parameter.name.partition("_")
        value = getattr(getattr(config, section), key)
        factor = _FACTORS.get(parameter.name)
        values[parameter.name] = value if factor is None else value * getattr(config.environment, factor)
    return kind(**values)
