"""What a run will take: a linear model of measured rates, for `inspect` and `plan`.

The rates are seconds of single-threaded runs of `standard` with compiled kernels, on one core of a two-core
machine: a sign remeshed to 3,000, 10,000 and 30,000 faces, and a bunny of 10,000 without remeshing or
pictures; of snapshots and pictures those of earlier runs, with 1 to 21 of them. The model meets those runs
within 20 %; those of the solvers that converge (a plate of 10,000 to 40,000 faces) within a half, since they
depend on how much film is loose. Another machine takes proportionally more or less. The first run after an
installation compiles for about a minute more, which is left out. Memory is the largest resident set of a run
of 1,000,000 faces.
"""

from __future__ import annotations

from dataclasses import dataclass

from weathercoat.config.schema import Config

SECONDS_AT_START = 1.1
SECONDS_PER_MODEL_FACE = 1e-5
SECONDS_PER_REMESHED_FACE = 6.5e-5
SECONDS_PER_FACE_AND_STEP = 5e-8
SECONDS_PER_FACE_AND_SWEEP = 1.2e-8
SECONDS_PER_FACE_AND_SOLUTION = 1.5e-6
SECONDS_PER_SOLVED_FACE = 1.4e-4  # for the curl that has to be followed, in however many steps
SECONDS_PER_SNAPSHOT_FACE = 3.5e-6
SECONDS_PER_PICTURE_PIXEL = 2.1e-6
BYTES_AT_START = 200e6
BYTES_PER_MODEL_FACE = 0.5e3
BYTES_PER_FACE = 1.6e3
BYTES_PER_PICTURE_PIXEL = 400


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
    seconds = SECONDS_AT_START + model_faces * SECONDS_PER_MODEL_FACE
    seconds += faces * (steps * SECONDS_PER_FACE_AND_STEP + snapshots * SECONDS_PER_SNAPSHOT_FACE)
    match config.deformation.solver:
        case "sweeps" | "momentum":
            seconds += faces * steps * config.deformation.sweeps * SECONDS_PER_FACE_AND_SWEEP
        case "newton" | "descent":
            seconds += faces * (steps * SECONDS_PER_FACE_AND_SOLUTION + SECONDS_PER_SOLVED_FACE)
    memory = BYTES_AT_START + model_faces * BYTES_PER_MODEL_FACE + faces * BYTES_PER_FACE
    if config.remesh:
        seconds += faces * SECONDS_PER_REMESHED_FACE
    if config.output.preview:
        pixels = config.output.picture_width * config.output.picture_height
        seconds += snapshots * pixels * SECONDS_PER_PICTURE_PIXEL
        memory += pixels * BYTES_PER_PICTURE_PIXEL
    return Cost(seconds, memory)
