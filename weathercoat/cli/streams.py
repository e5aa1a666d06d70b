"""Standard streams that are always there."""

from __future__ import annotations

import os
import sys


def open_standard_streams() -> None:
    """Open the null device in place of standard streams that were closed before the start.

    Otherwise the next files that are opened would be taken for them.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "r" if number == 0 else "w", closefd=False))
