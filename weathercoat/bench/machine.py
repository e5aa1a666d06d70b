"""The machine that figures were measured on: what it is, and how fast it copies and reckons."""

from __future__ import annotations

import contextlib
import datetime
import os
import platform
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from weathercoat.bench.peer import peer_version
from weathercoat.compile import kernel
from weathercoat.mesh.surface import Vectors
from weathercoat.output.report import versions

_COPIED = 16_000_000  # numbers: beyond any cache
_RECKONED = 2_000  # numbers: within the first cache
_TERMS = 16
_TRIALS = 7


def describe_machine() -> dict[str, Any]:
    """Processor, cores, operating system, versions and date, as plain values."""
    from importlib import metadata

    peer = peer_version()
    libraries = {**versions(), "llvmlite": metadata.version("llvmlite")}
    return {
        "cpu": _cpu_model(),
        "cores": os.cpu_count() or 1,
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "date": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "versions": libraries if peer is None else {**libraries, "pypbd": peer},
    }


def _cpu_model() -> str:
    """The processor's name as the system gives it."""
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def copy_bandwidth() -> float:
    """Bytes read and written in a second by a copy that no cache holds, on one core."""
    source, target = np.ones(_COPIED), np.zeros(_COPIED)
    seconds = []
    for _ in range(_TRIALS):
        started = time.perf_counter()
        np.copyto(target, source)
        seconds.append(time.perf_counter() - started)
    return 2.0 * source.nbytes / min(seconds)


def arithmetic_peak() -> float:
    """Multiplications and additions in a second that a vectorised kernel does on one core, without fusing
    them."""
    values = np.full(_RECKONED, 0.5)
    rounds = 2_000
    _reckon(values, 1)
    seconds = []
    for _ in range(_TRIALS):
        started = time.perf_counter()
        _reckon(values, rounds)
        seconds.append(time.perf_counter() - started)
    return 2.0 * _TERMS * _RECKONED * rounds / min(seconds)


@kernel
def _reckon(values: Vectors, rounds: int) -> None:
    for _ in range(rounds):
        for i in range(len(values)):
            x = values[i]
            for _term in range(16):  # _TERMS: a constant, so that it is unrolled
                x = x * 0.5 + 0.25
            values[i] = x


def resident_bytes() -> int | None:
    """Memory of this process now; None where the system does not tell."""
    return _status("VmRSS")


def forget_peak() -> None:
    """Let `peak_bytes` begin anew, where the system can (Linux)."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def peak_bytes() -> int | None:
    """The most memory that this process has had since `forget_peak`; None where the system does not tell."""
    found = _status("VmHWM")
    if found is None and sys.platform == "darwin":
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return found


def _status(key: str) -> int | None:
    """A figure of Linux about this process. The peak of `getrusage` may be that of the parent instead."""
    status = Path("/proc/self/status")
    if status.is_file():
        for line in status.read_text(encoding="ascii", errors="replace").splitlines():
            if line.startswith(key + ":"):
                return int(line.split()[1]) * 1024
    return None
