"""`weathercoat sample`: write a generated part."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, get_type_hints

import click

from weathercoat.cli import options
from weathercoat.cli.writing import WHERE, open_mesh, say_written


class _Shapes(click.Group):
    """One command for each shape, its options made from the arguments of the function that makes it."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        from weathercoat.mesh.shapes import SHAPES

        return list(SHAPES)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        from weathercoat.mesh.shapes import SHAPES

        return _make_command(name, SHAPES[name]) if name in SHAPES else None


@click.group(cls=_Shapes)
def command() -> None:
    """Write a generated part to try the tool on."""


def _make_command(name: str, make: Callable[..., Any]) -> click.Command:
    def write(
        output: Path | None, size: float | None, overwrite: bool, as_json: bool, **arguments: float
    ) -> None:
        path = output or Path(f"{name}.obj")
        surface = make(**arguments)
        if size is not None:
            extent = (surface.vertices.max(axis=0) - surface.vertices.min(axis=0)).max()
            surface = replace(surface, vertices=surface.vertices * (size / extent))
        with open_mesh(path, overwrite=overwrite) as write_surface:
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
    write = options.output(f"{WHERE} Default: {name}.obj.")(write)
    return click.command(name, help=inspect.getdoc(make))(write)
