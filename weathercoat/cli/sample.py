"""`weathercoat sample`: write a generated part."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, get_type_hints

import click

from weathercoat.cli import options
from weathercoat.cli.writing import MESH_FORMATS, WHERE, open_mesh, say_written

_YARD = "yard"


class _Shapes(click.Group):
    """One command for each shape, its options made from the arguments of the function that makes it; and one
    for a scene.
    """

    def list_commands(self, ctx: click.Context) -> list[str]:
        from weathercoat.mesh.shapes import SHAPES

        return [*SHAPES, _YARD]

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        from weathercoat.mesh.shapes import SHAPES

        if name == _YARD:
            return _yard
        return _make_command(name, SHAPES[name]) if name in SHAPES else None


@click.group(cls=_Shapes)
def command() -> None:
    """Write a generated part, or a scene, to try the tool on."""


@click.command(_YARD)
@options.output("The .glb or the .yaml file; the other one gets its name. Default: yard.glb.")
@options.overwrite
@options.as_json
@options.debug
def _yard(output: Path | None, overwrite: bool, as_json: bool) -> None:
    """A scene: a shed with a roof, and a yard in front of it, of fifty painted parts.

    Besides the GLB with its nodes and a camera that walks past, a scene file with rules is written.
    """
    from weathercoat.scene.yard import write_yard_files

    for path in write_yard_files(output or Path("yard.glb"), overwrite=overwrite):
        say_written(path, as_json=as_json)


def _make_command(name: str, make: Callable[..., Any]) -> click.Command:
    def write(
        output: Path | None,
        to: str | None,
        size: float | None,
        overwrite: bool,
        as_json: bool,
        **arguments: float,
    ) -> None:
        path = output or Path(f"{name}.{to or 'obj'}")
        surface = make(**arguments)
        if size is not None:
            extent = (surface.vertices.max(axis=0) - surface.vertices.min(axis=0)).max()
            surface = replace(surface, vertices=surface.vertices * (size / extent))
        with open_mesh(path, overwrite=overwrite, to=to) as write_surface:
            write_surface(surface)
        say_written(path, as_json=as_json)

    annotated = get_type_hints(make, include_extras=True)
    write = options.debug(options.as_json(options.overwrite(write)))
    write = click.option(
        "--size",
        type=click.FloatRange(1e-9, 1e9),
        metavar="LENGTH",
        help="Scale the part so that this is its largest extent.",
    )(write)
    for parameter in reversed(list(inspect.signature(make).parameters.values())):
        kind, about = annotated[parameter.name].__origin__, annotated[parameter.name].__metadata__[0]
        flag = f"--{parameter.name.replace('_', '-')}"
        write = click.option(flag, type=kind, default=parameter.default, show_default=True, help=about)(write)
    write = options.to(MESH_FORMATS, "Format of the output, whatever its extension.")(write)
    write = options.output(f"{WHERE} Default: {name}.obj.")(write)
    return click.command(name, help=inspect.getdoc(make))(write)
