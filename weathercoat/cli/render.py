"""`weathercoat render`: pictures of a finished run, still and moving."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import click

from weathercoat.cli import options
from weathercoat.cli.writing import STANDARD_OUTPUT, open_output, say_written
from weathercoat.errors import UsageError, WeathercoatError

if TYPE_CHECKING:
    import numpy as np

    from weathercoat.finished import FinishedRun
    from weathercoat.mesh.surface import Surface
    from weathercoat.output.camera import Camera
    from weathercoat.output.pictures import Image, PictureParameters
    from weathercoat.sim.snapshot import Snapshot

_PASSES = ("beauty", "class", "depth", "normal", "instance")
_LIGHTS = ("studio", "daylight", "overcast", "evening")
_TURN_SECONDS = 6.0
_SNAPSHOT_SECONDS = 0.6


class _Step(click.ParamType):
    """The number of a step, or the word all."""

    name = "step"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int | str:
        return "all" if value == "all" else int(click.INT.convert(value, param, ctx))


class _Passes(click.ParamType):
    """Names of passes with commas between them, or the word all."""

    name = "passes"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, ...]:
        wanted = set(_PASSES) if value == "all" else set(value.split(","))
        unknown = sorted(wanted - set(_PASSES))
        if unknown:
            self.fail(f"{unknown[0]!r} is none of {', '.join(_PASSES)}.", param, ctx)
        return tuple(name for name in _PASSES if name in wanted)


@click.command()
@click.argument("run", type=click.Path(path_type=Path))
@options.output("PNG or WebP; WebP, GIF or MP4 where it moves; - for standard output.", required=True)
@click.option(
    "--step",
    type=_Step(),
    metavar="N|all",
    help="Draw the snapshot of this step alone, not a sheet of all; with --passes the last by default.",
)
@click.option(
    "--model",
    type=click.Path(path_type=Path),
    help="The model that the run was made of, for its textures; by default the file of its name beside RUN.",
)
@click.option(
    "--turntable",
    type=click.IntRange(2, 10_000),
    metavar="N",
    help="Go once round the model in N frames, at the last snapshot or that of --step.",
)
@click.option("--timelapse", is_flag=True, help="Show one snapshot after the other, as many as the run has.")
@click.option(
    "--seconds",
    type=click.FloatRange(0.05, 3600.0),
    metavar="S",
    help="How long it takes: 6 for a turn, 0.6 for a snapshot by default.",
)
@click.option("--loop/--no-loop", default=True, help="Whether it begins again at its end.")
@click.option("--width", type=click.IntRange(16, 16_384), metavar="PIXELS", help="Width of a picture.")
@click.option("--height", type=click.IntRange(16, 16_384), metavar="PIXELS", help="Height of a picture.")
@click.option("--azimuth", type=float, metavar="DEGREES", help="Turn of the view about the model.")
@click.option("--elevation", type=click.FloatRange(-89, 89), metavar="DEGREES", help="Height of the view.")
@click.option("--zoom", type=click.FloatRange(0.05, 200.0), metavar="FACTOR", help="Come nearer.")
@click.option(
    "--look-at",
    type=(float, float, float),
    metavar="X Y Z",
    help="The point of the model in the middle of the picture.",
)
@click.option("--light", type=click.Choice(_LIGHTS), help="The light; studio by default.")
@click.option(
    "--background",
    metavar="COLOR",
    help="grey, white, black, dark, transparent or a colour such as #203040; grey by default.",
)
@click.option("--ground/--no-ground", "has_ground", default=None, help="Whether a shadow falls on a ground.")
@click.option(
    "--passes",
    type=_Passes(),
    metavar="LIST",
    help="Write a folder of labelled pictures: some of beauty,class,depth,normal,instance, or all.",
)
@click.option(
    "--cameras", type=click.Path(path_type=Path), help="Their cameras, a JSON file as labels.json is one."
)
@click.option("--views", type=click.IntRange(1, 1_000_000), metavar="N", help="Or N sampled cameras.")
@click.option("--seed", type=click.IntRange(min=0), metavar="N", help="Seed of the sampled cameras; 0.")
@options.overwrite
@options.as_json
@options.debug
def command(
    run: Path,
    output: Path,
    step: int | str | None,
    model: Path | None,
    turntable: int | None,
    timelapse: bool,
    seconds: float | None,
    loop: bool,
    zoom: float | None,
    look_at: tuple[float, float, float] | None,
    passes: tuple[str, ...] | None,
    cameras: Path | None,
    views: int | None,
    seed: int | None,
    overwrite: bool,
    as_json: bool,
    **look: Any,
) -> None:
    """Draw RUN, the folder of a finished run or its folder of snapshots: a sheet of all snapshots, one of
    them, a turn round it, or a time-lapse; with --passes a folder of labelled pictures.
    """
    from weathercoat.cli.messages import Messages
    from weathercoat.run import report_compiling

    changes = {name: value for name, value in look.items() if value is not None}
    if "background" in changes:
        changes["background"] = _background(changes["background"])
    if passes is not None:
        moving = {"--turntable": turntable, "--timelapse": timelapse, "--seconds": seconds}
        _refuse({**moving, "--zoom": zoom, "--look-at": look_at}, "--passes")
        source = _CameraSource(cameras, views, seed)
        _label(run, output, step, model, passes, source, changes, overwrite=overwrite, as_json=as_json)
        return
    _refuse({"--cameras": cameras, "--views": views, "--seed": seed}, "pictures without --passes")
    number = None if step is None or step == "all" else int(step)
    if as_json and output == STANDARD_OUTPUT:
        raise UsageError("--json and -o - both write to standard output", remedy="give a file to -o")
    moves = turntable is not None or timelapse
    if seconds is not None and not moves:
        raise UsageError("--seconds is for what moves", remedy="give --turntable or --timelapse")
    if timelapse and number is not None:
        raise UsageError("--timelapse shows all snapshots, --step one", remedy="give one of them")
    kind = _kind(output, moves)
    with (
        Messages(quiet=as_json) as messages,
        report_compiling(messages.log),
        open_output(output, "a picture", overwrite=overwrite) as stream,
    ):
        stage = _stage(_open(run, number, model, messages.log), changes, zoom, look_at)
        if moves:
            _write_moving(
                stream, stage, kind, turntable=turntable, timelapse=timelapse, seconds=seconds, loop=loop
            )
        else:
            _write_still(stream, stage, kind, is_sheet=number is None)
    say_written(output, as_json=as_json)


def _kind(output: Path, moves: bool) -> str:
    """The format by the extension, which is checked before any work."""
    from weathercoat.output.animation import MOVING, STILLS

    if output == STANDARD_OUTPUT:
        return ".webp" if moves else ".png"
    kind, kinds = output.suffix.lower(), MOVING if moves else STILLS
    if kind not in kinds:
        what = "what moves" if moves else "a still picture"
        raise UsageError(
            f"no format for {what} has the extension {kind!r}",
            file=str(output),
            remedy=f"use {', '.join(kinds)}"
            + (" or give --turntable or --timelapse" if kind in MOVING else ""),
        )
    return kind


def _background(text: str) -> tuple[float, float, float] | None:
    from weathercoat.output.lights import BACKGROUNDS

    if text in BACKGROUNDS:
        return BACKGROUNDS[text]
    try:
        if len(text) != 7 or text[0] != "#":
            raise ValueError
        red, green, blue = (int(text[at : at + 2], 16) / 255 for at in (1, 3, 5))
    except ValueError:
        raise UsageError(
            f"--background {text} is no colour", remedy=f"use {', '.join(BACKGROUNDS)} or one such as #203040"
        ) from None
    return red, green, blue


def _refuse(given: dict[str, Any], where: str) -> None:
    """Raise UsageError for an option that has no meaning here."""
    for name, value in given.items():
        if value is not None and value is not False:
            raise UsageError(f"{name} is not for {where}", remedy="leave one of them out")


@dataclass(frozen=True)
class _Opened:
    """What is read of a run: snapshots and the parts without paint, with the materials of its model."""

    finished: FinishedRun
    snapshots: Sequence[Snapshot]
    untouched: Surface | None


def _open(run: Path, step: int | None, model: Path | None, log: Callable[[str], None]) -> _Opened:
    """The snapshots of a run, or that of one step. Where the model is not there, which is said, film and
    parts have one colour each.
    """
    from weathercoat.finished import open_run
    from weathercoat.run import split_paint

    finished = open_run(run)
    snapshots = [finished.read_snapshot(number) for number in (finished.steps if step is None else [step])]
    untouched = finished.untouched
    surfaces = [snapshot.surface for snapshot in snapshots]
    if untouched is None and all(surface is None or surface.face_part is None for surface in surfaces):
        return _Opened(finished, snapshots, untouched)
    try:
        source = finished.read_model(model)
    except WeathercoatError as error:
        if model is not None:
            raise
        log(f"no textures: {error}")
        return _Opened(finished, snapshots, untouched)
    if untouched is not None:
        untouched = split_paint(source, finished.config)[1]
    dressed = [
        snapshot
        if surface is None
        else replace(snapshot, surface=replace(surface, parts=source.parts, materials=source.materials))
        for snapshot, surface in zip(snapshots, surfaces, strict=True)
    ]
    return _Opened(finished, dressed, untouched)


@dataclass(frozen=True)
class _Stage:
    """What is drawn: snapshots of a run, how, and from where."""

    opened: _Opened
    parameters: PictureParameters
    camera: Camera
    narrowed: Callable[[Camera], Camera]

    def draw(self, snapshot: Snapshot, camera: Camera) -> Image:
        """The picture of a snapshot."""
        from weathercoat.output.pictures import render_snapshot

        return render_snapshot(
            snapshot,
            self.parameters,
            up=self.opened.finished.up,
            untouched=self.opened.untouched,
            camera=self.narrowed(camera),
        )

    def round(self, count: int) -> list[Camera]:
        """Cameras once round everything that any of the snapshots shows."""
        import numpy as np

        from weathercoat.output.camera import turntable
        from weathercoat.output.display import Normalisation
        from weathercoat.output.pictures import framed_points

        points, _ = framed_points(
            self.opened.snapshots[0], untouched=self.opened.untouched, films=self.opened.snapshots
        )
        points = Normalisation.of(self.opened.snapshots[0])(points)
        return turntable(
            self.camera, points, np.asarray(self.opened.finished.up), count, margin=self.parameters.margin
        )


def _stage(
    opened: _Opened,
    changes: dict[str, Any],
    zoom: float | None,
    look_at: tuple[float, float, float] | None,
) -> _Stage:
    import numpy as np

    from weathercoat.output.camera import zoomed
    from weathercoat.output.display import Normalisation
    from weathercoat.output.pictures import frame_camera
    from weathercoat.recording import picture_parameters

    snapshots, up = opened.snapshots, opened.finished.up
    parameters = replace(picture_parameters(opened.finished.config), **changes)
    camera = frame_camera(snapshots[0], parameters, up=up, untouched=opened.untouched, films=snapshots)
    centre: np.ndarray[Any, Any] | None = None
    if look_at is not None:
        centre = Normalisation.of(snapshots[0])(np.array([look_at]))[0]

    def narrowed(camera: Camera) -> Camera:
        return zoomed(camera, zoom or 1.0, centre)

    return _Stage(opened, parameters, camera, narrowed)


def _write_still(stream: BinaryIO, stage: _Stage, kind: str, *, is_sheet: bool) -> None:
    from weathercoat.output.animation import write_animation
    from weathercoat.output.pictures import contact_sheet, write_png

    images = [stage.draw(snapshot, stage.camera) for snapshot in stage.opened.snapshots]
    image = images[0]
    if is_sheet:
        image = contact_sheet(images, [f"age {snapshot.age:g}" for snapshot in stage.opened.snapshots])
    if kind == ".png":
        write_png(stream, image)
    else:
        write_animation(stream, [image], kind, [1.0])


def _write_moving(
    stream: BinaryIO,
    stage: _Stage,
    kind: str,
    *,
    turntable: int | None,
    timelapse: bool,
    seconds: float | None,
    loop: bool,
) -> None:
    from weathercoat.output.animation import write_animation

    snapshots = stage.opened.snapshots if timelapse else stage.opened.snapshots[-1:]
    if turntable is None:
        cameras, whole = [stage.camera] * len(snapshots), _SNAPSHOT_SECONDS * len(snapshots)
    else:
        cameras, whole = stage.round(turntable), _TURN_SECONDS
    count = len(cameras)
    images = [
        stage.draw(snapshots[index * len(snapshots) // count], camera) for index, camera in enumerate(cameras)
    ]
    write_animation(stream, images, kind, [(seconds or whole) / count] * count, loop=loop)


@dataclass(frozen=True)
class _CameraSource:
    """Where the cameras of labelled pictures come from: a file, or a number of sampled ones."""

    file: Path | None
    count: int | None
    seed: int | None

    def __post_init__(self) -> None:
        if (self.file is None) == (self.count is None):
            raise UsageError("--passes needs --cameras or --views, and not both", remedy="give one of them")
        if self.file is not None and self.seed is not None:
            raise UsageError("--seed is for sampled cameras", remedy="give --views instead of --cameras")


def _label(
    run: Path,
    output: Path,
    step: int | str | None,
    model: Path | None,
    passes: tuple[str, ...],
    source: _CameraSource,
    changes: dict[str, Any],
    *,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write labelled pictures into the folder `output`."""
    import numpy as np

    from weathercoat.cli.messages import Messages
    from weathercoat.finished import open_run
    from weathercoat.output.folder import RunFolder
    from weathercoat.output.labels.cameras import read_views
    from weathercoat.output.labels.dataset import LABELS, LabelledRun, LabelRequest, write_labels
    from weathercoat.recording import picture_parameters
    from weathercoat.run import report_compiling

    if output == STANDARD_OUTPUT:
        raise UsageError("--passes writes a folder, not standard output", remedy="name one with -o")
    with Messages(quiet=as_json) as messages, report_compiling(messages.log):
        finished = open_run(run)
        wanted = None if step == "all" else (finished.steps[-1] if step is None else int(step))
        opened = _open(run, wanted, model, messages.log)
        parameters = replace(picture_parameters(finished.config), **changes)
        size = parameters.width, parameters.height
        request = LabelRequest(
            passes,
            () if source.file is None else read_views(source.file, np.array(finished.up), *size),
            source.count or 0,
            source.seed or 0,
            *size,
        )
        report = finished.report
        about = {
            "name": finished.path.resolve().name,
            "fingerprint": report["fingerprint"],
            "seed": report["seed"],
            "inputs": report["inputs"],
            "config": report["config"],
        }
        severity = {int(row["step"]): row["severity"] for row in report["snapshots"] if "severity" in row}
        with RunFolder(output, overwrite=overwrite, marker=LABELS) as folder:
            count = write_labels(
                folder,
                opened.snapshots,
                LabelledRun(about, finished.up, opened.untouched, severity),
                parameters,
                request,
                messages.progress,
            )
    say_written(output, f"{count} pictures of {', '.join(passes)}", as_json=as_json)
