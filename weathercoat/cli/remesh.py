"""`weathercoat remesh`: the model in homogeneous, random triangles."""

from __future__ import annotations

import json
from pathlib import Path

import click

from weathercoat.cli import options
from weathercoat.cli.writing import MESH_FORMATS, STANDARD_OUTPUT, WHERE, open_mesh, say_written
from weathercoat.errors import UsageError


@click.command()
@options.model
@options.output(WHERE, required=True)
@options.to(MESH_FORMATS, "Format of the output, whatever its extension.")
@click.option(
    "--faces", type=click.IntRange(4, 20_000_000), default=10_000, show_default=True, help="Wanted faces."
)
@click.option(
    "--crease-angle",
    type=click.FloatRange(0, 180, min_open=True),
    default=30.0,
    show_default=True,
    help="Edges that bend by more degrees are kept.",
)
@click.option(
    "--seed", type=click.IntRange(0), default=1, show_default=True, help="Seed of the random splits."
)
@options.model_format
@options.overwrite
@options.quiet
@options.as_json
@options.debug
def command(
    model: str,
    output: Path,
    to: str | None,
    faces: int,
    crease_angle: float,
    seed: int,
    model_format: str | None,
    overwrite: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Remesh MODEL into even triangles without a direction, keeping creases and boundaries.

    The result is turned so that up is where the format of the file has it: +y in OBJ and GLB, +z in PLY, STL
    and OFF.
    """
    from weathercoat.cli.messages import Messages
    from weathercoat.cli.reading import read_model
    from weathercoat.cost import require_memory_to_remesh
    from weathercoat.memory import usable_memory
    from weathercoat.mesh.remesh import RemeshParameters, remesh
    from weathercoat.output.report import measure_surface
    from weathercoat.run import name_errors, report_compiling, report_notes

    if as_json and output == STANDARD_OUTPUT:
        raise UsageError("--json and -o - both write to standard output", remedy="give a file to -o")
    with (
        Messages(quiet=quiet or as_json) as messages,
        report_compiling(messages.log),
        open_mesh(output, overwrite=overwrite, to=to) as write,
        name_errors(model),
    ):
        surface = read_model(model, model_format)
        report_notes(surface.notes, model, messages.log)
        require_memory_to_remesh(len(surface.faces), faces, usable_memory())
        result = remesh(surface, RemeshParameters(faces=faces, crease_angle=crease_angle, seed=seed))
        report_notes(result.notes[len(surface.notes) :], model, messages.log)
        written = write(result)
    if as_json:
        click.echo(json.dumps(measure_surface(written), indent=2, ensure_ascii=False))
    elif not quiet:
        say_written(output, f"{len(written.faces):,} faces", f"{len(written.vertices):,} vertices")
