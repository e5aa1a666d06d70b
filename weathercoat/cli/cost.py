"""What a run will take: a linear model of measured rates, for `inspect`.

The rates are those of one core of the kind that continuous integration runs on; a run on another machine
takes proportionally more or less. Measured on closed and open parts at 3,000 to 300,000 faces.
"""

from __future__ import annotations

from dataclasses import dataclass

from weathercoat.config.schema import Config

SECONDS_AT_START = 3.0
SECONDS_PER_REMESHED_FACE = 1.5e-4
SECONDS_PER_FACE_AND_STEP = 2.0e-7
SECONDS_PER_FACE_AND_SWEEP = 5.0e-8
SECONDS_PER_SNAPSHOT_FACE = 3.0e-5
SECONDS_PER_PICTURE_PIXEL = 8.0e-6
BYTES_AT_START = 250e6
BYTES_PER_FACE = 4.0e3


@dataclass(frozen=True)
class Cost:
    """Seconds of work and bytes of memory at the peak."""

    seconds: float
    memory: float


def estimate_cost(config: Config, model_faces: int) -> Cost:
    """The cost of a run by `config` on a model of so many triangles."""
    faces = config.remesh.faces if config.remesh else model_faces
    steps = config.ageing.steps
    snapshots = len(config.snapshots.due(steps))
    seconds = SECONDS_AT_START + snapshots * faces * SECONDS_PER_SNAPSHOT_FACE
    seconds += (
        steps * faces * (SECONDS_PER_FACE_AND_STEP + config.deformation.sweeps * SECONDS_PER_FACE_AND_SWEEP)
    )
    if config.remesh:
        seconds += faces * SECONDS_PER_REMESHED_FACE
    if config.output.preview:
        pixels = config.output.picture_width * config.output.picture_height
        seconds += snapshots * pixels * SECONDS_PER_PICTURE_PIXEL
    return Cost(seconds, BYTES_AT_START + BYTES_PER_FACE * max(faces, model_faces))
