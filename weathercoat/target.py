"""The processors that results are for: the one at hand, or any of x86-64-v3.

NumPy, BLAS, Embree, the C library and the compiler of the kernels choose their code by the processor that
they find. Functions such as `exp` then differ in their last bit, and a sort of indices orders equals
otherwise. `pin` sets a choice that is open on every processor of the level x86-64-v3 of the x86-64 psABI
(AVX2 and FMA: Intel's since 2013, AMD's since 2015): that level for the kernels and BLAS, and for NumPy what
it falls back to, which costs nothing here. The C library has no mathematical function for anything beyond
the level. Embree, which cannot be told, gives way to `output.tree`.

Only the standard library is imported, since libraries choose when they are loaded.
"""

from __future__ import annotations

import os
import platform
import sys

from weathercoat.errors import UsageError

PORTABLE = "x86-64-v3"

# What `pin` sets, for workers that another program starts. NumPy passes over names that its version does not
# know: before 2.4 there was no X86_V3.
ENVIRONMENT = {
    "NUMBA_CPU_NAME": PORTABLE,
    "NUMBA_CPU_FEATURES": "",
    "NUMBA_DISABLE_INTEL_SVML": "1",
    "NPY_DISABLE_CPU_FEATURES": "X86_V3,X86_V4,AVX,F16C,FMA3,FMA4,XOP,AVX2,AVX512F,AVX512CD,AVX512_KNL,"
    "AVX512_KNM,AVX512_SKX,AVX512_CLX,AVX512_CNL,AVX512_ICL,AVX512_SPR",
    "OPENBLAS_CORETYPE": "Haswell",
}
_CHOOSE_WHEN_LOADED = ("numpy", "numba")
_FEATURES = ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")


def target() -> str | None:
    """The level that this process and those that it starts are pinned to; None for the processor at hand."""
    return PORTABLE if all(os.environ.get(name) == value for name, value in ENVIRONMENT.items()) else None


def pin() -> None:
    """Pin this process and those that it starts to x86-64-v3.

    Raises UsageError where the processor has not all of it, and where libraries are loaded that have chosen
    already.
    """
    machine = platform.machine()
    if machine not in ("x86_64", "AMD64"):
        raise UsageError(f"portable results are those of {PORTABLE}, and this machine is {machine}")
    lacking = [name for name in _FEATURES if not _processor_has(name)]
    if lacking:
        raise UsageError(
            f"portable results are those of {PORTABLE}, and this processor lacks {', '.join(lacking)}"
        )
    if target() is not None:
        return
    loaded = [name for name in _CHOOSE_WHEN_LOADED if name in sys.modules]
    if loaded:
        raise UsageError(
            f"{' and '.join(loaded)} chose for this processor when imported",
            remedy="call weathercoat.target.pin() before",
        )
    os.environ.update(ENVIRONMENT)


def _processor_has(feature: str) -> bool:
    from llvmlite.binding import get_host_cpu_features

    return bool(get_host_cpu_features().get(feature, False))
