"""Whether cracks, flakes and curls belong to the paint: the same paint on coarser and finer meshes.

Each number of faces and each rule is run with several seeds. The random numbers of the film lie at places, so
a seed means the same adhesion everywhere, but its defects are other edges of another mesh: means over seeds
are compared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from weathercoat.bench.growth import fit_exponent
from weathercoat.bench.machine import describe_machine
from weathercoat.config.load import load_config
from weathercoat.config.schema import Config
from weathercoat.errors import UsageError
from weathercoat.mesh.dihedral import all_bends
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.mesh.surface import Surface
from weathercoat.run import prepare_simulation
from weathercoat.sim.simulation import Simulation

FACES = (3_000, 10_000, 30_000, 100_000, 300_000)
RULES = ("standard", "literal")  # shipped configs
MOST_LITERAL_FACES = 30_000  # beyond, all that has separated shatters into too many pieces to wait for
SHEAR_LAG = 0.05  # sizes: 5.7 edges of 30,000 faces
SHEAR_LAGS = (0.05, 0.1, 0.2)
SHEAR_LAG_FACES = 30_000
FIGURES = ("spacing", "flake_area", "curl_radius", "separated_share", "lost_share", "flakes")
FEWEST_FACES = 100


def bench_independence(
    faces: Sequence[int] = FACES,
    *,
    seeds: int = 5,
    steps: int = 300,
    solver: str = "sweeps",
    shear_lag: float = SHEAR_LAG,
    shear_lags: Sequence[float] = SHEAR_LAGS,
    progress: Callable[[int, int], None] = lambda done, total: None,
    say: Callable[[str], None] = lambda line: None,
) -> dict[str, Any]:
    """The results on generated square sheets of so many faces, as plain values.

    solver: `deformation.solver` of the default rules; the literal ones have their own. shear_lag: of the runs
    that compare meshes. shear_lags: of those that compare crack spacing with it, on a sheet of 30,000 faces
    or the largest that is asked for. progress: called with the runs done and their number. Raises UsageError
    for too few faces, seeds or steps.
    """
    if not faces or min(faces) < FEWEST_FACES:
        raise UsageError(f"--faces: sheets have at least {FEWEST_FACES} faces")
    if seeds < 1 or steps < 1:
        raise UsageError("--seeds and --steps: at least 1")
    of_shear_lags = min(SHEAR_LAG_FACES, max(faces))
    runs: list[dict[str, Any]] = []
    sizes = sorted({*faces, of_shear_lags})
    kinds = partial(
        _kinds, faces=faces, shear_lag=shear_lag, of_shear_lags=of_shear_lags, shear_lags=shear_lags
    )
    total = seeds * sum(len(list(kinds(n))) for n in sizes)
    for count in sizes:
        say(f"{count:,} faces")
        surface = make_random_sheet(count)
        for kind, rules, lag in kinds(count):
            for seed in range(1, seeds + 1):
                config = independence_config(rules, lag, seed, steps, solver)
                figures = measure_run(surface, config)
                runs.append(
                    {"kind": kind, "rules": rules, "faces": count, "shear_lag": lag, "seed": seed} | figures
                )
                progress(len(runs), total)
    means = average_runs(runs)
    return {
        "schema": 1,
        "machine": describe_machine(),
        "steps": steps,
        "seeds": seeds,
        "solver": solver,
        "runs": runs,
        "means": means,
        "slope": _slope(means),
    }


def _kinds(
    count: int, *, faces: Sequence[int], shear_lag: float, of_shear_lags: int, shear_lags: Sequence[float]
) -> Iterator[tuple[str, str, float]]:
    """What is run on a sheet: (kind of run, rules, shear lag)."""
    if count in faces:
        for rules in RULES if count <= MOST_LITERAL_FACES else RULES[:1]:
            yield "faces", rules, shear_lag
    if count == of_shear_lags:
        for other in shear_lags:
            yield "shear_lag", "standard", other


def independence_config(rules: str, shear_lag: float, seed: int, steps: int, solver: str) -> Config:
    """A shipped config with the shear lag, and as many defects in the square of it at every shear lag."""
    changes = [f"seed={seed}", f"ageing.steps={steps}"]
    if rules == "standard":
        changes += [
            f"fracture.shear_lag={shear_lag!r}",
            f"defects.density={shear_lag**-2!r}",
            f"deformation.solver={solver}",
        ]
    return load_config(rules, changes).config


def measure_run(surface: Surface, config: Config) -> dict[str, float]:
    """The figures of one run at its end, lengths in sizes.

    spacing: twice the rest area over the rest length of all edges that broke; flake_area: median rest area of
    the flakes, 0 where none fell; curl_radius: see `fit_curl_radius`.
    """
    simulation = prepare_simulation(surface, config)
    mesh = simulation.mesh
    corner = mesh.rest_positions[mesh.faces]
    length = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2).reshape(-1)
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    cracks = 0.0
    for _ in range(simulation.steps):
        simulation.step()
        cracks += float(length[simulation.log.break_entries()[:, 0]].sum())
    flakes = simulation.flake_areas
    return {
        "spacing": 2.0 * float(area.sum()) / cracks if cracks > 0.0 else 0.0,
        "flake_area": float(np.median(flakes)) if flakes else 0.0,
        "curl_radius": fit_curl_radius(simulation),
        "separated_share": float(simulation.film.separated[: len(simulation.film.adhesion)].mean()),
        "lost_share": 1.0 - float(area[mesh.alive].sum() / area.sum()),
        "flakes": len(flakes),
    }


def fit_curl_radius(simulation: Simulation) -> float:
    """The span between face centres over the bend across it, both RMS over the hinges of film that hangs
    free; 0 where there is none.

    A hinge is free when its four corners have separated: near attached film the metal decides.
    """
    mesh, separated = simulation.mesh, simulation.film.separated
    half_edges = np.flatnonzero(mesh.twin > np.arange(len(mesh.twin)))
    twins = mesh.twin[half_edges]
    apexes = [mesh.tail[3 * (h // 3) + (h + 2) % 3] for h in (half_edges, twins)]
    ends = mesh.tail[half_edges], mesh.tail[twins]
    free = np.logical_and.reduce([separated[v] for v in (*ends, *apexes)]) & mesh.alive[half_edges // 3]
    hinges = half_edges[free]
    bends = np.empty(len(mesh.twin))
    all_bends(mesh.positions, mesh.tail, mesh.twin, bends)
    if not len(hinges):
        return 0.0
    bend = float(np.sqrt(np.mean(bends[hinges] ** 2)))
    return float(np.sqrt(np.mean(simulation.constraints.span[hinges] ** 2))) / bend if bend > 0.0 else 0.0


def average_runs(runs: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Mean and standard deviation over the seeds, of runs that differ in nothing else, in their order."""
    groups: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for run in runs:
        groups.setdefault((run["kind"], run["rules"], run["faces"], run["shear_lag"]), []).append(run)
    means = []
    for (kind, rules, faces, shear_lag), alike in groups.items():
        row: dict[str, Any] = {"kind": kind, "rules": rules, "faces": faces, "shear_lag": shear_lag}
        for name in FIGURES:
            values = [run[name] for run in alike]
            row[name] = float(np.mean(values))
            row[f"{name}_deviation"] = float(np.std(values))
        means.append(row)
    return means


def _slope(means: Sequence[dict[str, Any]]) -> float | None:
    """The log-log slope of crack spacing against the shear lag; None with fewer than two of them."""
    rows = [row for row in means if row["kind"] == "shear_lag"]
    return fit_exponent([row["shear_lag"] for row in rows], [row["spacing"] for row in rows])
