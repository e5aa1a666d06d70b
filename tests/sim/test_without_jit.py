"""Kernels are plain Python too: with the JIT off they give the same bits, and no warning."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.sim.runs import LITERAL_CURL, LITERAL_FILM, failed_shares, finish, make_run, snapshot_bytes
from weathercoat.mesh.shapes import make_random_sheet

SOLVERS = ("sweeps", "momentum", "descent", "newton", "none")


def run_digests() -> list[str]:
    """Of the last snapshots of runs of 20 steps on 60 faces, with each solver and by the paper's rules."""
    sheet = make_random_sheet(60)
    runs = [make_run(sheet, steps=20, curl={"deformation_solver": solver}) for solver in SOLVERS]
    runs.append(make_run(sheet, steps=20, film=LITERAL_FILM, curl=LITERAL_CURL))
    for run in runs:
        finish(run)
        assert failed_shares(run)["lost"] > 0.1
    return [hashlib.sha256(snapshot_bytes(run.snapshot())).hexdigest() for run in runs]


@pytest.mark.compiled
def test_runs_are_the_compiled_ones_bit_for_bit() -> None:
    """Compiled code and NumPy round alike, and take exponentials and angles from the same C library."""
    root = Path(__file__).parents[2]
    code = "from tests.sim.test_without_jit import run_digests; print(*run_digests())"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=root,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == run_digests()
