"""`kernel`: how every compiled function of the package is declared, and where its machine code is kept.

Numba's disk cache does not notice changes in functions that a kernel calls from another file, so the kernels
of each module are kept in a folder keyed by a hash of the sources that the module is made from: its own and
those of all modules of the package that it imports, directly or not. Numba itself keys by CPU. The folders
lie in the user's cache directory, so that a package which is installed read-only caches as well;
`NUMBA_CACHE_DIR` names another place.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

_PACKAGE = Path(__file__).parent
_IMPORT = re.compile(rb"^\s*(?:from|import) weathercoat\.([\w.]+)", re.MULTILINE)


def cache_folder() -> Path:
    """The folder that holds the folders of all modules' kernels."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return Path(given)
    base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")  # noqa: PTH111 (without a home too)
    return Path(base) / "weathercoat" / "kernels"


@cache
def _source(module: str) -> bytes:
    """The source of a module of the package by its name below the package; empty where there is none."""
    path = _PACKAGE / (module.replace(".", "/") + ".py")
    return path.read_bytes() if path.is_file() else b""


@cache
def kernel_folder(module: str) -> Path:
    """The folder for the kernels of a module, by its name below the package: `film.lift`."""
    made_from = {module}
    unread = [module]
    while unread:
        for found in _IMPORT.findall(_source(unread.pop())):
            name = found.decode()
            if name not in made_from:
                made_from.add(name)
                unread.append(name)
    digest = hashlib.sha256()
    for name in sorted(made_from):
        digest.update(name.encode() + b"\0" + _source(name) + b"\0")
    return cache_folder() / f"{module}-{digest.hexdigest()[:16]}"


def is_writable(folder: Path) -> bool:
    """Whether compiled kernels can be kept in `folder`, which is made where it does not exist."""
    if folder.parts[:1] == ("~",):  # there is no home
        return False
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


# Numba refuses to declare a function whose cache has no place; without one, each run compiles anew.
_CAN_CACHE = is_writable(cache_folder())

import numba  # noqa: E402  (after the environment was read)


def is_cold() -> bool:
    """Whether no kernel has been kept yet, so that the next run takes longer."""
    return next(cache_folder().rglob("*.nbi"), None) is None


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile `function` at its first call; cached where it can be, IEEE, no check for zero divisors.

    It runs without the interpreter's lock, so that threads can share work.
    """
    package, _, module = function.__module__.partition(".")
    numba.config.CACHE_DIR = str(kernel_folder(module))  # type: ignore[attr-defined]
    can_cache = _CAN_CACHE and package == __name__.partition(".")[0]
    return numba.njit(cache=can_cache, fastmath=False, error_model="numpy", nogil=True)(function)  # type: ignore[no-any-return]


def formula(function: Callable[..., Any]) -> Callable[..., Any]:
    """A piece of arithmetic that becomes part of each kernel that calls it, so that loops over it can be
    vectorised.
    """
    return numba.njit(inline="always", fastmath=False, error_model="numpy")(function)  # type: ignore[no-any-return]
