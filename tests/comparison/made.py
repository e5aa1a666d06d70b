"""Runs that are made up: figures by a law of chance that the test knows."""

from __future__ import annotations

import numpy as np

from weathercoat.comparison.statistics import FIGURES, RunFigures

AGES = (0.5, 1.0)


def make_run(
    seed: int, *, ages: tuple[float, ...] = AGES, noise: float = 0.05, **shifts: float
) -> RunFigures:
    """Figures of 0.5 at the age 1 that vary by `noise`, in part together; dust does not, as in real runs.

    shifts: what is added to figures, by name.
    """
    random = np.random.Generator(np.random.Philox(seed))
    common = random.normal()
    figures = {}
    for name in FIGURES:
        deviation = 0.6 * common + 0.8 * random.normal()
        value = 0.5 + (0.0 if name == "dust" else noise * deviation) + shifts.get(name, 0.0)
        figures[name] = tuple(float(value * age) for age in ages)
    return RunFigures(f"run-{seed}", ages, figures)


def make_group(first: int, count: int, **shifts: float) -> list[RunFigures]:
    """Runs with the seeds from `first` on."""
    return [make_run(seed, **shifts) for seed in range(first, first + count)]
