"""Measure the peak memory of runs beside its prediction: `python -m tests.measure_memory [--faces 1000000]`.

Each run is a fresh process; its peak is the largest resident set that the system reports of it. The models
are rings. Steps are few, since their number does not matter, as the first rows show. A row is one run, with
the predicted and the measured megabytes and their ratio; the last line is the largest deviation.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from multiprocessing import get_context
from pathlib import Path

from tests.measure_files import make_ring
from weathercoat.config.load import load_config
from weathercoat.cost import estimate_cost
from weathercoat.output.meshes import write_mesh

_FEW = ("ageing.steps=4", "snapshots.count=2")
_NO_PREVIEW = "output.preview=false"


def rows(most: int) -> Iterator[tuple[int, str, str, tuple[str, ...]]]:
    """Faces of the model, its format, the config, and overrides."""
    middle = most // 10
    for steps in (1, 4, 40):
        yield 10_000, "ply", "standard", ("remesh=off", f"ageing.steps={steps}", "snapshots.count=1")
    for faces in (1000, 10_000, middle, most):
        for config in ("standard", "crackle"):
            yield faces, "ply", config, ("remesh=off", *_FEW)
    for format in ("obj", "stl", "glb"):
        yield most, format, "standard", ("remesh.faces=3000", *_FEW)
    for faces, wanted in ((1000, 10_000), (10_000, 3000), (10_000, middle), (middle, 10_000), (1000, most)):
        yield faces, "obj", "standard", (f"remesh.faces={wanted}", *_FEW)
    for solver in ("sweeps", "momentum", "newton", "descent", "none"):
        yield middle, "ply", "standard", ("remesh=off", *_FEW, _NO_PREVIEW, f"deformation.solver={solver}")
    for formats in ("ply", "glb", "[ply, glb]"):
        yield middle, "ply", "standard", ("remesh=off", *_FEW, _NO_PREVIEW, f"output.formats={formats}")
    for width in (640, 1920, 3840):
        size = (f"output.picture_width={width}", f"output.picture_height={width * 9 // 16}")
        yield 10_000, "ply", "standard", ("remesh=off", *_FEW, *size)
    yield middle, "ply", "standard", ("remesh=off", "ageing.steps=4", "snapshots.count=4")
    yield middle, "ply", "standard", ("remesh=off", "ageing.steps=4", "snapshots.steps=[0]")


def make_model(file: Path, faces: int) -> int:
    """Write a ring of about so many faces; returns how many."""
    ring = make_ring(faces)
    write_mesh(file, ring, overwrite=True)
    return len(ring.faces)


def peak(model: Path, config: str, overrides: tuple[str, ...], threads: int) -> float:
    """Bytes of the largest resident set of a run."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "weathercoat", "run", config, str(model), "-q"]
        command += ["-o", f"{folder}/out", "--threads", str(threads), "--max-memory", "1T"]
        process = subprocess.Popen([*command, *(f"--set={item}" for item in overrides)])
        _, status, used = os.wait4(process.pid, 0)
        if status:
            raise SystemExit(f"{' '.join(command)} ended with {os.waitstatus_to_exitcode(status)}")
    return used.ru_maxrss * 1024.0


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--faces", type=int, default=1_000_000, help="of the largest model")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--only", default="", help="rows that contain this")
    asked = parser.parse_args()
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for faces, format, config, overrides in rows(asked.faces):
            title = f"{faces:9,d} {format} {config:8} {' '.join(overrides)}"
            if asked.only not in title:
                continue
            model = Path(folder, f"ring_{faces}.{format}")
            # The system counts to a process what its parent had: models are made in processes of their own.
            with get_context("spawn").Pool(1) as pool:
                count = pool.apply(make_model, (model, faces))
            cost = estimate_cost(load_config(config, overrides).config, count)
            measured = peak(model, config, overrides, asked.threads)
            ratio = cost.memory / measured
            worst = max(worst, abs(ratio - 1.0))
            print(
                f"{cost.memory / 1e6:7.0f} {measured / 1e6:7.0f} {ratio:5.2f} {cost.stage:10} {title}",
                flush=True,
            )
    print(f"largest deviation {worst:.0%}")


if __name__ == "__main__":
    main()
