"""Whole runs by random valid configs, each value at a bound, at its default or between, on small meshes.

`python -m tests.fuzz runs --count 500 --seed 1` makes 500 runs of 200 steps. After each step positions are
finite and the half-edge structure is valid; at the end nothing is lost of the area, no film is below the
metal, and the folder is written, passes its own check and reads back. What breaks the promise is printed as
a command with its config; `--seed` and `--only` with its number repeat it.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, get_args
from unittest.mock import patch

import numpy as np

from tests import zoo
from tests.fuzz.config_mutations import Random, valid_value
from tests.fuzz.workers import Verdict, Worker, case_numbers
from tests.sim.test_invariants import roughened
from weathercoat.config.load import LoadedConfig, Override, load_config
from weathercoat.config.presets import preset_names
from weathercoat.config.schema import Deformation, parameters
from weathercoat.errors import CheckError, LimitError
from weathercoat.mesh import shapes
from weathercoat.mesh.halfedge import check_half_edges
from weathercoat.mesh.surface import Surface
from weathercoat.output.folder import read_run
from weathercoat.output.meshes import write_mesh
from weathercoat.run import run_asset
from weathercoat.sim.simulation import Simulation

_STEPS = 200
_SECONDS = 60.0  # of the processor, for one run
# What these ask for is work, and the most that they allow is hours of it: a share of the range will do.
_WORK: dict[str, tuple[int, ...]] = {
    "remesh.faces": (4, 100, 400, 800),
    "deformation.sweeps": (0, 1, 10, 50),
    "deformation.iterations": (1, 5, 50),
    "snapshots.count": (1, 2, 5),
    "output.picture_width": (16, 40),
    "output.picture_height": (16, 30),
}
SOLVERS = list(get_args(Deformation.model_fields["solver"].annotation))
# Not part of a run's physics, or in need of a second value that goes with the first.
_LEFT = {
    "version",
    "preset",
    "quality",
    "snapshots.steps",
    "paint.only",
    "paint.except",
    "model.up",
    "ageing.steps",
}


def _bent(random: Random) -> Surface:
    return shapes.make_curved_plate(columns=12, rows=9, angle=float(random.uniform(5, 350)))


MESHES: dict[str, Callable[[Random], Surface]] = {
    "sheet": lambda random: shapes.make_random_sheet(
        int(random.integers(100, 800)), seed=int(random.integers(99))
    ),
    "rough sheet": lambda random: roughened(shapes.make_random_sheet(300), int(random.integers(99))),
    "sphere": lambda random: shapes.make_sphere(subdivisions=2),
    "bracket": lambda random: shapes.make_bracket(bend=0.2, thickness=0.12, hole=0.05, edge_length=0.14),
    "box": lambda random: shapes.make_box(cells=4),
    "curved plate": _bent,
    "torus": lambda random: shapes.make_torus(segments=16, sides=8),
    "annulus": lambda random: zoo.make_annulus(50),
    "two pieces": lambda random: zoo.make_two_pieces(),
    "roof": lambda random: zoo.make_roof(float(random.uniform(-3, 3)), rows=30),
    "strip": lambda random: zoo.make_ladder(60, length=float(10.0 ** random.uniform(-3, 3))),
    "octahedron": lambda random: zoo.make_octahedron(),
    "triangle": lambda random: zoo.make_triangle(),
}


class Case(NamedTuple):
    """A run: a mesh by its name, how it is scaled and moved, a shipped config, and what is set over it."""

    mesh: str
    seed: int
    scale: float
    offset: float
    config: str
    values: dict[str, Any]


def make_case(seed: int, number: int) -> Case:
    """The run of this number; the same for the same `seed`."""
    random = np.random.default_rng([seed, number])

    def one(choices: list[Any]) -> Any:
        return choices[int(random.integers(len(choices)))]

    config = one(preset_names())
    often = float(one([0.05, 0.2, 0.5, 1.0]))  # of the values, how many are not those of the shipped config
    values: dict[str, Any] = {}
    for parameter in parameters():
        key = parameter.key
        if key in _LEFT or key.startswith(("scene.", "physical.", "maps.")) or random.random() > often:
            continue
        values[key] = valid_value(parameter, random)
    values |= {key: one(list(choices)) for key, choices in _WORK.items()}
    values["ageing.steps"] = _STEPS
    values["deformation.solver"] = one(SOLVERS)
    if random.random() < 0.5:
        values["adhesion.base"] = float(random.uniform(0.1, 1.0))  # so that more films separate in part
    if random.random() < 0.6:
        values = {key: value for key, value in values.items() if not key.startswith("remesh.")}
        values["remesh"] = False
    law = values.get("tension.law", load_config(config).config.tension.law)
    if law == "saturating" and values.get("tension.initial", 0) > 1:
        values["tension.initial"] = 1
    return Case(
        mesh=one(sorted(MESHES)),
        seed=int(random.integers(1000)),
        scale=float(one([1.0, 1.0, 1e-9, 1e-3, 1e3, 1e9])),
        offset=float(one([0.0, 0.0, 1.0, 1e5])),
        config=config,
        values=values,
    )


def load(config: str, values: dict[str, Any]) -> LoadedConfig:
    """A shipped config with values set over it."""
    return load_config(config, [Override(key, value) for key, value in values.items()])


def make_model(case: Case) -> Surface:
    """The mesh of a case, some of its sizes away from the origin."""
    surface = MESHES[case.mesh](np.random.default_rng(case.seed))
    vertices = (surface.vertices / surface.size() + case.offset) * case.scale
    return replace(surface, vertices=vertices)


def judge(case: Case) -> Verdict:
    """Run a case, and check each of its steps and what it leaves."""
    flaws: list[str] = []
    step = Simulation.step

    def checked_step(simulation: Simulation, count: int = 1) -> None:
        step(simulation, count)
        if not flaws:
            flaws.extend(filter(None, [_flaw_of_step(simulation)]))
            if simulation.step_count == simulation.steps:
                flaws.extend(filter(None, [_flaw_of_end(simulation)]))

    start = time.process_time()
    with tempfile.TemporaryDirectory() as folder, patch.object(Simulation, "step", checked_step):
        model, out = Path(folder, "model.obj"), Path(folder, "out")
        write_mesh(model, make_model(case))
        loaded = load(case.config, case.values)
        try:
            report = run_asset(loaded, model, out)
        except LimitError as error:
            return Verdict("refused", error.code)
        except CheckError as error:
            return Verdict("violation", f"own check failed: {error.line()[:300]}")
        if not flaws:
            flaws.extend(filter(None, [_flaw_of_folder(out, report, loaded)]))
    spent = time.process_time() - start
    if spent > _SECONDS:
        flaws.append(f"took {spent:.0f} s")
    if flaws:
        return Verdict("violation", flaws[0])
    lost = report["snapshots"][-1]["lost_share"]
    return Verdict("accepted", "all fell" if lost > 0.99 else "some fell" if lost > 0 else "none fell")


def _flaw_of_step(simulation: Simulation) -> str | None:
    mesh, film, rust = simulation.mesh, simulation.film, simulation.rust
    used = slice(0, mesh.vertex_count)
    values = {
        "positions": mesh.positions[used],
        "tension": film.tension,
        "tension_cap": film.tension_cap,
        "cohesion": film.cohesion,
        "adhesion": film.adhesion,
        "crack_direction": film.crack_direction[used],
        "rust": rust.film[used],
    }
    for name, array in values.items():
        if not np.isfinite(array).all():
            return f"step {simulation.step_count}: {name} not finite"
    problem = check_half_edges(mesh)
    return f"step {simulation.step_count}: {problem}" if problem else None


def _flaw_of_end(simulation: Simulation) -> str | None:
    """Areas add up to roundings of a few hundred sums; the metal is met to 1e-9 of the size."""
    mesh = simulation.mesh
    corner = mesh.rest_positions[mesh.faces]
    areas = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    if abs(areas[mesh.alive].sum() + sum(simulation.flake_areas) - areas.sum()) > 1e-9 * areas.sum():
        return "area of film and flakes is not that at the start"
    used = np.unique(mesh.tail[np.repeat(mesh.alive, 3)])
    origin = mesh.origin[used]
    offset = mesh.positions[used] - mesh.rest_positions[origin]
    height = np.einsum("ij,ij->i", offset, mesh.rest_normals[origin]).min(initial=0.0)
    return f"film is {-height:.1e} below the metal" if height < -1e-9 else None


def _flaw_of_folder(out: Path, report: dict[str, Any], loaded: LoadedConfig) -> str | None:
    """All that was asked for is there, holds finite numbers, and reads back."""
    due = loaded.config.snapshots.due(loaded.config.ageing.steps)
    if [row["step"] for row in report["snapshots"]] != list(due):
        return "the report lacks a snapshot"
    for format in loaded.config.output.formats:
        if len(list((out / "snapshots").glob(f"*.{format}"))) != len(due):
            return f"a snapshot in {format} is missing"
    text = (out / "run.json").read_text("utf-8")
    if not all(math.isfinite(number) for number in _numbers(json.loads(text))):
        return "a figure of the report is not finite"
    if (out / "preview.png").exists() != loaded.config.output.preview:
        return "a picture is missing, or too many"
    if "ply" in loaded.config.output.formats:
        _, snapshots = read_run(out)
        if not all(np.isfinite(snapshot.film_vertices).all() for snapshot in snapshots):
            return "a snapshot is not finite"
    return None


def _numbers(value: Any) -> list[float]:
    """Every number of a tree."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        return [number for inner in value for number in _numbers(inner)]
    return [value] if isinstance(value, int | float) else []


