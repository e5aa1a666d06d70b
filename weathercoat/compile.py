"""`kernel`: how every compiled function of the package is declared, and where its machine code is kept.

Numba's own disk cache does not notice changes in functions that a kernel calls from another file, and two
processes that compile at once can overwrite each other's entries. So each kernel is a file of its own,
named by a hash of what it was made from (its signature, the processor, the versions of Python and Numba,
and whether it checks its indices), in a folder named by a hash of the sources that its module is made from:
its own and those of all modules of the package that it imports, directly or not. A file appears whole. One
process at a time compiles, and the others wait for what they need, so that workers which start together
compile each kernel once between them.

The folders lie in the user's cache directory, so that a package which is installed read-only caches as well;
`NUMBA_CACHE_DIR` names another place.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from tempfile import NamedTemporaryFile, mkdtemp
from threading import get_ident
from typing import Any

import numba
import numba.core.event
import numba.np.linalg
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.serialize import dumps

from weathercoat.lock import FolderLock


def _take_blas_for_granted() -> None:
    """Spare the start the import of SciPy's linear algebra, a fifth of a second.

    Numba imports it with its array functions only to learn whether it is there, which it is since we depend
    on it; a function that needs it, and none here does, looks again.
    """
    if "numba.np.arraymath" in sys.modules:
        return
    look = numba.np.linalg.ensure_blas
    numba.np.linalg.ensure_blas = lambda: None
    try:
        import_module("numba.np.arraymath")
    finally:
        numba.np.linalg.ensure_blas = look


_take_blas_for_granted()

_PACKAGE = Path(__file__).parent
_IMPORT = re.compile(rb"^\s*(?:from|import) weathercoat\.([\w.]+)", re.MULTILINE)
_FOLDER = re.compile(r"[\w.]+-[0-9a-f]{16}")
_DAY = 86_400.0
_DAYS_KEPT = 30
_SECONDS_BETWEEN_LOOKS = 0.02
_SECONDS_TO_WAIT = 300.0  # for one kernel, lest a process that was stopped as it compiled stops all others
_WAIT = "weathercoat:wait"  # the event of waiting for a kernel that another process compiles


def cache_folder() -> Path | None:
    """The folder that holds the folders of all modules' kernels; None without a home."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return Path(given) / "weathercoat"
    base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")  # noqa: PTH111 (without a home too)
    return None if base.startswith("~") else Path(base) / "weathercoat" / "kernels"


@cache
def _source(module: str) -> bytes:
    """The source of a module of the package by its name below the package; empty where there is none."""
    path = _PACKAGE / (module.replace(".", "/") + ".py")
    return path.read_bytes() if path.is_file() else b""


@cache
def kernel_folder(module: str) -> Path | None:
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
    base = cache_folder()
    return base and base / f"{module}-{digest.hexdigest()[:16]}"


class _Turn:
    """The turn to compile, which one process at a time has.

    It is one lock for all kernels: a kernel compiles those that it calls, and processes that held a lock a
    kernel, taken in other orders, could wait for each other for ever. Numba's own lock keeps threads apart.
    """

    def __init__(self) -> None:
        self._lock: FolderLock | None = None
        self._depth = 0

    def take(self) -> bool:
        """Whether this process has the turn now; also where there is no place for a lock, or no lock."""
        if self._lock is None:
            folder = cache_folder()
            if folder is None:
                return True
            lock = FolderLock(folder)
            with suppress(OSError):
                folder.mkdir(parents=True, exist_ok=True)
                if not lock.take():
                    return False
            self._lock = lock
        return True

    @contextmanager
    def hold(self) -> Iterator[None]:
        """Give the turn back at the end of the block in which it was taken, of nested ones the outermost."""
        self._depth += 1
        try:
            yield
        finally:
            self._depth -= 1
            if self._depth == 0 and self._lock is not None:
                self._lock.release(remove=False)
                self._lock = None


_turn = _Turn()


def _compile_in_turn(compile: Callable[[Any], Any], signature: Any) -> Any:
    """Let Numba look for a kernel and compile it; a miss takes the turn, which goes back whatever happens."""
    with global_compiler_lock, _turn.hold():
        return compile(signature)


