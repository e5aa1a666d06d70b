"""Measure a batch: how well it uses the cores, how quick a rerun is, and what a kill costs.

    python -m tests.measure_batch speed --assets 200
    python -m tests.measure_batch kills --assets 24 --kills 10

`speed` ages so many small models (3,000 faces, 300 steps, no pictures) in this process, warm, and then by
`weathercoat batch` with two workers; the bar is 1.25 times half the sum of the seconds in this process.
`kills` kills a batch at random moments, runs it again, and compares what is there with a batch that was
left alone.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from weathercoat.config.load import load_config
from weathercoat.mesh import shapes
from weathercoat.output.meshes import write_mesh
from weathercoat.run import run_asset

SETTINGS = ("remesh.faces=3000", "ageing.steps=300", "output.preview=false")
BAR = 1.25


def make_models(folder: Path, count: int) -> list[Path]:
    """So many models of several kinds, each of another size."""
    makers = (shapes.make_bracket, shapes.make_pipe, shapes.make_barrel, shapes.make_sign)
    models = []
    for number in range(count):
        maker = makers[number % len(makers)]
        path = folder / f"{maker.__name__.removeprefix('make_')}_{number:03d}.obj"
        surface = maker()
        write_mesh(path, replace(surface, vertices=surface.vertices * (1.0 + 0.01 * number)))
        models.append(path)
    return models


def start_batch(models: Path, out: Path) -> subprocess.Popen[bytes]:
    """`weathercoat batch` with two workers."""
    settings = [word for setting in SETTINGS for word in ("--set", setting)]
    command = [sys.executable, "-m", "weathercoat", "batch", str(models), "-o", str(out), "-j", "2", "-q"]
    return subprocess.Popen([*command, *settings])


def run_whole_batch(models: Path, out: Path) -> float:
    """Seconds of a batch that is left alone."""
    started = time.perf_counter()
    if start_batch(models, out).wait():
        raise SystemExit("the batch failed")
    return time.perf_counter() - started


def measure_speed(work: Path, count: int) -> None:
    """Print seconds in this process, of the batch, and of its rerun."""
    folder = work / "models"
    folder.mkdir()
    models = make_models(folder, count)
    loaded = load_config("standard", SETTINGS)
    run_asset(loaded, models[0], work / "warm")
    (work / "alone").mkdir()
    alone = 0.0
    for model in models:
        started = time.perf_counter()
        run_asset(loaded, model, work / "alone" / model.stem)
        alone += time.perf_counter() - started
    together = run_whole_batch(folder, work / "batch")
    again = run_whole_batch(folder, work / "batch")
    print(f"{count} assets in this process   {alone:8.1f} s")
    print(f"batch with two workers     {together:8.1f} s")
    print(f"batch / half of the sum    {2.0 * together / alone:8.2f}   (bar {BAR})")
    print(f"rerun of the finished batch{again:8.2f} s")
    print(f"other bytes than in this process: {sum(map(differs, *both(work, models)))} of {count}")


def both(work: Path, models: list[Path]) -> tuple[list[Path], list[Path]]:
    """The folders of the same jobs in this process and in the batch."""
    return [work / "alone" / model.stem for model in models], [
        work / "batch" / model.stem for model in models
    ]


def measure_kills(work: Path, count: int, kills: int, seed: int) -> None:
    """Kill batches at random moments, and print what was done again and what differs."""
    folder = work / "models"
    folder.mkdir()
    models = make_models(folder, count)
    expected = work / "expected"
    whole = run_whole_batch(folder, expected)
    draw = random.Random(seed)
    wrong = redone = left = 0
    for _ in range(kills):
        out = work / "killed"
        moment = draw.uniform(0.0, whole)
        batch = start_batch(folder, out)
        time.sleep(moment)
        batch.send_signal(signal.SIGKILL)
        batch.wait()
        finished = {run: run.stat().st_ino for run in out.glob("*[0-9]/run.json")}
        run_whole_batch(folder, out)
        redone += sum(run.stat().st_ino != node for run, node in finished.items())
        wrong += sum(differs(out / model.stem, expected / model.stem) for model in models)
        left += len(list(out.glob("*.partial")))
        print(
            f"killed after {moment:5.1f} of {whole:.1f} s with {len(finished)} of {count} finished",
            flush=True,
        )
        shutil.rmtree(out)
    print(f"{kills} kills: {redone} finished runs done again, {wrong} with other bytes, {left} left-overs")


def differs(one: Path, other: Path) -> bool:
    """Whether two runs differ in any byte but of their timing."""
    return digests(one) != digests(other)


def digests(folder: Path) -> dict[str, str]:
    """Hashes of the files of a run."""
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != "timing.json")
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["speed", "kills"])
    parser.add_argument("--assets", type=int, default=200)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with tempfile.TemporaryDirectory() as name:
        if given.what == "speed":
            measure_speed(Path(name), given.assets)
        else:
            measure_kills(Path(name), given.assets, given.kills, given.seed)


if __name__ == "__main__":
    main()