def run(
    count: int | None, seed: int, *, seconds: float | None = None
) -> tuple[Counter[str], list[tuple[int, Case, Verdict]]]:
    """Make `count` runs, or as many as `seconds` allow: how often each outcome, and the violations."""
    outcomes: Counter[str] = Counter()
    violations = []
    first = Case("octahedron", 0, 1.0, 0.0, "standard", {"ageing.steps": 2, "remesh": False})
    with Worker(judge, first, seconds=10 * _SECONDS, megabytes=2000) as worker:
        for number in case_numbers(count, seconds):
            case = make_case(seed, number)
            verdict = worker.judge(case)
            solver = load(case.config, case.values).config.deformation.solver
            shown = f"{verdict.kind} {verdict.what}" if verdict.kind != "violation" else "violation"
            outcomes[f"{solver}: {shown}"] += 1
            if verdict.kind == "violation":
                violations.append((number, case, verdict))
    return outcomes, violations


def main(arguments: list[str]) -> int:
    """The command; returns the number of violations."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz runs", description=__doc__)
    parser.add_argument("--count", type=int, help="runs; without it, as many as --seconds allow")
    parser.add_argument("--seconds", type=float, help="stop after so long")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int, help="make only the run of this number")
    options = parser.parse_args(arguments)
    if options.only is not None:
        case = make_case(options.seed, options.only)
        print(f"{case}\n{judge(case)}")
        return 0
    if options.count is None and options.seconds is None:
        parser.error("give --count or --seconds")
    start = time.monotonic()
    outcomes, violations = run(options.count, options.seed, seconds=options.seconds)
    for number, case, verdict in violations:
        print(f"--seed {options.seed} --only {number}: {verdict.what}: {case}")
    print(f"{outcomes.total()} runs of {_STEPS} steps in {time.monotonic() - start:.0f} s")
    for outcome, times in sorted(outcomes.items()):
        print(f"{times:8d} {outcome}")
    return len(violations)