class _KernelCache(NullCache):  # type: ignore[misc]
    """Keeps the machine code of one function, for Numba."""

    def __init__(self, function: Callable[..., Any], module: str) -> None:
        self._function = function
        self._module = module

    def _path(self, signature: object, codegen: Any) -> Path | None:
        folder = kernel_folder(self._module)
        checks = numba.config.BOUNDSCHECK  # type: ignore[attr-defined]
        made_from = (signature, codegen.magic_tuple(), numba.__version__, sys.version, checks)
        digest = hashlib.sha256(repr(made_from).encode()).hexdigest()[:16]
        return folder and folder / f"{self._function.__name__}-{digest}.kernel"

    def load_overload(self, sig: object, target_context: Any) -> CompileResult | None:
        target_context.refresh()
        path = self._path(sig, target_context.codegen())
        if path is None:
            return None
        loaded = self._load(path, target_context)
        return loaded or self._wait_for(path, target_context)

    def _wait_for(self, path: Path, target_context: Any) -> CompileResult | None:
        """The kernel once another process has compiled it; None when it is this one's turn to."""
        until = time.monotonic() + _SECONDS_TO_WAIT
        if not _turn.take():
            with numba.core.event.trigger_event(_WAIT):
                while not _turn.take() and time.monotonic() < until:
                    time.sleep(_SECONDS_BETWEEN_LOOKS)
                    loaded = self._load(path, target_context)
                    if loaded is not None:
                        return loaded
        # who had the turn until now may have compiled it
        return self._load(path, target_context)

    def _load(self, path: Path, target_context: Any) -> CompileResult | None:
        # Compiling anew mends whatever is wrong with a file.
        with suppress(Exception):
            loaded = CompileResult._rebuild(target_context, *pickle.loads(path.read_bytes()))
            _mark_used(path.parent)
            return loaded
        return None

    def save_overload(self, sig: object, data: CompileResult) -> None:
        path = self._path(sig, data.codegen)
        if path is None:
            return
        # Without a place, each run compiles what it needs.
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            with NamedTemporaryFile(dir=path.parent, delete=False) as stream:
                stream.write(dumps(data._reduce()))
            Path(stream.name).replace(path)


@cache
def _mark_used(folder: Path) -> None:
    """Renew the date of a folder that is to be kept, at most once a day."""
    if time.time() - folder.stat().st_mtime > _DAY:
        os.utime(folder)


def remove_unused() -> int:
    """Remove the kernels of other versions that no run has used for 30 days; returns how many folders."""
    base = cache_folder()
    removed = 0
    if base is None or not base.is_dir():
        return removed
    for folder in base.iterdir():
        with suppress(OSError):
            if _FOLDER.fullmatch(folder.name) and time.time() - folder.stat().st_mtime > _DAYS_KEPT * _DAY:
                # first out of the way of processes that would look for it
                shutil.rmtree(folder.rename(Path(mkdtemp(dir=base)) / folder.name).parent)
                removed += 1
    return removed


@dataclass
class Compiling(numba.core.event.Listener):  # type: ignore[misc]
    """What its thread compiled: the number of kernels and the seconds that it took. `begun` is called before
    the first, or before the first that another process is waited for.
    """

    begun: Callable[[], None]
    kernels: int = 0
    seconds: float = 0.0
    _thread: int = field(default_factory=get_ident)
    _has_begun: bool = False
    _depth: int = 0
    _started: float = 0.0

    def on_start(self, event: numba.core.event.Event) -> None:
        """Kernels are compiled within the kernels that call them; the outermost one's time counts."""
        if get_ident() != self._thread:
            return
        if not self._has_begun:
            self._has_begun = True
            self.begun()
        if event.kind == _WAIT:
            return
        if self._depth == 0:
            self._started = time.perf_counter()
        self._depth += 1
        self.kernels += not event.data["dispatcher"].py_func.__module__.startswith("numba.")

    def on_end(self, event: numba.core.event.Event) -> None:
        """The end of what began last."""
        if event.kind == _WAIT or get_ident() != self._thread:
            return
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._started


@contextmanager
def watch_compiling(begun: Callable[[], None]) -> Iterator[Compiling]:
    """Watch what the block compiles; `begun` is called before the first kernel."""
    compiling = Compiling(begun)
    listen = numba.core.event.install_listener
    with listen("numba:compile", compiling), listen(_WAIT, compiling):
        yield compiling


def _template_of_wide(template_of: Callable[..., Any], args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
    """Type a call of one kernel by another as if every signed integer had 64 bits.

    Otherwise an index that is an element of an int32 array, a loop's counter and a number in the source each
    make their caller compile a variant of its own.
    """
    integer, int64 = numba.types.Integer, numba.types.int64
    wide = (int64 if isinstance(arg, integer) and arg.signed else arg for arg in args)  # type: ignore[attr-defined]
    return template_of(tuple(wide), kws)


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile `function` at its first call; cached where it can be, IEEE, no check for zero divisors.

    It runs without the interpreter's lock, so that threads can share work. With `NUMBA_DISABLE_JIT` it stays
    plain Python, whose results are the same (see docs/testing.md).
    """
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    compiled = numba.njit(  # type: ignore[call-overload]
        fastmath=False, error_model="numpy", nogil=True, no_cfunc_wrapper=True
    )(function)
    compiled.get_call_template = partial(_template_of_wide, compiled.get_call_template)
    package, _, module = function.__module__.partition(".")
    if package == __name__.partition(".")[0]:
        compiled._cache = _KernelCache(function, module)
        compiled.compile = partial(_compile_in_turn, compiled.compile)
    return compiled  # type: ignore[no-any-return]


def formula(function: Callable[..., Any]) -> Callable[..., Any]:
    """A piece of arithmetic that becomes part of each kernel that calls it, so that loops over it can be
    vectorised.
    """
    return numba.njit(inline="always", fastmath=False, error_model="numpy")(function)  # type: ignore[no-any-return]
