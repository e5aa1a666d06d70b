"""`weathercoat remesh`: the model in homogeneous, random triangles."""

from __future__ import annotations

import json
from pathlib import Path

import click

from weathercoat.cli import options


@click.command()
@options.model
@options.output("File, in the format of its extension.", required=True)
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
    faces: int,
    crease_angle: float,
    seed: int,
    model_format: str | None,
    overwrite: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Remesh MODEL into even triangles without a direction, keeping creases and boundaries."""
    from weathercoat.cli.reading import read_model
    from weathercoat.mesh.remesh import RemeshParameters, remesh
    from weathercoat.output.folder import whole_file
    from weathercoat.output.meshes import write_mesh
    from weathercoat.output.report import measure_surface

    with whole_file(output, overwrite=overwrite) as stream:
        surface = read_model(model, model_format)
        if not quiet and not as_json:
            for note in surface.notes:
                click.echo(f"weathercoat: {model}: {note.code}({note.count}): {note.message}", err=True)
        result = remesh(surface, RemeshParameters(faces=faces, crease_angle=crease_angle, seed=seed))
        write_mesh(stream, result, format=output.suffix)
    if as_json:
        click.echo(json.dumps(measure_surface(result), indent=2, ensure_ascii=False))
    else:
        click.echo(f"written to {output}: {len(result.faces):,} faces, {len(result.vertices):,} vertices")
