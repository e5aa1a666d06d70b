"""The ways to run that are compared: how fine a mesh, how many steps, which solver."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Way:
    """A way to run. sweeps: a step, of solvers that sweep, 0 of others; threads: they change no result."""

    faces: int
    steps: int
    solver: str
    sweeps: int = 0
    threads: int = 1

    @property
    def label(self) -> str:
        """Its name in tables and charts."""
        many = f" of {self.sweeps}" if self.sweeps else ""
        threads = f", {self.threads} threads" if self.threads > 1 else ""
        return f"{self.solver}{many}, {self.faces:,} faces, {self.steps:,} steps{threads}"

    def values(self) -> dict[str, Any]:
        """The config keys that make it, but for the number of faces."""
        found: dict[str, Any] = {"ageing.steps": self.steps, "deformation.solver": self.solver}
        return {**found, "deformation.sweeps": self.sweeps} if self.sweeps else found

    def edge_length(self) -> float:
        """Of so many equilateral triangles that share an area of 1."""
        return math.sqrt(4.0 / (math.sqrt(3.0) * self.faces))


REFERENCE = Way(40_000, 500, "newton")
WAYS = (
    Way(1_000, 50, "none"),
    *(Way(3_000, steps, "none") for steps in (50, 100)),
    *(Way(10_000, steps, "none") for steps in (50, 200)),
    Way(40_000, 100, "none"),
    *(Way(3_000, steps, "sweeps", 10) for steps in (100, 200, 1000)),
    *(Way(10_000, steps, "sweeps", 10) for steps in (100, 200, 500, 1000)),
    *(Way(10_000, 200, "sweeps", sweeps) for sweeps in (2, 50)),
    *(Way(20_000, steps, "sweeps", 10) for steps in (200, 1000)),
    *(Way(40_000, steps, "sweeps", 10) for steps in (200, 1000)),
    Way(40_000, 1000, "sweeps", 10, threads=2),
    Way(10_000, 200, "descent"),
    *(Way(3_000, steps, "newton") for steps in (50, 100)),
    *(Way(10_000, steps, "newton") for steps in (50, 100, 200, 500)),
    *(Way(20_000, steps, "newton") for steps in (100, 200)),
    *(Way(40_000, steps, "newton") for steps in (100, 200)),
)
