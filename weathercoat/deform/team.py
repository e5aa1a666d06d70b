"""A few threads that share work again and again; kernels let them, since they run without the lock."""

from __future__ import annotations

import os
from collections.abc import Callable
from queue import SimpleQueue
from threading import Thread

Work = Callable[[int], None]


def usable_cores() -> int:
    """The cores that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Team:
    """`size` threads, the caller's included; the others are started when they are first needed."""

    def __init__(self, size: int = 1) -> None:
        self.size = size
        self._orders: list[SimpleQueue[Work]] = []
        self._done: SimpleQueue[BaseException | None] = SimpleQueue()

    def share(self, work: Work) -> None:
        """Call work(0) to work(size - 1) at the same time, and return when all are done.

        Raises what one of them raised.
        """
        self._start()
        for order in self._orders:
            order.put(work)
        try:
            work(0)
        finally:
            problems = [self._done.get() for _ in self._orders]
        for problem in problems:
            if problem is not None:
                raise problem

    def _start(self) -> None:
        for number in range(1 + len(self._orders), self.size):
            order: SimpleQueue[Work] = SimpleQueue()
            self._orders.append(order)
            Thread(target=self._follow, args=(number, order), daemon=True).start()

    def _follow(self, number: int, order: SimpleQueue[Work]) -> None:
        while True:
            work = order.get()
            try:
                work(number)
            except BaseException as problem:  # raised again where the work was shared
                self._done.put(problem)
            else:
                self._done.put(None)
