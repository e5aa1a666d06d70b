"""Results for every x86-64-v3 processor: that each library is pinned, and that the bytes are the same."""

from __future__ import annotations

import json
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from weathercoat import target
from weathercoat.cli.handler import call
from weathercoat.config.load import load_config
from weathercoat.errors import ResumeError, UsageError
from weathercoat.mesh.shapes import make_sign
from weathercoat.output.meshes import write_mesh
from weathercoat.output.rays import make_rays
from weathercoat.output.report import versions
from weathercoat.output.tree import TreeRays
from weathercoat.resume import fingerprint
from weathercoat.run import run_asset

ROOT = Path(__file__).parents[1]
IS_V3 = platform.machine() == "x86_64" and all(map(target._processor_has, target._FEATURES))
needs_v3 = pytest.mark.skipif(not IS_V3, reason="needs an x86-64-v3 processor with Linux")
# What libraries find where there is no AVX-512. The emulator's sort of indices by AVX2 is wrong, which is no
# matter: NumPy's fallback does not use it.
WITHOUT_AVX512 = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX512CD,-AVX512BW,-AVX512DQ,-AVX512VL"}
EMULATOR = shutil.which("qemu-x86_64")

FINDS = """
import ctypes, json
from pathlib import Path
from weathercoat.target import pin
pin()
import numpy
from numba.core.registry import cpu_target
from numpy._core import _multiarray_umath as umath

blas = {line.split()[-1] for line in Path("/proc/self/maps").read_text().splitlines() if "openblas" in line}
cores = []
for path in blas:
    library = ctypes.CDLL(path)
    for name in ("scipy_openblas_get_corename64_", "scipy_openblas_get_corename", "openblas_get_corename"):
        if hasattr(library, name):
            tell = getattr(library, name)
            tell.restype = ctypes.c_char_p
            cores.append(tell().decode())
            break
print(json.dumps({
    "numpy": [name for name in umath.__cpu_dispatch__ if umath.__cpu_features__[name]],
    "numba": cpu_target.target_context.codegen().magic_tuple()[1],
    "blas": cores,
}))
"""
COMPUTES = """
import hashlib, math
from weathercoat.target import pin
pin()
import numpy as np
from weathercoat.film.noise import PERMUTATION, perlin

random = np.random.Generator(np.random.PCG64(1))
x = random.normal(size=10_000)
matrix = random.normal(size=(200, 200))
results = [np.exp(x), np.sin(x), np.arctan2(x, x[::-1]), np.log(abs(x)), np.arccos(x / 9), x.sum()]
results += [np.argsort(random.integers(0, 500, 10_000)), matrix @ matrix, np.linalg.solve(matrix, x[:200])]
results += [math.exp(value) * math.atan2(value, 2) for value in x[:1000]]
results += [perlin(3.14 * k, 42.0, 7.0, PERMUTATION) for k in range(100)]
print(hashlib.sha256(b"".join(np.asarray(result).tobytes() for result in results)).hexdigest())
"""


