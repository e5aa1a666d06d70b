"""The Khronos glTF validator, where Node.js and the package `gltf-validator` are there."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

_PLACES = (
    os.environ.get("WEATHERCOAT_NODE_MODULES", ""),
    str(Path(__file__).parents[2] / "web" / "node_modules"),
)
_SCRIPT = """
const validator = require(process.argv[1]);
const bytes = new Uint8Array(require('fs').readFileSync(process.argv[2]));
validator.validateBytes(bytes).then((report) => console.log(JSON.stringify(report.issues)));
"""


def validate(path: Path) -> dict[str, Any]:
    """The issues that the validator finds in a file; skips the test where it is not installed."""
    node = shutil.which("node")
    package = next(
        (p for p in (Path(place) / "gltf-validator" for place in _PLACES if place) if p.is_dir()), None
    )
    if node is None or package is None:
        pytest.skip(
            "needs Node.js and gltf-validator: run `npm install` in web/, or set WEATHERCOAT_NODE_MODULES"
        )
    done = subprocess.run(
        [node, "-e", _SCRIPT, str(package), str(path)],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    issues: dict[str, Any] = json.loads(done.stdout)
    return issues
