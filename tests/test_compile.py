"""Where compiled kernels are kept, and what happens where they cannot be."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from weathercoat.compile import is_writable

TRIAL = "from weathercoat.film.noise import perlin, PERMUTATION; print(perlin(3.14, 42.0, 7.0, PERMUTATION))"


def test_a_folder_is_made_where_it_can_be(tmp_path: Path) -> None:
    assert is_writable(tmp_path / "a" / "b") and (tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").touch()
    assert not is_writable(tmp_path / "file" / "c")
    assert not is_writable(Path("~/cache"))


@pytest.mark.parametrize("place", ["file", "no home"])
def test_kernels_run_without_a_place_to_keep_them(tmp_path: Path, place: str) -> None:
    """Where the cache folder cannot be made, each process compiles what it needs."""
    (tmp_path / "file").touch()
    environment = {key: value for key, value in os.environ.items() if key not in ("NUMBA_CACHE_DIR", "HOME")}
    environment["PYTHONPATH"] = str(Path(__file__).parent.parent)
    if place == "file":
        environment["XDG_CACHE_HOME"] = str(tmp_path / "file")
    else:
        environment.pop("XDG_CACHE_HOME", None)
        environment["HOME"] = str(tmp_path / "file")
    run = subprocess.run(
        [sys.executable, "-c", TRIAL],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert float(run.stdout) == pytest.approx(0.13691995878400012, abs=1e-15)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file"]
