"""`weathercoat render`: pictures of a finished run, still and moving."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import click

from weathercoat.cli import options
from weathercoat.cli.writing import STANDARD_OUTPUT, open_output, say_written
from weathercoat.errors import UsageError

if TYPE_CHECKING:
    import numpy as np

    from weathercoat.finished import FinishedRun
    from weathercoat.output.camera import Camera
    from weathercoat.output.pictures import Image, PictureParameters
    from weathercoat.sim.snapshot import Snapshot

_LIGHTS = ("studio", "daylight", "overcast", "evening")
_TURN_SECONDS = 6.0
_SNAPSHOT_SECONDS = 0.6


@click.command()
@click.argument("run", type=click.Path(path_type=Path))
@options.output("PNG or WebP; WebP, GIF or MP4 where it moves; - for standard output.", required=True)
@click.option(
    "--step", type=int, metavar="N", help="Draw the snapshot of this step alone, not a sheet of all."
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
@options.overwrite
@options.as_json
@options.debug
def command(
    run: Path,
    output: Path,
    step: int | None,
    turntable: int | None,
    timelapse: bool,
    seconds: float | None,
    loop: bool,
    zoom: float | None,
    look_at: tuple[float, float, float] | None,
    overwrite: bool,
    as_json: bool,
    **look: Any,
) -> None:
    """Draw RUN, the folder of a finished run or its folder of snapshots: a sheet of all snapshots, one of
    them, a turn round it, or a time-lapse.
    """
    from weathercoat.cli.messages import Messages
    from weathercoat.run import report_compiling

    if as_json and output == STANDARD_OUTPUT:
        raise UsageError("--json and -o - both write to standard output", remedy="give a file to -o")
    moves = turntable is not None or timelapse
    if seconds is not None and not moves:
        raise UsageError("--seconds is for what moves", remedy="give --turntable or --timelapse")
    if timelapse and step is not None:
        raise UsageError("--timelapse shows all snapshots, --step one", remedy="give one of them")
    kind = _kind(output, moves)
    changes = {name: value for name, value in look.items() if value is not None}
    if "background" in changes:
        changes["background"] = _background(changes["background"])
    with (
        Messages(quiet=as_json) as messages,
        report_compiling(messages.log),
        open_output(output, "a picture", overwrite=overwrite) as stream,
    ):
        stage = _stage(run, step, changes, zoom, look_at)
        if moves:
            _write_moving(
                stream, stage, kind, turntable=turntable, timelapse=timelapse, seconds=seconds, loop=loop
            )
        else:
            _write_still(stream, stage, kind, is_sheet=step is None)
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


@dataclass(frozen=True)
class _Stage:
    """What is drawn: snapshots of a run, how, and from where."""

    finished: FinishedRun
    snapshots: Sequence[Snapshot]
    parameters: PictureParameters
    camera: Camera
    narrowed: Callable[[Camera], Camera]

    def draw(self, snapshot: Snapshot, camera: Camera) -> Image:
        """The picture of a snapshot."""
        from weathercoat.output.pictures import render_snapshot

        return render_snapshot(
            snapshot,
            self.parameters,
            up=self.finished.up,
            untouched=self.finished.untouched,
            camera=self.narrowed(camera),
        )

    def round(self, count: int) -> list[Camera]:
        """Cameras once round everything that any of the snapshots shows."""
        import numpy as np

        from weathercoat.output.camera import turntable
        from weathercoat.output.display import Normalisation
        from weathercoat.output.pictures import framed_points

        points, _ = framed_points(self.snapshots[0], untouched=self.finished.untouched, films=self.snapshots)
        points = Normalisation.of(self.snapshots[0])(points)
        return turntable(
            self.camera, points, np.asarray(self.finished.up), count, margin=self.parameters.margin
        )


def _stage(
    run: Path,
    step: int | None,
    changes: dict[str, Any],
    zoom: float | None,
    look_at: tuple[float, float, float] | None,
) -> _Stage:
    import numpy as np

    from weathercoat.finished import open_run
    from weathercoat.output.camera import zoomed
    from weathercoat.output.display import Normalisation
    from weathercoat.output.pictures import frame_camera
    from weathercoat.recording import picture_parameters

    finished = open_run(run)
    snapshots = [finished.read_snapshot(number) for number in (finished.steps if step is None else [step])]
    parameters = replace(picture_parameters(finished.config), **changes)
    camera = frame_camera(
        snapshots[0], parameters, up=finished.up, untouched=finished.untouched, films=snapshots
    )
    centre: np.ndarray[Any, Any] | None = None
    if look_at is not None:
        centre = Normalisation.of(snapshots[0])(np.array([look_at]))[0]

    def narrowed(camera: Camera) -> Camera:
        return zoomed(camera, zoom or 1.0, centre)

    return _Stage(finished, snapshots, parameters, camera, narrowed)


def _write_still(stream: BinaryIO, stage: _Stage, kind: str, *, is_sheet: bool) -> None:
    from weathercoat.output.animation import write_animation
    from weathercoat.output.pictures import contact_sheet, write_png

    images = [stage.draw(snapshot, stage.camera) for snapshot in stage.snapshots]
    image = images[0]
    if is_sheet:
        image = contact_sheet(images, [f"age {snapshot.age:g}" for snapshot in stage.snapshots])
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

    snapshots = stage.snapshots if timelapse else stage.snapshots[-1:]
    if turntable is None:
        cameras, whole = [stage.camera] * len(snapshots), _SNAPSHOT_SECONDS * len(snapshots)
    else:
        cameras, whole = stage.round(turntable), _TURN_SECONDS
    count = len(cameras)
    images = [
        stage.draw(snapshots[index * len(snapshots) // count], camera) for index, camera in enumerate(cameras)
    ]
    write_animation(stream, images, kind, [(seconds or whole) / count] * count, loop=loop)
