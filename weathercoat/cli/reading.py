"""Reading the MODEL argument: a path, or - for standard input."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from weathercoat.mesh.read import Up
    from weathercoat.mesh.surface import Surface


def read_model(model: str, model_format: str | None, *, up: Up = "auto") -> Surface:
    """The repaired surface of a model."""
    from weathercoat.mesh.read import read_stream, read_surface

    if model == "-":
        return read_stream(sys.stdin.buffer, format=model_format, up=up)
    return read_surface(model, format=model_format, up=up)
