"""Writing where -o says: to a file, or to standard output."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import click

from weathercoat.errors import OutputError, UsageError

if TYPE_CHECKING:
    from weathercoat.mesh.surface import Surface

STANDARD_OUTPUT = Path("-")
WHERE = "File, in the format of its extension unless --to names one; - for standard output, then OBJ."
MESH_FORMATS = ("obj", "ply", "stl", "off", "glb")
_OF_TEXT = ("obj", "off")


@contextmanager
def open_output(output: Path, what: str, *, overwrite: bool) -> Iterator[BinaryIO]:
    """A binary stream that becomes the file `output`, or goes to standard output, once it is whole.

    A terminal is refused before the block begins: `what` is not to be read by people. Raises UsageError,
    OutputExistsError, OutputError, and BrokenPipeError where nobody reads standard output any more.
    """
    from weathercoat.output.folder import whole_file

    if output != STANDARD_OUTPUT:
        with whole_file(output, overwrite=overwrite) as stream:
            yield stream
        return
    refuse_terminal(what)
    content = BytesIO()
    yield content
    send(content.getvalue())


def refuse_terminal(what: str) -> None:
    """Raise UsageError where standard output is a terminal, on which `what` would be noise."""
    if sys.stdout.isatty():
        raise UsageError(
            f"standard output is a terminal, and {what} is binary",
            remedy="redirect it, or name a file with -o",
        )


def send(content: bytes) -> None:
    """Write to standard output. Raises OutputError, such as for a full disk, and BrokenPipeError."""
    try:
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputError(
            error.strerror or str(error), file="standard output", remedy="look at where it goes"
        ) from error


@contextmanager
def open_mesh(
    output: Path, *, overwrite: bool, to: str | None = None
) -> Iterator[Callable[[Surface], Surface]]:
    """A function that writes a surface to `output` and returns it as it was written: turned, where needed, so
    that up is where readers of the format look for it.

    to: the format; None for that of the extension, or OBJ on standard output. A format that is not written, a
    file that exists and a terminal are refused before the block begins, with the errors of `open_output` and
    of `output.meshes.write_mesh`.
    """
    from weathercoat.output.meshes import mesh_format

    kind = mesh_format(output, to or ("obj" if output == STANDARD_OUTPUT else None))
    if output == STANDARD_OUTPUT and kind in _OF_TEXT:
        yield partial(_write_text, kind)
        return
    with open_output(output, kind.upper(), overwrite=overwrite) as stream:
        yield partial(_write, stream, kind)


def say_written(output: Path, *about: str, as_json: bool = False) -> None:
    """Say on standard output that the file is there; nothing where standard output is the file."""
    if output != STANDARD_OUTPUT and as_json:
        click.echo(json.dumps({"written": str(output)}, ensure_ascii=False))
    elif output != STANDARD_OUTPUT:
        click.echo(f"written to {output}" + ": " * bool(about) + ", ".join(about))


def _write_text(kind: str, surface: Surface) -> Surface:
    content = BytesIO()
    written = _write(content, kind, surface)
    send(content.getvalue())
    return written


def _write(stream: BinaryIO, kind: str, surface: Surface) -> Surface:
    from weathercoat.output.meshes import write_mesh

    written = turned(surface, kind)
    write_mesh(stream, written, format=kind)
    return written


def turned(surface: Surface, kind: str) -> Surface:
    """The surface in the axes that `read_surface` takes a file of this format to have; as it is where its own
    are neither y up nor z up.
    """
    from weathercoat.mesh.read import UP_OF_FORMAT

    y_up, z_up = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    wanted = z_up if UP_OF_FORMAT[kind] == "z" else y_up
    if (
        kind == "glb" or surface.up not in (y_up, z_up) or surface.up == wanted
    ):  # GLB's writer turns by itself
        return surface
    signs = (1.0, -1.0, 1.0) if wanted == z_up else (1.0, 1.0, -1.0)
    # Adding zero makes -0.0, which files would show, 0.0.
    return replace(surface, vertices=surface.vertices[:, [0, 2, 1]] * signs + 0.0, up=wanted)
