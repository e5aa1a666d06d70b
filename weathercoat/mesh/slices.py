"""Long work in short pieces, between which the interpreter gets its turn, so that Ctrl-C is answered."""

from __future__ import annotations

from collections.abc import Iterator

AT_ONCE = 20_000
"""Elements that the slowest kernels of remeshing, some 5 microseconds for each, take at once."""


def in_slices(count: int, at_once: int = AT_ONCE) -> Iterator[slice]:
    """Slices of at most `at_once` that cover range(count), in order; one that is empty for none."""
    for first in range(0, max(count, 1), at_once):
        yield slice(first, min(first + at_once, count))
