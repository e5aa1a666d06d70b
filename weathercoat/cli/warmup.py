"""`weathercoat warmup`: compile ahead what the other commands need, for images and CI."""

from __future__ import annotations

import json
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, get_args, get_origin

import click

from weathercoat.cli import options

_CONCAVE_POLYGON = b"v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nf 1 2 3 4 5 6\n"


@click.command()
@options.portable
@options.quiet
@options.as_json
@options.debug
def command(quiet: bool, as_json: bool) -> None:
    """Compile ahead what the other commands need.

    They compile their kernels when they first need them and keep them in the user's cache directory, or below
    NUMBA_CACHE_DIR. This does so at once, by ageing a small part in each way; it does nothing where all is
    kept already.
    """
    from weathercoat.cli.messages import Messages
    from weathercoat.compile import cache_folder, remove_unused, watch_compiling

    with (
        Messages(quiet=quiet or as_json) as messages,
        watch_compiling(lambda: messages.log("compiling, which takes about a minute")) as compiling,
    ):
        _use_everything()
    remove_unused()
    folder = cache_folder()
    if as_json:
        found = {
            "kernels": compiling.kernels,
            "seconds": round(compiling.seconds, 1),
            "folder": folder and str(folder),
        }
        click.echo(json.dumps(found, indent=2, ensure_ascii=False))
    elif not quiet:
        what = (
            f"compiled {compiling.kernels} kernels in {compiling.seconds:.1f} s"
            if compiling.kernels
            else "nothing to compile"
        )
        click.echo(f"{what}; they are kept in {folder}")


def _use_everything() -> None:
    """Age a small part by every form of every rule, remesh, inspect and draw."""
    from weathercoat.config.load import load_config
    from weathercoat.mesh.inspect import inspect_surface
    from weathercoat.mesh.read import read_stream, read_surface
    from weathercoat.mesh.shapes import make_bracket
    from weathercoat.output.meshes import write_mesh
    from weathercoat.run import run_asset

    with TemporaryDirectory() as name:
        folder = Path(name)
        model = folder / "part.obj"
        for path in (folder / "part.off", folder / "part.ply", model):
            write_mesh(path, make_bracket(edge_length=0.2))
            inspect_surface(read_surface(path), self_intersections=True)
        read_stream(BytesIO(_CONCAVE_POLYGON), format="obj")
        small = [
            "ageing.steps=20",
            "snapshots.count=1",
            "output.picture_width=64",
            "output.picture_height=48",
        ]
        for number, form in enumerate(_forms()):
            # so many that the turns of flat parts are balanced
            remesh = "remesh.faces=4000" if number == 0 else "remesh=off"
            loaded = load_config("standard", [*small, remesh, *form])
            run_asset(loaded, model, folder / f"run_{number}")


def _forms() -> Iterator[list[str]]:
    """Assignments that, between them, choose every form of every rule."""
    from weathercoat.config.schema import Config, section_of

    choices: dict[str, list[str]] = {}
    for section_name, section_field in Config.model_fields.items():
        section = section_of(section_field)
        if section is None or section_name in ("model", "output"):
            continue
        for name, field in section.model_fields.items():
            if get_origin(field.annotation) is Literal:
                choices[f"{section_name}.{field.alias or name}"] = list(get_args(field.annotation))
    for number in range(max(map(len, choices.values()))):
        yield [f"{key}={forms[number % len(forms)]}" for key, forms in choices.items()]
