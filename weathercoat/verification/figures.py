"""The figures of a snapshot in the report, computed again from its PLY."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.verification.fields import is_number, take
from weathercoat.verification.film import Film
from weathercoat.verification.findings import BrokenFileError, Ledger
from weathercoat.verification.metal import Metal
from weathercoat.verification.ply import PlySnapshot
from weathercoat.verification.precision import DOUBLE, REPORTED, ROUNDINGS, SINGLE
from weathercoat.verification.severity import check_condition, check_severity

_REPORT = "run.json"
_MOST_FLAKES = 20  # whose areas are listed


def check_row(ledger: Ledger, row: dict[str, Any]) -> bool:
    """Whether the figures of a row are plausible by themselves: shares, and the list of flakes.

    Returns true; raises BrokenFileError where one is missing.
    """
    step = take(row, "step", int)
    for key in ("separated_share", "lost_share", "affected_share", "film_rust", "substrate_rust", "dust"):
        value = take(row, key, float)
        ledger.expect(
            "shares",
            _REPORT,
            0.0 <= value <= 1.0 + REPORTED,
            f"{key} of step {step} is {value:.12g}, which is not within 0 and 1",
        )
    for key in ("strain", "residual", "imbalance", "lost_area", "crack_length", "outline_length"):
        value = take(row, key, float)
        ledger.expect(
            "figures-positive", _REPORT, value >= 0.0, f"{key} of step {step} is {value:.12g}, below 0"
        )
    take(row, "energy", float)
    _check_flakes(ledger, step, take(row, "flakes", dict))
    check_severity(ledger, row)
    return True


def check_figures(
    ledger: Ledger, file: str, row: dict[str, Any], snapshot: PlySnapshot, film: Film, metal: Metal
) -> None:
    """Hold a row of the report against the snapshot."""
    for key, own, tolerance in _own_figures(snapshot, film, metal):
        told = take(row, key, float)
        ledger.expect(
            "figures",
            _REPORT,
            abs(own - told) <= tolerance + REPORTED * abs(told),
            f"{key} of step {snapshot.step} is {told:.12g}, but {file} gives {own:.12g}",
        )
    check_condition(ledger, file, row, snapshot, film, metal)
    left = float(metal.areas[film.over].sum())
    lost = take(row, "lost_area", float)
    ledger.expect(
        "area-kept",
        _REPORT,
        abs(left + lost - metal.area) <= metal.area_error + REPORTED * lost,
        f"at step {snapshot.step}, film of {left:.12g} and {lost:.12g} lost are not {metal.area:.12g} in all",
    )


def _own_figures(snapshot: PlySnapshot, film: Film, metal: Metal) -> Iterator[tuple[str, float, float]]:
    """Key, value and tolerance of each figure that follows from a snapshot alone."""
    count = len(metal.vertices)
    areas, total = metal.areas, metal.area
    relative = metal.area_error / total
    over = areas[film.over]
    lost = float(areas[~film.is_left].sum())
    separated = film.separated.reshape(-1, 3).sum(axis=1)
    loose = float((separated * areas).sum()) / 3.0
    yield "lost_area", lost, metal.area_error
    yield "flakes.area", lost, metal.area_error
    yield "lost_share", lost / total, 2 * relative
    yield "separated_share", loose / total, 2 * relative
    yield "affected_share", (loose + lost) / total, 2 * relative
    apart, outline = metal.lengths[film.is_apart], metal.lengths[film.is_outline]
    yield "crack_length", 0.5 * float(apart.sum()), _sum_error(apart, metal)
    yield "outline_length", float(outline.sum()), _sum_error(outline, metal)

    rust = snapshot.rust.astype(np.float64)
    relative_left = metal.area_error_of(film.over) / max(float(over.sum()), np.finfo(float).tiny)
    for key, values, faces, weights, error in (
        ("film_rust", rust[count:], film.faces, over, relative_left),
        ("substrate_rust", rust[:count], metal.faces, areas, relative),
        ("dust", snapshot.dust[:count].astype(np.float64), metal.faces, areas, relative),
    ):
        mean = _mean(values, faces, weights)
        yield key, mean, SINGLE * mean + 2 * error


def _sum_error(lengths: NDArray[np.float64], metal: Metal) -> float:
    return metal.length_error * len(lengths) + ROUNDINGS * DOUBLE * float(lengths.sum())


def _mean(
    values: NDArray[np.float64], faces: NDArray[np.int64] | NDArray[np.int32], weights: NDArray[np.float64]
) -> float:
    """Mean over triangles of what is linear between their corners; 0 where there are none."""
    total = float(weights.sum())
    return float((values[faces].sum(axis=1) * weights).sum()) / (3.0 * total) if total > 0.0 else 0.0


def _check_flakes(ledger: Ledger, step: int, flakes: dict[str, Any]) -> None:
    """Whether count, sum, median and list of the flakes can be those of one set of areas."""
    count, total = take(flakes, "count", int), take(flakes, "area", float)
    median, largest = take(flakes, "median_area", float), take(flakes, "largest_area", float)
    listed = take(flakes, "largest_areas", list)
    if not all(map(is_number, listed)):
        raise BrokenFileError(f"flakes.largest_areas of step {step} are not numbers")
    slack = 1.0 + 2 * REPORTED
    holds = (
        len(listed) == min(count, _MOST_FLAKES)
        and all(a >= b >= 0.0 for a, b in pairwise(listed))
        and largest == (listed[0] if listed else 0.0)
        and 0.0 <= median <= largest
        and sum(listed) <= total * slack
        and total <= count * largest * slack
        and (count > _MOST_FLAKES or sum(listed) * slack >= total)
    )
    ledger.expect("flakes", _REPORT, holds, f"the flakes of step {step} contradict each other")
