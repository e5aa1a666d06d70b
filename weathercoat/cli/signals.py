"""Ctrl-C and SIGTERM as exceptions, so that whatever is half-written is cleaned up on the way out."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
import time
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

from weathercoat.cli.watchdog import Watchdog

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

SECONDS_UNTIL_AGAIN = 0.02
SECONDS_TO_LEAVE = 2.0
SECONDS_OF_PATIENCE = 0.4  # and the watchdog has a little more


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


_RAISED: dict[int, type[Stopped]] = {signal.SIGINT: Interrupted, signal.SIGTERM: Terminated}
_NUMBERS = {kind: number for number, kind in _RAISED.items()}
_watchdog = Watchdog(_RAISED)
_leaves_until = 0.0  # by time.monotonic


def raise_signals() -> None:
    """Make SIGINT and SIGTERM raise in the main thread; one that is ignored, as under `nohup`, stays so.

    Where the main thread does not hear of them in time, the process ends all the same.
    """
    global _watchdog, _leaves_until
    _watchdog, _leaves_until = Watchdog(_RAISED), 0.0
    for number in _RAISED:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _raise)
    sys.unraisablehook = _deliver_again
    _watchdog.start()


class Patience:
    """While the block runs, a first signal waits for `stop`, but for no longer than `SECONDS_OF_PATIENCE`.

    Only where `raise_signals` has been called, and where the system has a timer; elsewhere signals raise at
    once, or do what they did before.
    """

    def __init__(self) -> None:
        self._asked: int | None = None

    @property
    def is_asked(self) -> bool:
        """Whether a signal waits."""
        return self._asked is not None

    def stop(self) -> NoReturn:
        """Raise the signal that waits."""
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        assert self._asked is not None
        _leave(self._asked)

    def __enter__(self) -> Patience:
        is_main = threading.current_thread() is threading.main_thread()
        self._patient = [number for number in _RAISED if signal.getsignal(number) is _raise]
        if not is_main or not hasattr(signal, "setitimer"):
            self._patient = []
        if self._patient:
            self._alarm = signal.signal(signal.SIGALRM, self._expire)
        for number in self._patient:
            signal.signal(number, self._note)
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        for number in self._patient:
            signal.signal(number, _raise)
        if self._patient:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, self._alarm)
        if self.is_asked:
            _watchdog.answer()
            if kind is None:
                self.stop()

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.is_asked:  # a second one waits no longer
            self.stop()
        self._asked = number
        signal.setitimer(signal.ITIMER_REAL, SECONDS_OF_PATIENCE)

    def _expire(self, number: int, frame: FrameType | None) -> None:
        self.stop()


def _raise(number: int, frame: FrameType | None) -> None:
    """Raise what stands for a signal, but not within what an earlier one has begun: clearing away."""
    if time.monotonic() >= _leaves_until:
        _leave(number)


def _leave(number: int) -> NoReturn:
    global _leaves_until
    _watchdog.answer()
    _leaves_until = time.monotonic() + SECONDS_TO_LEAVE
    raise _RAISED[number]


def _deliver_again(ignored: UnraisableHookArgs) -> None:
    """Send a signal again whose exception was lost because it was raised where none can leave, such as in a
    callback from the compiler of the kernels; other exceptions are shown as usual.
    """
    number = _NUMBERS.get(ignored.exc_type)  # type: ignore[arg-type]
    if number is None:
        sys.__unraisablehook__(ignored)
        return
    global _leaves_until
    _leaves_until = 0.0
    _watchdog.expect_again()
    again = threading.Timer(SECONDS_UNTIL_AGAIN, _thread.interrupt_main, [number])
    again.daemon = True
    again.start()
