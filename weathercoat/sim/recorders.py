"""Running a simulation to its end, and what is recorded on the way: when is apart from what."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn, Protocol

from weathercoat.sim.simulation import Simulation


@dataclass(frozen=True)
class Recorder:
    """Calls `record` after each of the `steps`; 0 is the start."""

    steps: Collection[int]
    record: Callable[[Simulation], None]


class Patience(Protocol):
    """Lets a wish to stop wait for the end of a step, while it is entered."""

    @property
    def is_asked(self) -> bool:
        """Whether the run is to stop."""

    def stop(self) -> NoReturn:
        """Raise what ends the run."""

    def __enter__(self) -> object: ...

    def __exit__(self, *error: Any) -> None: ...


def run_simulation(
    simulation: Simulation,
    recorders: Sequence[Recorder],
    progress: Callable[[int, int], None] | None = None,
    *,
    until: int | None = None,
    patience: Patience | None = None,
    before_stop: Callable[[Simulation], None] | None = None,
    is_enough: Callable[[Simulation], bool] | None = None,
) -> None:
    """Step to the end, to the step `until`, or to the first at which `is_enough`; `progress` is called with
    the steps done and their number.

    A simulation at its start is recorded before the first step; one that goes on was recorded there already.
    patience: where it is asked to stop, that is done after the step, and after calling `before_stop`.
    """
    last = simulation.steps if until is None else min(until, simulation.steps)
    if simulation.step_count == 0:
        _record(simulation, recorders)
    while simulation.step_count < last and not (is_enough and is_enough(simulation)):
        simulation.step()
        _record(simulation, recorders)
        if progress is not None:
            progress(simulation.step_count, last)
        if patience is not None and patience.is_asked:
            if before_stop is not None:
                before_stop(simulation)
            patience.stop()


def _record(simulation: Simulation, recorders: Sequence[Recorder]) -> None:
    for recorder in recorders:
        if simulation.step_count in recorder.steps:
            recorder.record(simulation)
