"""A comparison as JSON: all that it found, in the form of `schemas/compare.json`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from weathercoat.comparison.compare import Comparison, Group, Pair, Side
from weathercoat.comparison.judgement import Difference
from weathercoat.comparison.sides import Run
from weathercoat.comparison.statistics import RunFigures

COMPARISON_VERSION = 1


def make_record(comparison: Comparison) -> dict[str, Any]:
    """The comparison in plain values, all finite; what has no bound, or no value, is None."""
    tolerance = comparison.tolerance
    return {
        "comparison_version": COMPARISON_VERSION,
        "verdict": comparison.verdict,
        "method": comparison.method,
        "a": _side(comparison.a),
        "b": _side(comparison.b),
        "tolerance": {
            "level": tolerance.level,
            "omitted": list(tolerance.omitted),
            "rules": [vars(rule) for rule in tolerance.rules],
            "positions": _bounded(tolerance.positions),
            "distances": _bounded(tolerance.distances),
            "pictures": _bounded(tolerance.pictures),
        },
        "configs": {key: {"a": a, "b": b} for key, (a, b) in comparison.configs.items()},
        "beyond": list(comparison.beyond),
        "groups": [_group(group) for group in comparison.groups],
    }


def ranked(differences: Sequence[Difference]) -> list[Difference]:
    """The largest difference of each figure, the figures that differ most first: those beyond what is allowed
    before all others, and each kind by its share of that.
    """
    largest: dict[str, Difference] = {}
    for difference in differences:
        found = largest.get(difference.figure)
        if found is None or _rank(difference) > _rank(found):
            largest[difference.figure] = difference
    return sorted(largest.values(), key=_rank, reverse=True)


def share_of_allowed(difference: Difference) -> float:
    """The size of a difference, in what is allowed; 0 where there is none, infinite where none is allowed."""
    gap = abs(difference.difference)
    if gap == 0.0:
        return 0.0
    return gap / difference.allowed if difference.allowed > 0.0 else math.inf


def _rank(difference: Difference) -> tuple[bool, float]:
    return difference.is_beyond, share_of_allowed(difference)


def _side(side: Side) -> dict[str, Any]:
    return {
        "path": str(side.path),
        "runs": [_run(run) for run in side.runs],
        "findings": {
            name: [vars(finding) for finding in findings] for name, findings in side.findings.items()
        },
    }


def _run(run: Run) -> dict[str, Any]:
    return {"name": run.name, "seed": run.seed, "models": list(run.models), "versions": run.versions}


def _group(group: Group) -> dict[str, Any]:
    return {
        "title": group.title,
        "verdict": group.judgement.verdict,
        "method": group.judgement.method,
        "differences": [
            {
                **{key: _bounded(value) for key, value in vars(difference).items()},
                "sigmas": _bounded(difference.sigmas),
            }
            for difference in group.judgement.differences
        ],
        "figures": {"a": [_figures(run) for run in group.a], "b": [_figures(run) for run in group.b]},
        "pairs": [_pair(pair) for pair in group.pairs],
    }


def _figures(run: RunFigures) -> dict[str, Any]:
    figures = {name: list(values) for name, values in run.figures.items()}
    return {"name": run.name, "ages": list(run.ages), "figures": figures}


def _pair(pair: Pair) -> dict[str, Any]:
    return {
        "a": pair.a.name,
        "b": pair.b.name,
        "geometry": [{key: _bounded(value) for key, value in vars(found).items()} for found in pair.geometry],
        "pictures": [{"age": found.age, "flip": found.flip} for found in pair.pictures],
        "missing": list(pair.missing),
    }


def _bounded(value: Any) -> Any:
    """The value, and None for a number that JSON has no form for."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
