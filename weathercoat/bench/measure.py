"""Measuring one case in this process."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

from weathercoat.bench import roofline
from weathercoat.bench.cases import STAGES, Case
from weathercoat.bench.compare import save_end
from weathercoat.bench.drive import Tenth, drive, sum_stages
from weathercoat.bench.machine import forget_peak, peak_bytes, resident_bytes
from weathercoat.bench.peer import PeerSheet, peer_version
from weathercoat.bench.situation import (
    find_deviations,
    load_speed_config,
    make_speed_simulation,
    measure_load,
)
from weathercoat.deform.angle import FORMS
from weathercoat.deform.deformation import deform
from weathercoat.deform.plain import Active, bends_wanted, find_active, half_tangents, sweep_plainly
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.mesh.surface import Surface, Vectors
from weathercoat.sim.simulation import Simulation

SCALED_STEPS = 1000  # what times of runs are given for
_SWEEPS, _TRIALS = 20, 7
_END_STEPS = 10
_WARM_FACES, _WARM_STEPS = 500, 20


def warm_up() -> float:
    """Run all that is measured once on a small sheet, so that it is compiled; returns the seconds it took."""
    started = time.perf_counter()
    surface = make_random_sheet(_WARM_FACES)
    measure_case(Case("warm-up", _WARM_FACES, _WARM_STEPS), surface, repeats=1)
    return time.perf_counter() - started


def measure_case(
    case: Case,
    surface: Surface,
    *,
    repeats: int,
    progress: Callable[[int], None] = lambda steps: None,
    end: Path | None = None,
) -> dict[str, Any]:
    """The figures of a case as plain values: medians over `repeats` runs, all times for 1,000 steps.

    progress: called with the steps done of `repeats` runs. end: the .npz file that gets the film at the end,
    for `compare_ends`.
    """
    config = load_speed_config(case.steps, case.overrides)
    forget_peak()
    before = resident_bytes()
    runs: list[list[Tenth]] = []
    setups = []
    for number in range(repeats):
        started = time.perf_counter()
        simulation = make_speed_simulation(surface, config, case.threads)
        setups.append(time.perf_counter() - started)
        snapshots = len(config.snapshots.due(case.steps))
        runs.append(drive(simulation, case.sample, snapshots, _count_from(number * case.steps, progress)))
        if number < repeats - 1:
            del simulation  # before the next one takes its room
    peak = peak_bytes()
    if end is not None:
        save_end(simulation, end)
    load = measure_load(simulation, sum(tenth.broken_edges for tenth in runs[-1]))
    sums = [sum_stages(run, SCALED_STEPS) for run in runs]
    seconds = {name: median(times[name] for times in sums) for name in (*STAGES, "total", "cpu")}
    sweep = measure_sweep(simulation, with_peer=case.with_peer)
    return {
        "label": case.label,
        "faces": len(surface.faces),
        "vertices": len(surface.vertices),
        "steps": case.steps,
        "timed_steps": sum(tenth.timed for tenth in runs[-1]),
        "threads": case.threads,
        "overrides": list(case.overrides),
        "variant_of": case.variant_of,
        "repeats": repeats,
        "seconds": {name: seconds[name] for name in (*STAGES, "total")},
        "cpu_seconds": seconds["cpu"],
        "setup_seconds": median(setups),
        "step_ms": seconds["total"] / SCALED_STEPS * 1e3,
        "step_ms_at_end": _time_steps(simulation) * 1e3,
        "sweep_ms_in_run": seconds["deformation"] / SCALED_STEPS / max(config.deformation.sweeps, 1) * 1e3,
        "steps_per_second": [
            median(run[i].timed / max(run[i].wall, 1e-9) for run in runs) for i in range(len(runs[0]))
        ],
        "load": vars(load),
        "deviations": find_deviations(load, len(surface.faces)),
        "memory_bytes": None if peak is None or before is None else max(peak - before, 0),
        **sweep,
    }


def _count_from(done: int, progress: Callable[[int], None]) -> Callable[[int], None]:
    return lambda steps: progress(done + steps)


def measure_sweep(simulation: Simulation, *, with_peer: bool) -> dict[str, Any]:
    """One sweep over the constraints that are active now, ours, the plain one and the peer's, taken in turns.

    Ours is the time of many sweeps less that of none, so that the targets are left out.
    """
    active = find_active(simulation.mesh, simulation.constraints)
    peer = PeerSheet(simulation, active) if with_peer and peer_version() else None
    target = bends_wanted(
        simulation.constraints, active.hinge_edges, simulation.deform_parameters, simulation.age
    )
    half_tangents(target)
    ours, plain, others = [], [], []
    for _ in range(_TRIALS):
        ours.append((_time_deform(simulation, _SWEEPS) - _time_deform(simulation, 0)) / _SWEEPS)
        plain.append(_time_plain(simulation, active, target) / _SWEEPS)
        if peer is not None:
            others.append(peer.seconds_per_iteration(_SWEEPS))
    lengths, angles = len(active.ends), len(active.hinges)
    sweep = median(ours)
    work = roofline.sweep_work(lengths, angles, len(active.free))
    return {
        "sweep": {
            "ms": sweep * 1e3,
            "lengths": lengths,
            "angles": angles,
            "constraints_per_second": (lengths + angles) / sweep if sweep > 0 else None,
            "plain_ms": median(plain) * 1e3,
            "times_plain": median(plain) / sweep if sweep > 0 else None,
            **work,
        },
        "peer": {"ms": median(others) * 1e3, "times_ours": median(others) / sweep} if others else None,
    }


def _time_deform(simulation: Simulation, sweeps: int) -> float:
    """Seconds of one deformation with so many sweeps, from the present positions, which stay."""
    mesh = simulation.mesh._replace(positions=simulation.mesh.positions.copy())
    parameters = replace(simulation.deform_parameters, deformation_sweeps=sweeps)
    started = time.perf_counter()
    deform(mesh, simulation.constraints, parameters, simulation.age, team=simulation.team)
    return time.perf_counter() - started


def _time_plain(simulation: Simulation, active: Active, target: Vectors) -> float:
    """As `_time_deform`, of the plain sweeps alone."""
    mesh = simulation.mesh._replace(positions=simulation.mesh.positions.copy())
    mass, form = simulation.constraints.inverse_mass, FORMS[simulation.deform_parameters.deformation_angle]
    started = time.perf_counter()
    for _ in range(_SWEEPS):
        sweep_plainly(mesh, mass, active, form, target, 1.0)
    return time.perf_counter() - started


def _time_steps(simulation: Simulation) -> float:
    """The median time of a step beyond the end, where the load is largest."""
    seconds = []
    for _ in range(_END_STEPS):
        started = time.perf_counter()
        simulation.step()
        seconds.append(time.perf_counter() - started)
    return median(seconds)
