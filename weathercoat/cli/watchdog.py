"""The last resort after a signal: a thread that ends the process where the main thread is not heard of.

The exception of a signal is raised when the interpreter has its turn. Kernels run in slices, so that it has
it several times a second; but a sort or a factorisation for millions of faces is one call of a library. Such
calls let other threads run. The one that does not is Embree's making of a scene: half a second of work for a
million triangles, for which a signal waits.
"""

from __future__ import annotations

import os
import select
import signal
import threading
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING

from weathercoat.unfinished import clear_all

if TYPE_CHECKING:
    from weathercoat.cli.signals import Stopped

SECONDS_TO_BE_HEARD = 0.55
_SECONDS_BETWEEN_LOOKS = 0.02
_SECONDS_FOR_THE_LINE = 0.1  # that standard error may take, since a pipe that nobody reads blocks


class Watchdog:
    """Ends the process with the exit code of a signal, `SECONDS_TO_BE_HEARD` after one that nobody answered.

    What is half-written is cleared away first, and one line is said, as if an exception had passed. `kinds`
    are the signals and what they raise.
    """

    def __init__(self, kinds: Mapping[int, type[Stopped]]) -> None:
        self._kinds = kinds
        self._is_answered = False
        self._turn = threading.Lock()  # of whoever ends the process

    def start(self) -> None:
        """Watch from now on, where the system lets threads learn of signals."""
        if os.name != "posix" or threading.current_thread() is not threading.main_thread():
            return
        reading, writing = os.pipe()
        os.set_blocking(writing, False)
        signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
        threading.Thread(target=self._watch, args=(reading,), daemon=True, name="watchdog").start()

    def answer(self) -> None:
        """Say that a signal is answered; does not return where the process is ending already."""
        if self._turn.acquire(blocking=False):
            self._is_answered = True
        elif not self._is_answered:
            threading.Event().wait()

    def expect_again(self) -> None:
        """The answer was lost, and the signal comes again."""
        if self._is_answered:
            self._is_answered = False
            self._turn.release()

    def _watch(self, reading: int) -> None:
        while True:
            for number in os.read(reading, 1):
                if number in self._kinds and not self._is_heard() and self._turn.acquire(blocking=False):
                    self._end(self._kinds[number])

    def _is_heard(self) -> bool:
        until = time.monotonic() + SECONDS_TO_BE_HEARD
        while not self._is_answered and time.monotonic() < until:
            time.sleep(_SECONDS_BETWEEN_LOOKS)
        return self._is_answered

    def _end(self, kind: type[Stopped]) -> None:
        try:
            text = "; ".join([f"weathercoat: {kind.word}", *clear_all()])
            if select.select([], [2], [], _SECONDS_FOR_THE_LINE)[1]:
                os.write(2, f"{text}\n".encode(errors="backslashreplace"))
        finally:
            os._exit(kind.exit_code)