def say(*command: str, **changes: str) -> str:
    """What a process with other surroundings prints."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **changes}
    return subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True).stdout


@pytest.fixture
def pinned(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """What a pinned process sees of it, although the libraries of this one have chosen long ago."""
    for name, value in target.ENVIRONMENT.items():
        monkeypatch.setenv(name, value)
    versions.cache_clear()
    yield
    versions.cache_clear()


@needs_v3
def test_every_library_is_pinned() -> None:
    found = json.loads(say(sys.executable, "-c", FINDS))
    assert found["numpy"] == []
    assert found["numba"] == "x86-64-v3"
    assert all(core == "Haswell" for core in found["blas"])


@needs_v3
def test_functions_are_the_same_on_other_processors() -> None:
    here = say(sys.executable, "-c", COMPUTES)
    assert say(sys.executable, "-c", COMPUTES, **WITHOUT_AVX512) == here
    if EMULATOR:
        assert say(EMULATOR, "-cpu", "Haswell", sys.executable, "-c", COMPUTES) == here


@needs_v3
@pytest.mark.long
@pytest.mark.parametrize("solver", ["sweeps", "momentum", "descent", "newton"])
def test_runs_are_the_same_on_other_processors(tmp_path: Path, solver: str) -> None:
    """Whole folders, with pictures; only the seconds differ."""
    write_mesh(tmp_path / "sign.obj", make_sign())
    small = ["remesh.faces=500", "ageing.steps=30", "output.picture_width=160", "output.picture_height=120"]
    settings = [word for value in [*small, f"deformation.solver={solver}"] for word in ("--set", value)]

    def run(name: str, *emulator: str, **changes: str) -> dict[str, bytes]:
        out = tmp_path / name
        weathercoat = (*emulator, sys.executable, "-m", "weathercoat")
        model = str(tmp_path / "sign.obj")
        say(*weathercoat, "run", "standard", model, "-o", str(out), *settings, "--portable", **changes)
        return {
            str(path.relative_to(out)): path.read_bytes()
            for path in out.rglob("*.*")
            if path.name != "timing.json"
        }

    here = run("here")
    assert run("without", **WITHOUT_AVX512) == here
    if EMULATOR:
        assert run("emulated", EMULATOR, "-cpu", "Haswell") == here


@needs_v3
def test_processes_that_are_started_are_pinned_too() -> None:
    start = "import subprocess, sys; from weathercoat.target import pin; pin(); "
    ask = "from weathercoat.target import target; print(target())"
    script = start + f"subprocess.run([sys.executable, '-c', {ask!r}])"
    assert say(sys.executable, "-c", script).strip() == "x86-64-v3"


def test_where_it_cannot_be_it_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(platform, "machine", lambda: "aarch64")
        with pytest.raises(UsageError, match="this machine is aarch64"):
            target.pin()
    monkeypatch.setattr(platform, "machine", lambda: "x86_64")
    with monkeypatch.context() as patch:
        patch.setattr(target, "_processor_has", lambda feature: feature not in ("fma", "avx2"))
        with pytest.raises(UsageError, match="lacks avx2, fma"):
            target.pin()
    monkeypatch.setattr(target, "_processor_has", lambda feature: True)
    with pytest.raises(UsageError, match="numpy and numba chose for this processor"):
        target.pin()
    assert target.target() is None


def test_it_is_a_usage_error(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(platform, "machine", lambda: "aarch64")
    assert call(["run", "standard", "sign.obj", "--portable"]) == 2
    assert "aarch64" in capsys.readouterr().err


def test_pictures_do_without_embree(pinned: None) -> None:
    surface = make_sign()
    assert isinstance(make_rays(surface.vertices, surface.faces), TreeRays)


def test_a_result_of_this_processor_is_not_taken_for_a_portable_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_mesh(tmp_path / "sign.obj", make_sign())
    small = ["remesh.faces=300", "ageing.steps=4", "output.preview=false"]
    loaded = load_config("standard", small)
    out = tmp_path / "out"
    assert "target" not in run_asset(loaded, tmp_path / "sign.obj", out)["versions"]
    native = fingerprint(loaded, {})
    with monkeypatch.context() as patch:
        for name, value in target.ENVIRONMENT.items():
            patch.setenv(name, value)
        versions.cache_clear()
        assert fingerprint(loaded, {}) != native
        with pytest.raises(ResumeError, match="the target is x86-64-v3, and was the processor at hand"):
            run_asset(loaded, tmp_path / "sign.obj", out, resume=True)
        report = run_asset(loaded, tmp_path / "sign.obj", out, overwrite=True)
        assert report["versions"]["target"] == "x86-64-v3"
        again = run_asset(loaded, tmp_path / "sign.obj", out, resume=True)
        assert again["snapshots"] == report["snapshots"]
    versions.cache_clear()
    with pytest.raises(ResumeError, match="the target is the processor at hand, and was x86-64-v3"):
        run_asset(loaded, tmp_path / "sign.obj", out, resume=True)
