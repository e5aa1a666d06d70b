"""Ctrl-C and SIGTERM as exceptions, so that whatever is half-written is cleaned up on the way out."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

SECONDS_UNTIL_AGAIN = 0.02


class Stopped(BaseException):
    """A signal that ends the process. No KeyboardInterrupt: one that has passed through `exec` makes Python
    end by the signal itself, whatever exit code was asked for.
    """

    word: str
    exit_code: int


class Interrupted(Stopped):
    """SIGINT."""

    word, exit_code = "interrupted", 130


class Terminated(Stopped):
    """SIGTERM."""

    word, exit_code = "terminated", 143


_RAISED = {signal.SIGINT: Interrupted, signal.SIGTERM: Terminated}
_NUMBERS = {kind: number for number, kind in _RAISED.items()}


def raise_signals() -> None:
    """Make SIGINT and SIGTERM raise in the main thread; one that is ignored, as under `nohup`, stays so."""
    for number in _RAISED:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _raise)
    sys.unraisablehook = _deliver_again


def _raise(number: int, frame: FrameType | None) -> None:
    raise _RAISED[signal.Signals(number)]


def _deliver_again(ignored: UnraisableHookArgs) -> None:
    """Send a signal again whose exception was lost because it was raised where none can leave, such as in a
    callback from the compiler of the kernels; other exceptions are shown as usual.
    """
    number = _NUMBERS.get(ignored.exc_type)  # type: ignore[arg-type]
    if number is None:
        sys.__unraisablehook__(ignored)
        return
    again = threading.Timer(SECONDS_UNTIL_AGAIN, _thread.interrupt_main, [number])
    again.daemon = True
    again.start()
