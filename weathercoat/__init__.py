"""Age painted metal: remesh a model and simulate how its paint separates, cracks, curls, flakes and rusts.

import weathercoat

surface = weathercoat.remesh(weathercoat.read("model.obj"), faces=10_000)
simulation = weathercoat.simulate(surface, "rusting")
weathercoat.write("aged.glb", simulation.snapshot())
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from weathercoat.api import read, remesh, simulate, verify, write

__version__ = "0.1.0"
__all__ = ["read", "remesh", "simulate", "verify", "write"]


def __getattr__(name: str) -> Any:
    # imported when first used, so that the command line answers --help without NumPy
    if name in __all__:
        return getattr(importlib.import_module("weathercoat.api"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
