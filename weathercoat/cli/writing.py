"""Writing a surface where -o says: to a file in the format of its extension, or to standard output as OBJ."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import click

if TYPE_CHECKING:
    from weathercoat.mesh.surface import Surface

STANDARD_OUTPUT = Path("-")
WHERE = "File, in the format of its extension; - writes OBJ to standard output."


@contextmanager
def open_mesh(output: Path, *, overwrite: bool) -> Iterator[Callable[[Surface], Surface]]:
    """A function that writes a surface to `output` and returns it as it was written: turned, where needed, so
    that up is where readers of the format look for it.

    A format that is not written and a file that exists are refused before the block begins, with the errors
    of `output.meshes.write_mesh`.
    """
    from weathercoat.output.folder import whole_file
    from weathercoat.output.meshes import mesh_format

    if output == STANDARD_OUTPUT:
        yield partial(_write, sys.stdout.buffer, "obj")
        return
    kind = mesh_format(output)
    with whole_file(output, overwrite=overwrite) as stream:
        yield partial(_write, stream, kind)


def say_written(output: Path, *about: str, as_json: bool = False) -> None:
    """Say on standard output that the file is there; nothing where standard output is the file."""
    if output != STANDARD_OUTPUT and as_json:
        click.echo(json.dumps({"written": str(output)}, ensure_ascii=False))
    elif output != STANDARD_OUTPUT:
        click.echo(f"written to {output}" + ": " * bool(about) + ", ".join(about))


def _write(stream: BinaryIO, kind: str, surface: Surface) -> Surface:
    from weathercoat.output.meshes import write_mesh

    written = _turned(surface, kind)
    write_mesh(stream, written, format=kind)
    return written


def _turned(surface: Surface, kind: str) -> Surface:
    """The surface in the axes that `read_surface` takes a file of this format to have."""
    from weathercoat.mesh.read import UP_OF_FORMAT

    y_up, z_up = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    wanted = z_up if UP_OF_FORMAT[kind] == "z" else y_up
    if kind == "glb" or surface.up == wanted:  # the writer of GLB turns by itself
        return surface
    signs = (1.0, -1.0, 1.0) if wanted == z_up else (1.0, 1.0, -1.0)
    # Adding zero makes -0.0, which files would show, 0.0.
    return replace(surface, vertices=surface.vertices[:, [0, 2, 1]] * signs + 0.0, up=wanted)
