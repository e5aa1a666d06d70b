"""Measure how far runs on other processors drift apart: `python -m tests.measure_machines [--seeds 8]`; and,
with `--portable`, whether those that are pinned to x86-64-v3 are the same bytes there.

Other machines are emulated on this one, each in a process of its own: kernels compiled for the oldest
processor of 64 bits (without AVX and FMA), the C library's mathematical functions without FMA, NumPy without
AVX2, BLAS for an older core, and all of it at once. Every run is whole: the model is remeshed and aged there.
Compared are, at several ages, what has broken and fallen (the same edges and faces or not), positions of the
film's corners [sizes], and counts; the spread of these between seeds stands beside. Compiling for the oldest
processor takes minutes, once: `--cache` keeps the result. Portable runs are compared bit for bit, on this
processor and on those that an emulator, `qemu-x86_64`, makes of it, which takes twenty times as long.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from weathercoat.config.load import load_config
from weathercoat.mesh.shapes import make_sign, make_sphere
from weathercoat.run import prepare_simulation, remesh_painted
from weathercoat.sim.simulation import Simulation
from weathercoat.target import ENVIRONMENT

_AGES = (0.1, 0.25, 0.5, 0.75, 1.0)
_FACES = 3000
_MODELS = {"sign": make_sign, "sphere": lambda: make_sphere(subdivisions=4)}
_CASES = {
    "sign": ("sign", []),
    "sphere": ("sphere", []),
    "sign, momentum": ("sign", ["deformation.solver=momentum"]),
    "sign, descent": ("sign", ["deformation.solver=descent", "ageing.steps=100"]),
    "sign, newton": ("sign", ["deformation.solver=newton", "ageing.steps=100"]),
}
_OLD_KERNELS = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
_OLD_C = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F"}
_OLD_NUMPY = {"NPY_DISABLE_CPU_FEATURES": "X86_V3,X86_V4,AVX512_ICL,AVX512_SPR"}
_OLD_BLAS = {"OPENBLAS_CORETYPE": "Nehalem"}
MACHINES = {
    "kernels for x86-64": _OLD_KERNELS,
    "C library without FMA": _OLD_C,
    "NumPy without AVX2": _OLD_NUMPY,
    "BLAS for Nehalem": _OLD_BLAS,
    "all of it": {**_OLD_KERNELS, **_OLD_C, **_OLD_NUMPY, **_OLD_BLAS},
}
_WITHOUT_AVX512 = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX512CD,-AVX512BW,-AVX512DQ,-AVX512VL"}
EMULATED = ("Haswell", "Broadwell", "EPYC", "max")


class State(NamedTuple):
    """A run at one age: corners (m, 3, 3) of the film's faces at their places, NaN where fallen; the twins of
    half-edges (3 m,); the figures that are compared by number.
    """

    corners: np.ndarray
    twin: np.ndarray
    figures: np.ndarray


FIGURES = ("separated", "breaks", "flakes", "lost area")


def state_of(simulation: Simulation, initial_twin: np.ndarray) -> State:
    """What is compared of a run now."""
    mesh = simulation.mesh
    corners = mesh.positions[mesh.tail].reshape(-1, 3, 3)
    corners[~mesh.alive] = np.nan
    broken = np.repeat(mesh.alive, 3) & (mesh.twin < 0) & (initial_twin >= 0)
    figures = (
        np.isfinite(simulation.rust.lifted_age).sum(),
        broken.sum(),
        len(simulation.flake_areas),
        sum(simulation.flake_areas),
    )
    return State(corners, mesh.twin.copy(), np.array(figures, float))


def age_here(out: Path, seeds: int) -> None:
    """Age every case with every seed in this process, and keep the states in a file."""
    states = {}
    for case, (model, overrides) in _CASES.items():
        for seed in range(1, seeds + 1):
            config = load_config("standard", [f"remesh.faces={_FACES}", f"seed={seed}", *overrides]).config
            surface = _MODELS[model]()
            simulation = prepare_simulation(remesh_painted(surface, config), config, surface)
            twin = simulation.mesh.twin.copy()
            for age in _AGES:
                while simulation.age < age - 1e-12:
                    simulation.step()
                for name, value in state_of(simulation, twin)._asdict().items():
                    states[f"{case}/{seed}/{age}/{name}"] = value
    np.savez(out, **states)


def age_on(
    machine: dict[str, str], folder: Path, seeds: int, emulator: Sequence[str] = ()
) -> dict[str, np.ndarray]:
    """The states of all cases and seeds on another machine."""
    out = folder / "states.npz"
    command = [sys.executable, "-m", "tests.measure_machines", "--seeds", str(seeds), "--into", str(out)]
    subprocess.run([*emulator, *command], env={**os.environ, **machine}, check=True)
    with np.load(out) as stored:
        return dict(stored)


def read_state(states: dict[str, np.ndarray], case: str, seed: int, age: float) -> State:
    return State(*(states[f"{case}/{seed}/{age}/{name}"] for name in State._fields))


def print_comparison(here: dict[str, np.ndarray], there: dict[str, np.ndarray], seeds: int) -> None:
    """One line for each case and age."""
    for case in _CASES:
        for age in _AGES:
            pairs = [
                (read_state(here, case, s, age), read_state(there, case, s, age)) for s in range(1, seeds + 1)
            ]
            same, apart = 0, 0.0
            for one, other in pairs:
                fallen = [np.isnan(state.corners) for state in (one, other)]
                if np.array_equal(one.twin, other.twin) and np.array_equal(*fallen):
                    same += 1
                    apart = max(apart, float(np.nanmax(np.abs(one.corners - other.corners), initial=0.0)))
            figures = np.array([[one.figures, other.figures] for one, other in pairs])
            change = np.abs(figures[:, 1] - figures[:, 0]).max(axis=0)
            spread = figures[:, 0].std(axis=0, ddof=1)
            cells = "  ".join(
                f"{name} {c:.3g} (seeds {s:.3g})" for name, c, s in zip(FIGURES, change, spread, strict=True)
            )
            print(f"  {case:15} age {age:<5} same {same}/{seeds}  positions {apart:7.1e}  {cells}")


def print_portable(folder: Path, seeds: int) -> None:
    """One line for each machine: how many of the arrays of all states are the same, bit for bit."""
    machines: dict[str, tuple[dict[str, str], tuple[str, ...]]] = {"C library": (_WITHOUT_AVX512, ())}
    emulator = shutil.which("qemu-x86_64")
    if emulator:
        machines |= {model: ({}, (emulator, "-cpu", model)) for model in EMULATED}
    here = age_on(dict(ENVIRONMENT), folder, seeds)
    for name, (machine, command) in machines.items():
        there = age_on({**machine, **ENVIRONMENT}, folder, seeds, command)
        same = sum(here[key].tobytes() == there[key].tobytes() for key in here)
        print(f"{name:10} {same} of {len(here)} arrays the same", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--cache", type=Path, help="where kernels of other processors are kept")
    parser.add_argument("--portable", action="store_true", help="compare runs that are pinned to x86-64-v3")
    parser.add_argument("--into", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.into:
        age_here(given.into, given.seeds)
        return
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        if given.portable:
            print_portable(folder, given.seeds)
            return
        cache = {"NUMBA_CACHE_DIR": str(given.cache or folder / "kernels")}
        here = age_on({}, folder, given.seeds)
        for name, machine in MACHINES.items():
            print(name, flush=True)
            own = cache if "NUMBA_CPU_NAME" in machine else {}
            print_comparison(here, age_on({**machine, **own}, folder, given.seeds), given.seeds)


if __name__ == "__main__":
    main()
