"""`kernel`: how every compiled function of the package is declared, and where its machine code is kept.

Numba's disk cache does not notice changes in functions that a kernel calls from another file, so the cache
folder is keyed by a hash of the package's sources; Numba itself keys by CPU. The folder lies in the user's
cache directory, so that a package which is installed read-only caches as well; `NUMBA_CACHE_DIR` overrides
it.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any


def cache_folder() -> Path:
    """The folder for compiled kernels: one for each state of the package's sources."""
    package = Path(__file__).parent
    digest = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        digest.update(source.relative_to(package).as_posix().encode())
        digest.update(source.read_bytes())
    base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")  # noqa: PTH111 (without a home too)
    return Path(base) / "weathercoat" / f"kernels-{digest.hexdigest()[:16]}"


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


if "NUMBA_CACHE_DIR" not in os.environ:
    os.environ["NUMBA_CACHE_DIR"] = str(cache_folder())
# Numba refuses to declare a function whose cache has no place; without one, each run compiles anew.
_CAN_CACHE = is_writable(Path(os.environ["NUMBA_CACHE_DIR"]))

import numba  # noqa: E402  (reads NUMBA_CACHE_DIR when it is imported)


def is_cold() -> bool:
    """Whether no kernel of this state of the package has been compiled yet, so that the next run takes
    longer.
    """
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    return next(folder.rglob("*.nbi"), None) is None


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile `function` at its first call; cached where it can be, IEEE, no check for zero divisors."""
    return numba.njit(cache=_CAN_CACHE, fastmath=False, error_model="numpy")(function)  # type: ignore[no-any-return]
