"""The severity of a snapshot in the report: whole against parts, grades against areas, areas against PLY."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.verification.fields import take
from weathercoat.verification.film import Film
from weathercoat.verification.findings import BrokenFileError, Ledger
from weathercoat.verification.metal import Metal
from weathercoat.verification.ply import PlySnapshot
from weathercoat.verification.precision import REPORTED, SINGLE

_REPORT = "run.json"
_SEEN = 0.1  # rust, runoff and dirt from which they count, as docs/severity.md promises
_SUMMED = ("flaked", "rusted", "runoff", "lifted", "dirt", "cracked")
# Percent of the area: nominal values of the ISO scales from class 1, the most of ASTM's grades from 10.
_RUST = (0.05, 0.5, 1.0, 8.0, 40.0)
_FLAKING = (0.1, 0.3, 1.0, 3.0, 15.0)
_D610 = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 16.0, 33.0, 50.0)


def check_severity(ledger: Ledger, row: dict[str, Any]) -> None:
    """Whether the severity of a row agrees with itself: percent, grades, and parts that make the whole.

    Raises BrokenFileError where a figure is missing.
    """
    step = take(row, "step", int)
    whole = take(row, "severity.whole", dict)
    _check_grades(ledger, step, "the whole", whole)
    for division in ("groups", "parts"):
        named = take(row, f"severity.{division}", dict)
        for name, figures in named.items():
            if not isinstance(figures, dict):
                raise BrokenFileError(f"severity.{division} of step {step} holds no figures of {name[:40]!r}")
            _check_grades(ledger, step, name, figures)
        if named:
            _check_sum(ledger, step, division, whole, list(named.values()))


def check_condition(
    ledger: Ledger, file: str, row: dict[str, Any], snapshot: PlySnapshot, film: Film, metal: Metal
) -> None:
    """Hold the percent of the whole against the snapshot, whose amounts are rounded to 32 bits."""
    count = len(metal.vertices)
    rust, dust = snapshot.rust.astype(np.float64), snapshot.dust.astype(np.float64)
    gone = ~film.is_left
    loose = film.separated.reshape(-1, 3).sum(axis=1) >= 2
    runoff = np.zeros(len(metal.faces))
    runoff[film.over] = rust[count:][film.faces].mean(axis=1)
    metal_rust = rust[:count][metal.faces].mean(axis=1)
    metal_dust = dust[:count][metal.faces].mean(axis=1)
    yes = np.ones(len(gone), np.bool_)
    for name, where, amount in (
        ("flaked", gone, None),
        ("lifted", film.is_left & loose, None),
        ("rusted", gone, metal_rust),
        ("runoff", film.is_left, runoff),
        ("dirt", film.is_left, metal_dust),
    ):
        least, most = (
            (yes, yes) if amount is None else (amount >= _SEEN * (1 + s) for s in (4 * SINGLE, -4 * SINGLE))
        )
        low, high = (_percent(where & seen, metal) for seen in (least, most))
        told = take(row, f"severity.whole.{name}_percent", float)
        slack = 200.0 * metal.area_error / metal.area + REPORTED * told
        ledger.expect(
            "severity",
            _REPORT,
            low - slack <= told <= high + slack,
            f"{name}_percent of step {snapshot.step} is {told:.12g}, but {file} gives {low:.12g}",
        )


def _percent(chosen: NDArray[np.bool_], metal: Metal) -> float:
    return 100.0 * float(metal.areas[chosen].sum()) / metal.area


def _check_grades(ledger: Ledger, step: int, name: str, figures: dict[str, Any]) -> None:
    """Whether percent are within their range and give the grades."""
    for key in _SUMMED:
        value = take(figures, f"{key}_percent", float)
        ledger.expect(
            "severity",
            _REPORT,
            value >= 0.0 and (value <= 100.0 * (1 + REPORTED) or key == "cracked"),
            f"{key}_percent of {name} at step {step} is {value:.12g}",
        )
    flaked, rusted = (take(figures, f"{key}_percent", float) for key in ("flaked", "rusted"))
    for key, told, possible in (
        ("iso_4628_3", take(figures, "grades.iso_4628_3", str), _grades(rusted, _iso_edges(_RUST), "Ri{}")),
        ("iso_4628_5", take(figures, "grades.iso_4628_5", int), _grades(flaked, _iso_edges(_FLAKING))),
        ("astm_d610", take(figures, "grades.astm_d610", int), _grades(rusted, _D610)),
    ):
        if key == "astm_d610":
            possible = {str(10 - int(grade)) for grade in possible}
        ledger.expect(
            "severity",
            _REPORT,
            str(told) in possible,
            f"{key} of {name} at step {step} is {told}, but its area gives {' or '.join(sorted(possible))}",
        )


def _iso_edges(nominal: tuple[float, ...]) -> list[float]:
    """Half-way between nominal values in the logarithm, and as far below the first."""
    logs = [math.log(value) for value in nominal]
    middle = [0.5 * (logs[i] + logs[i + 1]) for i in range(len(logs) - 1)]
    return [math.exp(edge) for edge in (2 * logs[0] - middle[0], *middle)]


def _grades(percent: float, edges: list[float] | tuple[float, ...], form: str = "{}") -> set[str]:
    """The grades that a percent which is rounded can have; two at an edge."""
    slack = 4 * REPORTED
    return {form.format(sum(percent * f > edge for edge in edges)) for f in (1 - slack, 1.0, 1 + slack)}


def _check_sum(
    ledger: Ledger, step: int, division: str, whole: dict[str, Any], parts: list[dict[str, Any]]
) -> None:
    """Whether parts make the whole, in area and in what is counted of it."""
    area = take(whole, "area", float)
    sums = {"area": (sum(take(part, "area", float) for part in parts), area)}
    for key in _SUMMED:
        own = sum(take(part, "area", float) * take(part, f"{key}_percent", float) for part in parts)
        sums[f"{key}_percent"] = (own / area if area > 0.0 else 0.0, take(whole, f"{key}_percent", float))
    for key, (own, told) in sums.items():
        ledger.expect(
            "severity",
            _REPORT,
            abs(own - told) <= len(parts) * 4 * REPORTED * max(told, area if key == "area" else 100.0),
            f"{key} of the {division} at step {step} make {own:.12g}, but that of the whole is {told:.12g}",
        )
