"""One process that judges inputs under limits of time and memory, and is replaced where an input kills it."""

from __future__ import annotations

import multiprocessing
import resource
import signal
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count as count_up
from multiprocessing.connection import Connection
from pathlib import Path
from types import TracebackType
from typing import Any, Literal


@dataclass(frozen=True)
class Verdict:
    """What became of an input: refused or accepted as documented, or a violation of what is promised.

    what: the code of the refusal, the kind of what was accepted, or what is wrong.
    """

    kind: Literal["refused", "accepted", "violation"]
    what: str


Judge = Callable[[Any], Verdict]


class Worker:
    """A process that calls `judge` on each input that it is given; any exception there is a violation.

    judge: importable by name. first: an input that loads all that is needed, before memory is limited to
    what is then in use and `megabytes` more. seconds: after these the process is killed, and the input hangs.
    """

    def __init__(self, judge: Judge, first: object, *, seconds: float = 60.0, megabytes: int = 500) -> None:
        self._judge, self._first = judge, first
        self._seconds, self._megabytes = seconds, megabytes
        self._start()

    def __enter__(self) -> Worker:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def judge(self, what: object) -> Verdict:
        """The verdict on one input."""
        self._pipe.send(what)
        try:
            if self._pipe.poll(self._seconds):
                verdict: Verdict = self._pipe.recv()
                return verdict
            verdict = Verdict("violation", f"no answer within {self._seconds:g} s")
        except EOFError:
            self._process.join()
            code = self._process.exitcode or 0
            ended = signal.Signals(-code).name if code < 0 else f"exit code {code}"
            verdict = Verdict("violation", f"the process ended with {ended}")
        self._end()
        self._start()
        return verdict

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(
            target=_serve, args=(other, self._judge, self._first, self._megabytes), daemon=True
        )
        self._process.start()
        other.close()
        self._pipe.recv()

    def _end(self) -> None:
        self._process.kill()
        self._process.join()
        self._pipe.close()


def case_numbers(count: int | None, seconds: float | None) -> Iterator[int]:
    """The numbers of `count` cases, or of as many as begin within `seconds`; either may be None."""
    end = None if seconds is None else time.monotonic() + seconds
    for number in count_up() if count is None else range(count):
        if end is not None and time.monotonic() > end:
            return
        yield number


def _serve(pipe: Connection, judge: Judge, first: object, megabytes: int) -> None:
    judge(first)
    limit = _address_space() + (megabytes << 20)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    pipe.send(None)
    while True:
        try:
            what = pipe.recv()
        except EOFError:
            return
        try:
            verdict = judge(what)
        except BaseException as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            said = " ".join(f"{type(error).__name__}: {error}".split())[:200]
            verdict = Verdict("violation", f"{said} ({Path(where.filename).name}:{where.lineno})")
        pipe.send(verdict)


def _address_space() -> int:
    """Bytes of address space that this process uses."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return pages * resource.getpagesize()
