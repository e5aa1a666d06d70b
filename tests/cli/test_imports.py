"""The command line answers before the heavy libraries are loaded."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = ["numpy", "numba", "scipy", "pydantic", "yaml", "trimesh", "meshio", "PIL", "igl", "embreex", "tqdm"]
PROGRAM = """
import sys
from weathercoat.cli.handler import call
code = call(sys.argv[2:])
loaded = [name for name in sys.argv[1].split(",") if name in sys.modules]
print("LOADED", code, *loaded)
"""


@pytest.mark.parametrize(
    "arguments",
    [
        ["--version"],
        ["--help"],
        ["run", "--help"],
        ["config", "--help"],
        ["config", "show", "--help"],
        ["config", "list"],
        ["plan", "--help"],
        ["remesh", "--help"],
        ["inspect", "--help"],
        ["render", "--help"],
        ["view", "--help"],
        ["risk", "--help"],
        ["bake", "--help"],
        ["severity", "--help"],
        ["verify", "--help"],
        ["compare", "--help"],
        ["baseline", "--help"],
        ["baseline", "check", "--help"],
        ["bench", "--help"],
        ["bench", "speed", "--help"],
        ["warmup", "--help"],
        ["completion", "fish"],
        ["run", "--frob"],
    ],
)
def test_light_commands_load_nothing_heavy(arguments: list[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, ",".join(HEAVY), *arguments],
        capture_output=True,
        text=True,
        check=True,
    )
    expected = 2 if "--frob" in arguments else 0
    assert done.stdout.splitlines()[-1] == f"LOADED {expected}"
