"""`weathercoat render`: pictures of a finished run."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from weathercoat.cli import options
from weathercoat.cli.writing import STANDARD_OUTPUT, open_output, say_written
from weathercoat.errors import CorruptError, UsageError

if TYPE_CHECKING:
    from weathercoat.config.schema import Config
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
    from weathercoat.mesh.read import read_surface
    from weathercoat.output.folder import REPORT, read_run
    from weathercoat.output.pictures import contact_sheet, frame_camera, render_snapshot
    from weathercoat.recording import picture_parameters

    if not os.path.exists(run / REPORT) and os.path.exists(run.parent / REPORT):  # noqa: PTH110 (any text)
        run = run.parent
    report, snapshots = read_run(run)
    if step is not None:
        snapshots = [snapshot for snapshot in snapshots if snapshot.step == step]
        if not snapshots:
            steps = ", ".join(str(row["step"]) for row in report["snapshots"])
            raise UsageError(
                f"the run has no snapshot of step {step}", file=str(run), remedy=f"there are {steps}"
            )
    config = _config_of(report, run / REPORT)
    parameters = replace(picture_parameters(config), **view)
    x, y, z = report["meshes"]["input"]["up"]
    up = (x, y, z)
    untouched = run / "untouched.ply"
    unpainted = read_surface(untouched) if untouched.exists() else None
    camera = frame_camera(snapshots[0], parameters, up=up, untouched=unpainted)
    images = [
        render_snapshot(snapshot, parameters, up=up, untouched=unpainted, camera=camera)
        for snapshot in snapshots
    ]
    if step is not None:
        return images[0]
    return contact_sheet(images, [f"age {snapshot.age:g}" for snapshot in snapshots])


def _config_of(report: dict[str, Any], path: Path) -> Config:
    from pydantic import ValidationError

    from weathercoat.config.schema import Config

    try:
        return Config.model_validate(report.get("config"))
    except ValidationError as error:
        raise CorruptError("holds no config of this version", file=str(path), remedy="run again") from error
