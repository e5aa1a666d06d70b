"""Shared fixtures."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

from tests.checked import COMPILED, checked_kernel
from weathercoat import compile as compiling

if not COMPILED:
    # before any other module of the package declares its kernels
    compiling.kernel = checked_kernel


# The same examples every time; where long tests run, more of them.
settings.register_profile("default", derandomize=True, deadline=None)
settings.register_profile("long", derandomize=True, deadline=None, max_examples=300)


def pytest_configure(config: pytest.Config) -> None:
    """Choose how many examples property tests try that do not say so themselves."""
    chosen = config.getoption("markexpr", "")
    settings.load_profile("long" if "long" in chosen.replace("not long", "") else "default")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave out, without the JIT, what is marked as needing it."""
    for item in items:
        if not COMPILED and item.get_closest_marker("compiled"):
            item.add_marker(pytest.mark.skip(reason="takes too long without the JIT"))


@pytest.fixture(scope="session")
def meshes_folder() -> Path:
    """The folder of real meshes that `WEATHERCOAT_MESHES` names; skips where there is none."""
    folder = os.environ.get("WEATHERCOAT_MESHES", "")
    if not folder or not Path(folder).is_dir():
        pytest.skip("WEATHERCOAT_MESHES names no folder of test meshes")
    return Path(folder)
