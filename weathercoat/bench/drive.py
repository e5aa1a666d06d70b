"""Driving a simulation through its run, and timing it: whole, or by samples from each tenth of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from weathercoat.bench.cases import STAGES
from weathercoat.sim.simulation import Simulation

TENTHS = 10
_STRIDE = 12  # steps that are taken at once on the way to a sample


@dataclass(frozen=True)
class Tenth:
    """A tenth of a run: how many of its steps were timed, and what these took.

    seconds: wall time by stage, without the mesh; wall, cpu: of all stages and the loop; mesh_seconds: wall
    time of one snapshot at its end, 0 where none was taken.
    """

    timed: int
    seconds: dict[str, float]
    wall: float
    cpu: float
    mesh_seconds: float
    broken_edges: int


def drive(
    simulation: Simulation,
    sample: int,
    snapshots: int,
    progress: Callable[[int], None] = lambda steps: None,
) -> list[Tenth]:
    """Run a simulation to its end and time it, in tenths.

    sample: steps to time in the middle of each tenth, 0 for all. The steps before and after a sample are
    taken `_STRIDE` at once, so that the load rises as in a run that is timed whole; the one right before it
    is not timed, since it has more to bring up to date. snapshots: how many are taken, at the ends of as many
    tenths. progress: called with the number of steps that are behind.
    """
    tenths = []
    for number in range(TENTHS):
        begin, end = (simulation.steps * (number + i) // TENTHS for i in (0, 1))
        before, timed, after = _split(end - begin, sample)
        broken = _skip(simulation, before, progress)
        seconds_before = dict(simulation.seconds)
        cpu, wall = time.process_time(), time.perf_counter()
        for _ in range(timed):
            simulation.step()
            broken += int(simulation.log.counts[1])
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        seconds = {name: value - seconds_before[name] for name, value in simulation.seconds.items()}
        progress(simulation.step_count)
        broken += _skip(simulation, after, progress)
        has_snapshot = (number + 1) * snapshots // TENTHS > number * snapshots // TENTHS
        tenths.append(
            Tenth(
                timed=timed,
                seconds=seconds,
                wall=wall,
                cpu=cpu,
                mesh_seconds=_time_snapshot(simulation) if has_snapshot else 0.0,
                broken_edges=broken,
            )
        )
    return tenths


def sum_stages(tenths: list[Tenth], steps: int) -> dict[str, float]:
    """Seconds of a run as if it had had so many steps: wall time by stage, `total`, and `cpu`.

    What was timed of a tenth stands for all of it; the snapshots are as many as they were.
    """
    scale = [steps / len(tenths) / tenth.timed for tenth in tenths]
    found = {
        name: sum(tenth.seconds[name] * s for tenth, s in zip(tenths, scale, strict=True))
        for name in tenths[0].seconds
    }
    wall = sum(tenth.wall * s for tenth, s in zip(tenths, scale, strict=True))
    found["other"] = max(wall - sum(found.values()), 0.0)
    found["mesh"] = sum(tenth.mesh_seconds for tenth in tenths)
    total = sum(found[name] for name in STAGES)
    cpu = sum(tenth.cpu * s for tenth, s in zip(tenths, scale, strict=True))
    return {**{name: found[name] for name in STAGES}, "total": total, "cpu": cpu}


def _split(steps: int, sample: int) -> tuple[int, int, int]:
    """The steps of a tenth before, in and after the sample."""
    if sample == 0 or sample + 1 >= steps:
        return 0, steps, 0
    before = (steps - sample + 1) // 2
    return before, sample, steps - sample - before


def _skip(simulation: Simulation, steps: int, progress: Callable[[int], None]) -> int:
    """Take steps several at once, but the last one by itself; returns how many edges broke."""
    broken = 0
    while steps > 0:
        count = min(_STRIDE, steps - 1) if steps > 1 else 1
        simulation.step(count)
        broken += int(simulation.log.counts[1])
        steps -= count
        progress(simulation.step_count)
    return broken


def _time_snapshot(simulation: Simulation) -> float:
    started = time.perf_counter()
    simulation.snapshot()
    return time.perf_counter() - started
