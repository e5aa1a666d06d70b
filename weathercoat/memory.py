"""How much memory this process may use: what is free, or less where its container or its shell says so.

Only the standard library is imported, so that a limit which is too tight for NumPy, LLVM and Embree, whose
libraries end the process where they get no memory, is refused before they are loaded.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from weathercoat.errors import LimitError, UsageError

_UNITS = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "t": 10**12,
          "ki": 2**10, "mi": 2**20, "gi": 2**30, "ti": 2**40}  # fmt: skip
_SIZE = re.compile(r"(\d+(?:\.\d+)?)\s*([kmgt]i?|)b?", re.IGNORECASE)

# Limits of the shell are met by failing allocations, which some libraries answer with the end of the process.
# So a share of them is kept free, and what the libraries reserve beyond what they use is counted: measured
# on Linux with tests/measure_memory.py, 2026-11-22.
_SHARE_OF_RIGID_LIMITS = 0.8
_RESERVED_BY_LIBRARIES = 300e6
_RESERVED_BY_THREAD = 80e6  # a stack and an arena of the allocator, of each core: Embree starts so many
_LEAST_ADDRESS_SPACE = 700e6


class MemoryLimit(NamedTuple):
    """Bytes that a run may take at its peak, and what says so."""

    bytes: float
    origin: str


def parse_size(text: str) -> int:
    """Bytes from `4G`, `500MB` or `1.5GiB`: K, M, G and T are powers of 1000, with an i of 1024.

    Raises UsageError for anything else.
    """
    match = _SIZE.fullmatch(text.strip())
    size = int(float(match[1]) * _UNITS[match[2].lower()]) if match else 0
    if size <= 0:
        raise UsageError(f"{text!r} is no size of memory", remedy="give a number with a unit, such as 4G")
    return size


def memory_limit(wanted: int | None) -> MemoryLimit | None:
    """The limit that is wanted, in bytes, instead of that of this process; but those of the shell hold."""
    if wanted is None:
        return usable_memory()
    return min([MemoryLimit(wanted, "what --max-memory allows"), *_rigid_limits()])


def usable_memory() -> MemoryLimit | None:
    """The least of the limits that this process knows of; None where the system tells none."""
    return min([*_soft_limits(), *_rigid_limits()], default=None)


def require_address_space() -> None:
    """Raise LimitError where a limit of this process is too tight even for its libraries."""
    for name, limit in _limits_of_shell():
        if limit < _LEAST_ADDRESS_SPACE:
            raise LimitError(
                f"{name} is limited to {limit / 1e6:,.0f} MB",
                remedy=f"allow {_LEAST_ADDRESS_SPACE / 1e6:,.0f} MB at least, with `ulimit`",
            )


def _soft_limits() -> Iterator[MemoryLimit]:
    own = _status("VmRSS")
    free = _meminfo("MemAvailable")
    if free is not None:
        yield MemoryLimit(free + own, "the memory that is free (unless --max-memory says otherwise)")
    elif hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
        yield MemoryLimit(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"), "the machine's memory")
    for limit in _control_groups():
        yield MemoryLimit(limit, "the limit of the control group (unless --max-memory says otherwise)")


def _rigid_limits() -> Iterator[MemoryLimit]:
    reserved = _RESERVED_BY_LIBRARIES + _RESERVED_BY_THREAD * (os.cpu_count() or 1)
    for name, limit in _limits_of_shell():
        yield MemoryLimit(max(_SHARE_OF_RIGID_LIMITS * (limit - reserved), 0.0), f"the limit of {name}")


def _limits_of_shell() -> Iterator[tuple[str, int]]:
    try:
        import resource
    except ImportError:  # Windows
        return
    kinds = {"RLIMIT_AS": "the address space (ulimit -v)", "RLIMIT_DATA": "the data segment (ulimit -d)"}
    for kind, name in kinds.items():
        limit = resource.getrlimit(getattr(resource, kind))[0]
        if limit != resource.RLIM_INFINITY:
            yield name, limit


def _control_groups() -> Iterator[int]:
    """The limits of the process's control groups and those above them; versions 2 and 1."""
    try:
        rows = [row.split(":", 2) for row in Path("/proc/self/cgroup").read_text().splitlines()]
    except OSError:
        return
    for _, controllers, path in rows:
        if controllers == "":
            root, name = Path("/sys/fs/cgroup"), "memory.max"
        elif "memory" in controllers.split(","):
            root, name = Path("/sys/fs/cgroup/memory"), "memory.limit_in_bytes"
        else:
            continue
        group = root / path.lstrip("/")
        for folder in (group, *group.parents):
            limit = _number_in(folder / name)
            if limit is not None:
                yield limit
            if folder == root:
                break


def _number_in(file: Path) -> int | None:
    """The number that a file holds; None where it is missing or says `max`."""
    try:
        return int(file.read_text())
    except (OSError, ValueError):
        return None


def _status(key: str) -> int:
    return _field("/proc/self/status", key) or 0


def _meminfo(key: str) -> int | None:
    return _field("/proc/meminfo", key)


def _field(file: str, key: str) -> int | None:
    """Bytes of a line `key: N kB`."""
    try:
        match = re.search(rf"^{key}:\s+(\d+) kB", Path(file).read_text(), re.MULTILINE)
    except OSError:
        return None
    return int(match[1]) * 1024 if match else None
