"""Kernels without the JIT, in which an index that is negative or beyond the end raises.

NumPy refuses an index beyond the end, but takes a negative one from the end and cuts a slice short, and so
does compiled code, where -1 stands for "none" in many arrays. So the arguments of kernels are given as
`CheckedArray`s here. What a kernel allocates itself is checked once it has been passed on to another.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

import numba
import numpy as np

COMPILED = not numba.config.DISABLE_JIT


class CheckedArray(np.ndarray):
    """An array that takes no index from the end, and no slice that reaches beyond it."""

    def __getitem__(self, index: Any) -> Any:
        refuse_outside(self.shape, index)
        return super().__getitem__(index)

    def __setitem__(self, index: Any, value: Any) -> None:
        refuse_outside(self.shape, index)
        super().__setitem__(index, value)


_SCALARS = (int, np.int32, np.int64)


def refuse_outside(shape: tuple[int, ...], index: Any) -> None:
    """Raise IndexError unless all that an index names is there; NumPy itself refuses what is too large."""
    for axis, part in enumerate(index if type(index) is tuple else (index,)):
        if type(part) in _SCALARS:
            outside = part < 0
        elif type(part) is slice:
            bounds = [bound for bound in (part.start, part.stop) if bound is not None]
            outside = any(not 0 <= bound <= shape[axis] for bound in bounds)
        elif isinstance(part, np.ndarray):
            outside = part.dtype != np.bool_ and bool((np.asarray(part) < 0).any())
        else:
            outside = False  # an ellipsis or a new axis
        if outside:
            raise IndexError(f"index {index} of an array of shape {shape}")


def checked(value: Any) -> Any:
    """An argument with its arrays checked, also those in a tuple."""
    if type(value) is np.ndarray:
        return value.view(CheckedArray)
    if isinstance(value, tuple):
        parts = [checked(part) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return value


def unchecked(value: Any) -> Any:
    """A result as it would be without checks."""
    if isinstance(value, CheckedArray):
        return value.view(np.ndarray)
    if isinstance(value, tuple):
        parts = [unchecked(part) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return value


def checked_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """In the place of `weathercoat.compile.kernel`: plain Python with checked arguments."""

    @wraps(function)
    def call(*arguments: Any) -> Any:
        return unchecked(function(*(checked(argument) for argument in arguments)))

    return call
