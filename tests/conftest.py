"""Shared fixtures."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def meshes_folder() -> Path:
    """The folder of real meshes that `WEATHERCOAT_MESHES` names; skips where there is none."""
    folder = os.environ.get("WEATHERCOAT_MESHES", "")
    if not folder or not Path(folder).is_dir():
        pytest.skip("WEATHERCOAT_MESHES names no folder of test meshes")
    return Path(folder)
