"""How far runs of different seeds are apart, and how well `weathercoat compare` tells noise from change.

With one set of seeds, figures of several parts and configs give the spread that is shipped for comparisons
of single runs. With another, which nothing was fitted to, runs of one config are judged against each other,
and against runs with another crack direction threshold.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.bench.machine import describe_machine
from weathercoat.comparison.judgement import judge
from weathercoat.comparison.noise import LAWS, unit_spread
from weathercoat.comparison.statistics import FIGURES, RunFigures, measure_run
from weathercoat.config.load import load_config
from weathercoat.errors import UsageError
from weathercoat.mesh.shapes import make_bracket, make_gear, make_plate, make_sphere
from weathercoat.mesh.surface import Surface
from weathercoat.output.meshes import write_mesh
from weathercoat.run import run_asset

PARTS: dict[str, Callable[[], Surface]] = {
    "plate": make_plate,
    "bracket": make_bracket,
    "gear": make_gear,
    "sphere": lambda: make_sphere(3),
}
CONFIGS = ("standard", "crackle", "curling", "rusting")
JUDGED_PARTS = ("plate", "bracket")
THRESHOLDS = (0.45, 0.80)  # the first is the default of `fracture.direction_threshold`
GROUPS = ((1, 1), (1, 5), (1, 10), (5, 5))  # numbers of runs on either side
FIRST_JUDGED_SEED = 1001
FEWEST_SEEDS, FEWEST_JUDGED = 3, 11
# Dust hangs on the shape and hardly on the seed, and so on shapes that were not measured.
_LEAST_COEFFICIENT = 0.01
# Of the cases that the spread was measured in, those whose spread is below what is shipped.
_COVERED = 0.9


def bench_noise(
    *,
    faces: int = 3000,
    steps: int = 300,
    seeds: int = 20,
    judged: int = 40,
    trials: int = 1000,
    progress: Callable[[int, int], None] = lambda done, total: None,
    say: Callable[[str], None] = lambda line: None,
) -> dict[str, Any]:
    """The results as plain values.

    seeds: runs of each part by each config, for the spread; judged: runs of each part with each threshold,
    for the rates; trials: judgements of groups that are drawn from them. progress: called with the runs done
    and their number. Raises UsageError for too few seeds.
    """
    if seeds < FEWEST_SEEDS or judged < FEWEST_JUDGED or trials < 1:
        raise UsageError(f"--seeds: at least {FEWEST_SEEDS}; --judged: at least {FEWEST_JUDGED}")
    total = len(PARTS) * len(CONFIGS) * seeds + len(JUDGED_PARTS) * len(THRESHOLDS) * judged
    done = 0

    def measure(part: str, config: str, changes: Sequence[str], first: int, count: int) -> list[RunFigures]:
        nonlocal done
        found = []
        for seed in range(first, first + count):
            small = (f"remesh.faces={faces}", f"ageing.steps={steps}", f"seed={seed}")
            found.append(_measure(PARTS[part](), config, [*small, *changes]))
            done += 1
            progress(done, total)
        return found

    spreads = []
    for part in PARTS:
        for config in CONFIGS:
            say(f"{part}, {config}")
            spreads.append(
                {"part": part, "config": config, **_spread_of(measure(part, config, (), 1, seeds))}
            )
    rates = []
    for part in JUDGED_PARTS:
        say(f"{part}, direction thresholds {THRESHOLDS[0]} and {THRESHOLDS[1]}")
        runs = [
            measure(part, "standard", [f"fracture.direction_threshold={value}"], FIRST_JUDGED_SEED, judged)
            for value in THRESHOLDS
        ]
        rates += [{"part": part, **row} for row in _rates(runs[0], runs[1], trials)]
    return {
        "schema": 1,
        "machine": describe_machine(),
        "faces": faces,
        "steps": steps,
        "seeds": seeds,
        "judged": judged,
        "trials": trials,
        "spreads": spreads,
        "figures": _coefficients(spreads),
        "rates": rates,
    }


def make_shipped(results: dict[str, Any]) -> dict[str, Any]:
    """What comparisons read: the content of `comparison/noise.json`."""
    return {key: results[key] for key in ("schema", "faces", "steps", "seeds", "figures")}


def _measure(surface: Surface, config: str, changes: Sequence[str]) -> RunFigures:
    lean = ("output.preview=false", "output.formats=[ply]", "checkpoint.keep=false")
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder, "part.obj")
        write_mesh(model, surface)
        run_asset(load_config(config, [*changes, *lean]), model, Path(folder, "run"), check=False)
        return measure_run(Path(folder, "run"))


def _spread_of(runs: Sequence[RunFigures]) -> dict[str, Any]:
    """For each figure its mean and standard deviation at each age, and both in units of its law: the
    coefficient at each age, and the spread of the mean over the ages in units of the shipped one's law.
    """
    length = np.array([_values(run, "crack_length") + _values(run, "outline_length") for run in runs])
    rows = {}
    for figure in FIGURES:
        values = np.array([_values(run, figure) for run in runs])
        unit = unit_spread(figure, values.mean(axis=0), length.mean(axis=0))
        spread = values.std(axis=0, ddof=1)
        scaled = np.divide(values, unit, out=np.zeros_like(values), where=unit > 0.0)
        rows[figure] = {
            "mean": values.mean(axis=0).tolist(),
            "spread": spread.tolist(),
            "coefficients": (spread[unit > 0.0] / unit[unit > 0.0]).tolist(),
            "coefficient_of_mean": float(scaled.mean(axis=1).std(ddof=1)),
        }
    return {"ages": list(runs[0].ages), "figures": rows}


def _values(run: RunFigures, figure: str) -> NDArray[np.float64]:
    return np.array(run.figures[figure])


def _coefficients(spreads: Sequence[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """The coefficients below which 9 in 10 cases lie, of figures at one age and of their means over the
    ages.
    """
    found = {}
    for figure in LAWS:
        rows = [case["figures"][figure] for case in spreads]
        at_an_age = [value for row in rows for value in row["coefficients"]]
        found[figure] = {
            "at_an_age": _covering(at_an_age),
            "of_the_mean": _covering([row["coefficient_of_mean"] for row in rows]),
        }
    return found


def _covering(values: Sequence[float]) -> float:
    return max(float(f"{np.quantile(values, _COVERED):.3g}") if values else 0.0, _LEAST_COEFFICIENT)


def _rates(
    usual: Sequence[RunFigures], changed: Sequence[RunFigures], trials: int
) -> Iterator[dict[str, Any]]:
    """How often groups are called different: such of one kind, and such of two."""
    random = np.random.Generator(np.random.Philox(1))
    for a, b in GROUPS:
        false, found = 0, 0
        for _ in range(trials):
            drawn = [usual[i] for i in random.permutation(len(usual))[: a + b]]
            false += judge(drawn[:a], drawn[a:]).verdict == "different"
            others = [changed[i] for i in random.permutation(len(changed))[:a]]
            found += judge(others, drawn[a:]).verdict == "different"
        yield {"a": a, "b": b, "false_alarms": false / trials, "power": found / trials}
