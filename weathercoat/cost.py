"""What a run will take: a linear model of measured rates, for `inspect` and `plan`.

The rates are seconds of single-threaded runs of `standard` with compiled kernels, on one core of a two-core
machine: a sign remeshed to 3,000, 10,000 and 30,000 faces, and a bunny of 10,000 without remeshing or
pictures; of snapshots and pictures those of earlier runs, with 1 to 21 of them. The model meets those runs
within 20 %; those of the solvers that converge (a plate of 10,000 to 40,000 faces) within a half, since they
depend on how much film is loose. Another machine takes proportionally more or less. The first run after an
installation compiles for about a minute more, which is left out.

Memory is that of the stage which needs most, each linear in the faces of the model (m), those of the film (n)
and the pixels of a picture: the largest resident set of fresh processes, measured on 2026-11-22 by `python -m
tests.measure_memory`, which prints what is measured beside what is predicted here. Neither the number of
steps nor that of snapshots or threads matters; a picture needs less where film has fallen. Compiling, in the
first run after an installation, takes up to 130 MB more.

What a run writes was measured on the sign with 3,000 and 10,000 faces; it varies by a third with what has
fallen.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from weathercoat.config.schema import Config, Remesh
from weathercoat.errors import LimitError
from weathercoat.memory import MemoryLimit

SECONDS_AT_START = 1.1
SECONDS_PER_MODEL_FACE = 1e-5
SECONDS_PER_REMESHED_FACE = 6.5e-5
SECONDS_PER_FACE_AND_STEP = 5e-8
SECONDS_PER_FACE_AND_SWEEP = 1.2e-8
SECONDS_PER_FACE_AND_SOLUTION = 1.5e-6
SECONDS_PER_SOLVED_FACE = 1.4e-4  # for the curl that has to be followed, in however many steps
SECONDS_PER_SNAPSHOT_FACE = 3.5e-6
SECONDS_PER_PICTURE_PIXEL = 2.1e-6

BYTES_AT_START = 180e6  # the interpreter, its libraries and compiled kernels
BYTES_OF_REMESHING = 30e6  # more of these
BYTES_OF_SIMULATING = 30e6
BYTES_OF_DRAWING = 30e6
BYTES_PER_MODEL_FACE = 165  # that stay
BYTES_PER_FACE_READ = 270
BYTES_PER_MODEL_FACE_REMESHED = 525
BYTES_PER_REMESHED_FACE = 1400
BYTES_PER_SIMULATED_FACE = 1120
BYTES_PER_SOLVED_FACE = 1030  # more, of solvers that converge
BYTES_PER_WRITTEN_FACE = {"ply": 230, "glb": 460}  # more than simulated
BYTES_PER_DRAWN_FACE = 750  # more than simulated
BYTES_PER_PICTURE_PIXEL = 280
BYTES_PER_BYTE_READ = {"obj": 6, "ply": 9, "stl": 6, "glb": 11, "gltf": 11, "off": 6}
BYTES_PER_BYTE_READ_OF_OTHERS = 10
BYTES_WRITTEN_PER_FACE = {"ply": 95, "glb": 140}  # of each snapshot
BYTES_WRITTEN_PER_PICTURE_PIXEL = 1.1
BYTES_KEPT_PER_FACE = 330  # of the checkpoint
BYTES_KEPT_PER_PICTURE_PIXEL = 1.3
_ROUND_NUMBERS = [digits * 10**power for power in range(2, 7) for digits in range(10, 100)]


@dataclass(frozen=True)
class Cost:
    """Seconds of work, bytes of memory at the peak, the stage that needs them, and bytes that are written."""

    seconds: float
    memory: float
    stage: str
    disk: float


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
    if config.remesh:
        seconds += faces * SECONDS_PER_REMESHED_FACE
    if config.output.preview:
        seconds += snapshots * _pixels(config) * SECONDS_PER_PICTURE_PIXEL
    stages = _memory_by_stage(config, model_faces, faces)
    stage = max(stages, key=lambda name: stages[name])
    return Cost(seconds, stages[stage], stage, _written(config, faces, snapshots))


def _written(config: Config, faces: int, snapshots: int) -> float:
    """Bytes of the results of a run."""
    size = float(faces * snapshots * sum(BYTES_WRITTEN_PER_FACE[name] for name in config.output.formats))
    pixels = snapshots * _pixels(config) if config.output.preview else 0
    size += pixels * BYTES_WRITTEN_PER_PICTURE_PIXEL
    if config.checkpoint.keep:
        size += faces * BYTES_KEPT_PER_FACE + pixels * BYTES_KEPT_PER_PICTURE_PIXEL
    return size


def _memory_by_stage(config: Config, model_faces: int, faces: int) -> dict[str, float]:
    """Bytes at the peak of each stage."""
    model = BYTES_AT_START + model_faces * BYTES_PER_MODEL_FACE
    if config.remesh:
        model += BYTES_OF_REMESHING
    simulated = model + BYTES_OF_SIMULATING + faces * BYTES_PER_SIMULATED_FACE
    solver = BYTES_PER_SOLVED_FACE if config.deformation.solver in ("newton", "descent") else 0
    stages = {
        "reading": BYTES_AT_START + model_faces * BYTES_PER_FACE_READ,
        "simulation": simulated + faces * solver,
        "writing": simulated + faces * max(BYTES_PER_WRITTEN_FACE[name] for name in config.output.formats),
    }
    if config.remesh:
        stages["remeshing"] = _memory_to_remesh(model_faces, faces)
    if config.output.preview:
        drawn = faces * BYTES_PER_DRAWN_FACE + _pixels(config) * BYTES_PER_PICTURE_PIXEL
        stages["pictures"] = simulated + BYTES_OF_DRAWING + drawn
    return stages


def _memory_to_remesh(model_faces: int, faces: int) -> float:
    model = BYTES_AT_START + BYTES_OF_REMESHING + model_faces * BYTES_PER_MODEL_FACE
    return model + max(model_faces * BYTES_PER_MODEL_FACE_REMESHED, faces * BYTES_PER_REMESHED_FACE)


def _pixels(config: Config) -> int:
    return config.output.picture_width * config.output.picture_height


def memory_to_read(size: int, extension: str) -> float:
    """Bytes at the peak of reading a file of so many bytes; extension: without a dot."""
    return BYTES_AT_START + size * BYTES_PER_BYTE_READ.get(extension.lower(), BYTES_PER_BYTE_READ_OF_OTHERS)


def require_memory_to_read(model: Path, limit: MemoryLimit | None) -> None:
    """Raise LimitError where a file is too large to be read within a limit."""
    size = os.path.getsize(model) if os.path.isfile(model) else 0  # noqa: PTH113, PTH202 (any text will do)
    needed = memory_to_read(size, model.suffix.removeprefix("."))
    if limit is not None and needed > limit.bytes:
        raise LimitError(
            f"a file of {in_megabytes(size)} needs about {in_megabytes(needed)} of memory to be read, more "
            f"than {in_megabytes(limit.bytes)}, {limit.origin}",
            file=str(model),
            remedy="export the model with fewer faces, or allow more memory",
        )


def require_memory_to_remesh(model_faces: int, faces: int, limit: MemoryLimit | None) -> None:
    """Raise LimitError where making so many faces of a model needs more than a limit."""
    needed = _memory_to_remesh(model_faces, faces)
    if limit is not None and needed > limit.bytes:
        raise LimitError(
            f"remeshing needs about {in_megabytes(needed)} of memory, more than {in_megabytes(limit.bytes)}, "
            f"{limit.origin}",
            remedy="ask for fewer faces, or simplify the model first",
        )


def require_memory(config: Config, model_faces: int, limit: MemoryLimit | None) -> None:
    """Raise LimitError where a run by `config` on a model of so many triangles needs more than a limit."""
    cost = estimate_cost(config, model_faces)
    if limit is not None and cost.memory > limit.bytes:
        raise LimitError(
            f"the run needs about {in_megabytes(cost.memory)} of memory for its {cost.stage}, more than "
            f"{in_megabytes(limit.bytes)}, {limit.origin}",
            remedy=what_fits(config, model_faces, limit),
        )


def what_fits(config: Config, model_faces: int, limit: MemoryLimit) -> str:
    """What to ask for instead of a run that needs more than a limit."""
    faces = faces_that_fit(config, model_faces, limit.bytes)
    if faces:
        return f"remesh.faces={faces} would fit, or allow more memory"
    if config.output.preview and estimate_cost(config, model_faces).stage == "pictures":
        return "ask for smaller pictures (output.picture_width), or allow more memory"
    return "simplify the model first, or allow more memory"


def faces_that_fit(config: Config, model_faces: int, limit: float) -> int:
    """The most faces of a remeshed film with which a run stays within a limit, to two digits; 0 where none
    do.
    """
    fits = 0
    for faces in _ROUND_NUMBERS:
        wanted = config.model_copy(
            update={"remesh": (config.remesh or Remesh()).model_copy(update={"faces": faces})}
        )
        if estimate_cost(wanted, model_faces).memory > limit:
            break
        fits = faces
    return fits


def in_megabytes(size: float) -> str:
    """A size for people."""
    return f"{size / 1e6:,.0f} MB"
