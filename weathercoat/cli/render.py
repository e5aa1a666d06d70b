"""`weathercoat render`: pictures of a finished run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from weathercoat.cli import options
from weathercoat.cli.writing import STANDARD_OUTPUT, open_output, say_written
from weathercoat.errors import UsageError

if TYPE_CHECKING:
    from weathercoat.output.pictures import Image


@click.command()
@click.argument("run", type=click.Path(path_type=Path))
@options.output("The PNG; - for standard output.", required=True)
@click.option(
    "--step", type=int, metavar="N", help="Draw the snapshot of this step alone, not a sheet of all."
)
@click.option("--width", type=click.IntRange(16, 16_384), metavar="PIXELS", help="Width of a picture.")
@click.option("--height", type=click.IntRange(16, 16_384), metavar="PIXELS", help="Height of a picture.")
@click.option("--azimuth", type=float, metavar="DEGREES", help="Turn of the view about the model.")
@click.option("--elevation", type=click.FloatRange(-89, 89), metavar="DEGREES", help="Height of the view.")
@options.overwrite
@options.as_json
@options.debug
def command(
    run: Path, output: Path, step: int | None, overwrite: bool, as_json: bool, **view: float | None
) -> None:
    """Draw RUN, the folder of a finished run or its folder of snapshots, as a PNG."""
    from weathercoat.cli.messages import Messages
    from weathercoat.output.pictures import write_png
    from weathercoat.run import report_compiling

    if as_json and output == STANDARD_OUTPUT:
        raise UsageError("--json and -o - both write to standard output", remedy="give a file to -o")
    with (
        Messages(quiet=as_json) as messages,
        report_compiling(messages.log),
        open_output(output, "a PNG", overwrite=overwrite) as stream,
    ):
        image = _draw(run, step, {name: value for name, value in view.items() if value is not None})
        write_png(stream, image)  # type: ignore[arg-type]
    say_written(output, as_json=as_json)


def _draw(run: Path, step: int | None, view: dict[str, Any]) -> Image:
    """The picture of one step, or the contact sheet of all."""
    from weathercoat.finished import open_run
    from weathercoat.output.pictures import contact_sheet, frame_camera, render_snapshot
    from weathercoat.recording import picture_parameters

    finished = open_run(run)
    steps = finished.steps if step is None else [step]
    snapshots = [finished.read_snapshot(number) for number in steps]
    parameters = replace(picture_parameters(finished.config), **view)
    up, untouched = finished.up, finished.untouched
    camera = frame_camera(snapshots[0], parameters, up=up, untouched=untouched)
    images = [
        render_snapshot(snapshot, parameters, up=up, untouched=untouched, camera=camera)
        for snapshot in snapshots
    ]
    if step is not None:
        return images[0]
    return contact_sheet(images, [f"age {snapshot.age:g}" for snapshot in snapshots])
