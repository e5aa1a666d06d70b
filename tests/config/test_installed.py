"""An installed package brings its configs, from the one copy in `configs/`."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from weathercoat.config.presets import preset_names, presets_folder

SOURCE = Path(__file__).parents[2]


def test_a_build_holds_the_configs_and_finds_them(tmp_path: Path) -> None:
    tree, built = tmp_path / "tree", tmp_path / "built"
    for name in ("weathercoat", "configs"):
        shutil.copytree(SOURCE / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(SOURCE / name, tree / name)
    build = [sys.executable, "setup.py", "--quiet", "build_py", "--build-lib", str(built)]
    subprocess.run(build, cwd=tree, check=True, capture_output=True)
    shutil.rmtree(tree)
    done = subprocess.run(
        [sys.executable, "-m", "weathercoat", "config", "check", *preset_names()],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(built)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "".join(f"{name}: valid\n" for name in preset_names())
    shipped = {path.name for path in (built / "weathercoat" / "configs").iterdir()}
    assert shipped == {path.name for path in presets_folder().glob("*.yaml")}
    assert (built / "weathercoat" / "py.typed").exists()
    assert (built / "weathercoat" / "config" / "quality.json").exists()
