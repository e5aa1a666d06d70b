"""Reading the MODEL argument: a path, or - for standard input."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from weathercoat.memory import memory_limit

if TYPE_CHECKING:
    from weathercoat.mesh.read import Up
    from weathercoat.mesh.surface import Surface


def read_model(
    model: str, model_format: str | None, *, up: Up = "auto", max_memory: int | None = None
) -> Surface:
    """The repaired surface of a model, whose file is not larger than what `max_memory` bytes suffice for."""
    from weathercoat.cost import require_memory_to_read
    from weathercoat.mesh.read import read_stream, read_surface

    if model == "-":
        return read_stream(sys.stdin.buffer, format=model_format, up=up)
    require_memory_to_read(Path(model), memory_limit(max_memory))
    return read_surface(model, format=model_format, up=up)
