"""What is half-written at this moment, so that a process which has to end at once can clear it away.

Whoever writes clears up by itself where an exception passes; this is for the end without one, while the main
thread computes (see `weathercoat.cli.watchdog`).
"""

from __future__ import annotations

from collections.abc import Callable

Clear = Callable[[list[str]], str | None]
"""Clears away, from any thread; gets what was told so far, and returns what else to tell the user."""

_open: list[Clear] = []


def begin(clear: Clear) -> None:
    """From now on `clear` is what clears something away."""
    _open.append(clear)


def end(clear: Clear) -> None:
    """What `clear` is for is whole, or was cleared away."""
    _open.remove(clear)


def clear_all() -> list[str]:
    """Clear away whatever is half-written, the latest first; returns what to tell the user."""
    told: list[str] = []
    for clear in reversed(_open.copy()):
        try:
            text = clear(told)
        except OSError:
            continue
        if text:
            told.append(text)
    return told
