"""How long Ctrl-C takes: `python -m tests.measure_interrupts --moments 15 --faces 300000`.

Each case is a whole run in a process of its own, of few steps, since a step is a small part of so large a
mesh. It is timed once, and then interrupted by SIGINT at random moments of that time; a row has the seconds
until the process was gone, and how many took over a second, ended in another code than 130, or left more than
a checkpoint behind. Compiled kernels come from the cache.
"""

from __future__ import annotations

import argparse
import random
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.output.meshes import write_mesh

CASES = {
    "PLY, sweeps, pictures": ("ply", ["remesh=off"]),
    "OBJ, newton": ("obj", ["remesh=off", "deformation.solver=newton", "output.preview=false"]),
    "STL, descent": ("stl", ["remesh=off", "deformation.solver=descent", "output.preview=false"]),
    "GLB, remeshed": ("glb", ["remesh.faces={faces}", "output.preview=false"]),
}
SETTINGS = ["ageing.steps=6", "ageing.duration=0.6", "snapshots.count=2", "checkpoint.steps=2"]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--moments", type=int, default=15, help="of each case")
    parser.add_argument("--faces", type=int, default=300_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="cases whose name holds this")
    given = parser.parse_args(arguments)
    heads = ("run", "moments", "median", "95 %", "most", "> 1 s", "wrong")
    print(f"{'case':24}" + "".join(f"{head:>9}" for head in heads))
    with tempfile.TemporaryDirectory() as folder:
        for name, (kind, settings) in CASES.items():
            if given.only in name:
                model = Path(folder) / f"sheet.{kind}"
                if not model.exists():
                    write_mesh(model, make_random_sheet(faces=given.faces))
                _measure(name, model, [s.format(faces=given.faces) for s in settings], given)


def _measure(name: str, model: Path, settings: list[str], given: argparse.Namespace) -> None:
    out = model.with_name("out")
    command = [sys.executable, "-m", "weathercoat", "run", "standard", str(model), "-o", str(out), "--quiet"]
    command += [word for setting in [*SETTINGS, *settings] for word in ("--set", setting)]
    started = time.monotonic()
    subprocess.run(command, check=True)
    whole = time.monotonic() - started
    moments = random.Random(f"{name} {given.seed}")
    latencies, wrong = [], 0
    for _ in range(given.moments):
        _clear(out)
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        try:
            process.wait(moments.uniform(0.3, whole))
            continue  # it ended before the moment came
        except subprocess.TimeoutExpired:
            pass
        asked = time.monotonic()
        process.send_signal(signal.SIGINT)
        _, said = process.communicate()
        latencies.append(time.monotonic() - asked)
        partial = out.with_name("out.partial")
        is_kept = not partial.exists() or (partial / "checkpoint" / "state.npz").exists()
        if process.returncode != 130 or out.exists() or not is_kept or said.count("\n") != 1:
            wrong += 1
            left = sorted(path.name for path in out.parent.iterdir())
            print(f"{name}: exit {process.returncode}, {said!r}, {left}", file=sys.stderr)
    _clear(out)
    latencies.sort()
    high = latencies[int(0.95 * (len(latencies) - 1))]
    over = sum(latency > 1.0 for latency in latencies)
    print(
        f"{name:24}{whole:9.1f}{len(latencies):9d}{statistics.median(latencies):9.2f}{high:9.2f}"
        f"{latencies[-1]:9.2f}{over:9d}{wrong:9d}",
        flush=True,
    )


def _clear(out: Path) -> None:
    for folder in (out, out.with_name("out.partial")):
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
