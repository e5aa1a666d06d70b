"""The recipes of docs/scaling.md with tools that are not ours: each is run where its tool is installed."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.test_docs import DOCS, blocks, make_wrapper
from weathercoat.mesh.shapes import make_gear, make_sign
from weathercoat.output.meshes import write_mesh

PAGE = DOCS / "scaling.md"
TOOLS = {"xargs": {"sign", "gear"}, "parallel": {"sign", "gear"}, "sbatch": {"sign", "gear"}}
TOOLS |= {
    tool: {f"{model}-{config}" for model in ("sign", "gear") for config in ("standard", "rusting")}
    for tool in ("make", "snakemake")
}
SMALL = "preset: [{}]\nremesh: {{faces: 300}}\nageing: {{steps: 10}}\n"


def recipe(tool: str) -> str:
    (found,) = (body for body in blocks(PAGE, "sh") if re.search(rf"\b{tool}\b", body))
    return found


def can_run(tool: str) -> bool:
    if tool == "sbatch":  # installed is not enough: the node has to be up
        return bool(shutil.which("sinfo")) and "idle" in subprocess.getoutput("sinfo")
    return bool(shutil.which(tool, path=search_path()))


def search_path() -> str:
    return f"{Path(sys.executable).parent}:/usr/bin:/bin"


@pytest.fixture
def farm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with what the page makes, as small as can be, and the recipes."""
    for name in ("models", "configs", "aged"):
        (tmp_path / name).mkdir()
    for name, surface in (("sign", make_sign()), ("gear", make_gear())):
        write_mesh(tmp_path / "models" / f"{name}.obj", surface)
    for name in ("standard", "rusting"):
        (tmp_path / "configs" / f"{name}.yaml").write_text(SMALL.format(name))
    shutil.copytree(DOCS / "recipes", tmp_path / "docs" / "recipes")
    monkeypatch.setenv("PATH", f"{make_wrapper(tmp_path)}:{search_path()}")
    return tmp_path


def run(command: str, farm: Path) -> int:
    """The exit code of a command of the shell."""
    home = farm / "home"  # where tools keep their notes, and ask for a citation once
    (home / ".parallel").mkdir(parents=True, exist_ok=True)
    (home / ".parallel" / "will-cite").touch()
    caches = os.environ.get("XDG_CACHE_HOME", str(Path("~/.cache").expanduser()))
    environment = {**os.environ, "HOME": str(home), "XDG_CACHE_HOME": caches}
    return subprocess.run(
        ["bash", "-euo", "pipefail", "-c", command], cwd=farm, env=environment, stdout=subprocess.DEVNULL
    ).returncode


@pytest.mark.parametrize("script", sorted((DOCS / "recipes").iterdir()), ids=lambda path: path.name)
def test_every_recipe_is_on_the_page(script: Path) -> None:
    assert f"(recipes/{script.name})" in PAGE.read_text(encoding="utf-8")


@pytest.mark.parametrize("tool", TOOLS)
def test_every_tool_has_its_block(tool: str) -> None:
    assert "weathercoat run" in recipe(tool) or "docs/recipes/" in recipe(tool)


@pytest.mark.long
@pytest.mark.parametrize("tool", TOOLS)
def test_recipes_run(tool: str, farm: Path) -> None:
    """They make every result, a second time nothing, and fail for a broken model, with the others made."""
    if not can_run(tool):
        pytest.skip(f"{tool} is not here")
    assert run(recipe(tool), farm) == 0
    assert {path.parent.name for path in farm.glob("aged/*/run.json")} == TOOLS[tool]
    made = {path: path.stat().st_ino for path in farm.glob("aged/*/run.json")}
    assert run(recipe(tool), farm) == 0
    assert {path: path.stat().st_ino for path in made} == made
    (farm / "models" / "broken.obj").write_text("no model")
    (farm / "models" / "tube.obj").write_bytes((farm / "models" / "gear.obj").read_bytes())
    assert run(recipe(tool).splitlines()[-1] if tool in ("make", "snakemake") else recipe(tool), farm) != 0
    assert list(farm.glob("aged/tube*/run.json"))
    assert {path: path.stat().st_ino for path in made} == made
