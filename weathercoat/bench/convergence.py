"""The benchmark of whole runs that follow the minimum: what each solver costs, and how far from it it
stays.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from weathercoat.bench.machine import describe_machine
from weathercoat.bench.reference import ReferenceCase, measure_errors, solve_case
from weathercoat.bench.reference_cases import make_reference_cases
from weathercoat.deform.deformation import deform
from weathercoat.deform.energy import energy, make_elastic
from weathercoat.deform.newton import minimise_by_newton
from weathercoat.deform.parameters import DeformParameters
from weathercoat.errors import UsageError
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.mesh.surface import Surface
from weathercoat.sim.simulation import Simulation, make_simulation

SOLVERS: dict[str, dict[str, Any]] = {
    "sweeps": {"deformation_solver": "sweeps"},
    "momentum": {"deformation_solver": "momentum"},
    "descent": {"deformation_solver": "descent"},
    "newton": {"deformation_solver": "newton"},
}
SHEETS = ("cylinder-180", "uniform-curl", "clamped-sheet", "rolled-clamp")
_GROWING = ("cylinder-180", "uniform-curl")  # targets that grow step by step; the others are there at once
_FOLLOWED, _BUDGET = 1e-5, 300  # the tolerance and the most iterations with which sheets are followed
_NO_ENERGY = 1e-9  # a least energy below this is that of a shape which meets every aim
_LOOKS = 10  # ages at which a run is held against its minimum
_CONVERGED, _ITERATIONS = 1e-12, 300  # what counts as the minimum


def bench_convergence(
    solvers: tuple[str, ...], *, faces: int, steps: int, progress: Callable[[int, int], None]
) -> dict[str, Any]:
    """Age a generated plate by the default config with each solver, fracture and all.

    At ten ages the run stops, and its energy is held against the minimum that Newton's method finds from
    there; that takes no part in the times. Then the solvers that converge follow sheets whose shape is known.
    """
    for name in solvers:
        if name not in SOLVERS:
            raise UsageError(f"no solver {name!r}", remedy=f"choose from {', '.join(SOLVERS)}")
    names = solvers or tuple(SOLVERS)
    following = [name for name in names if name in ("descent", "newton")]
    total = len(names) + len(SHEETS) * bool(following)
    surface = make_random_sheet(faces)
    _run(surface, 20, "newton")  # loads the kernels
    runs = []
    for number, name in enumerate(names):
        runs.append({"solver": name, **_run(surface, steps, name)})
        progress(number + 1, total)
    sheets = []
    for number, (sheet, make) in enumerate(make_reference_cases(SHEETS).items() if following else ()):
        case = solve_case(make())
        sheets += [_follow(case, name, case.growth_steps if sheet in _GROWING else 1) for name in following]
        progress(len(names) + number + 1, total)
    return {
        "machine": describe_machine(),
        "plate": {"faces": len(surface.faces), "steps": steps, "minimum": _CONVERGED},
        "runs": runs,
        "sheets": sheets,
    }


def _follow(case: ReferenceCase, solver: str, steps: int) -> dict[str, Any]:
    """A sheet from flat to its targets in so many steps: CPU seconds of all, and the errors at the end."""
    assert case.answer is not None
    values = {
        "deformation.solver": solver,
        "deformation.tolerance": _FOLLOWED,
        "deformation.iterations": _BUDGET,
    }
    parameters = case.parameters_with(values)
    mesh = case.mesh_at(case.start)
    iterations, seconds = 0, 0.0
    for step in range(1, steps + 1):
        case.aim(step / steps)
        started = time.process_time()
        iterations += deform(mesh, case.constraints, parameters, case.age).iterations
        seconds += time.process_time() - started
    errors = measure_errors(case, mesh.positions[: mesh.vertex_count])
    least = case.answer.energy
    return {
        "sheet": case.name,
        "about": case.about,
        "solver": solver,
        "steps": steps,
        "cpu_seconds": seconds,
        "iterations": iterations,
        "position": errors.position,
        "angle": errors.angle,
        "length": errors.length,
        "gap": errors.gap / least if least > _NO_ENERGY else errors.gap,
    }


def _run(surface: Surface, steps: int, solver: str) -> dict[str, Any]:
    """One run: CPU seconds of its steps, and what is found at each look."""
    simulation = make_simulation(surface, steps=steps, deform=DeformParameters(**SOLVERS[solver]))
    looks = []
    seconds = 0.0
    for look in range(1, _LOOKS + 1):
        started = time.process_time()
        while simulation.step_count < steps * look // _LOOKS:
            simulation.step()
        seconds += time.process_time() - started
        looks.append(_look(simulation))
    return {
        "cpu_seconds": seconds,
        "iterations": simulation.solving.iterations,
        "unfinished_steps": simulation.solving.unfinished_steps,
        "largest_gap": max(look["gap"] for look in looks),
        "largest_strain": max(look["strain"] for look in looks),
        "looks": looks,
    }


def _look(simulation: Simulation) -> dict[str, Any]:
    """Energy above the minimum over the minimum, the largest strain, and the shares of the film now.

    The gap is 0 where nothing is free.
    """
    mesh = simulation.mesh
    elastic = make_elastic(mesh, simulation.constraints, simulation.deform_parameters, simulation.age)
    here = mesh.positions[: mesh.vertex_count]
    there = here.copy()
    minimise_by_newton(
        elastic, there, lambda islands: here.copy(), iterations=_ITERATIONS, tolerance=_CONVERGED
    )
    now, least = float(energy(elastic, here).sum()), float(energy(elastic, there).sum())
    residual = simulation.residual()
    return {
        "age": simulation.age,
        "free_vertices": len(elastic.free),
        "islands": len(elastic.scale),
        "gap": (now - least) / least if least > 0.0 else 0.0,
        "energy": residual.energy,
        "imbalance": residual.imbalance,
        "strain": residual.strain_max,
        "alive": float(np.mean(mesh.alive)),
    }
