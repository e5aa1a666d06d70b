"""Running a simulation to its end, and what is recorded on the way: when is apart from what."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

from weathercoat.sim.simulation import Simulation


@dataclass(frozen=True)
class Recorder:
    """Calls `record` after each of the `steps`; 0 is the start."""

    steps: Collection[int]
    record: Callable[[Simulation], None]


def run_simulation(
    simulation: Simulation,
    recorders: Sequence[Recorder],
    progress: Callable[[int, int], None] | None = None,
    *,
    until: int | None = None,
) -> None:
    """Step to the end, or to the step `until`; `progress` is called with the steps done and their number."""
    last = simulation.steps if until is None else min(until, simulation.steps)
    _record(simulation, recorders)
    while simulation.step_count < last:
        simulation.step()
        _record(simulation, recorders)
        if progress is not None:
            progress(simulation.step_count, last)


def _record(simulation: Simulation, recorders: Sequence[Recorder]) -> None:
    for recorder in recorders:
        if simulation.step_count in recorder.steps:
            recorder.record(simulation)
