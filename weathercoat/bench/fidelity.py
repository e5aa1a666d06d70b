"""Seconds against the error of what a viewer sees: whole runs in many ways beside a fine one.

Every way runs with the same seeds as the reference. Adhesion is noise over positions, so that film lets go at
the same places at every resolution; what remains is the error of the way. How much two seeds differ at the
reference is the noise floor, below which an error is no more than another roll of the dice.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from statistics import fmean
from typing import Any

from weathercoat.bench.fidelity_errors import (
    curve_errors,
    film_distance,
    mean_curves,
    outline_difference,
    picture_difference,
)
from weathercoat.bench.fidelity_run import Observed, View, make_view, observe
from weathercoat.bench.fidelity_ways import REFERENCE, WAYS, Way
from weathercoat.bench.machine import describe_machine
from weathercoat.config.load import load_config
from weathercoat.config.quality import LEVELS
from weathercoat.config.schema import Config
from weathercoat.cost import estimate_cost
from weathercoat.errors import UsageError
from weathercoat.mesh.shapes import make_plate
from weathercoat.mesh.surface import Surface
from weathercoat.output.pictures import Image
from weathercoat.plan import MOST_IMAGE, MOST_PIXELS

AGES = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
PICTURE_AGES = (0.6, 1.0)
HEIGHTS = (480, 120, 30, 12)  # pixels
CONFIG = "standard"
LEAST_SEEDS = 2
_MOST_STATISTICS = 0.1  # relative error of areas and of the distance between cracks


@dataclass(frozen=True)
class _Seen:
    """A run and its pictures, by their height."""

    run: Observed
    pictures: dict[int, list[Image]]


def bench_fidelity(
    *,
    seeds: Sequence[int] = (1, 2),
    ways: Sequence[Way] = WAYS,
    reference: Way = REFERENCE,
    progress: Callable[[int, int], None] = lambda done, total: None,
    say: Callable[[str], None] = lambda line: None,
) -> dict[str, Any]:
    """The results as plain values: for every way its seconds and its errors against the reference.

    progress: called with the runs done and their number. say: called with what is worth knowing. Raises
    UsageError for fewer than two seeds.
    """
    if len(seeds) < LEAST_SEEDS:
        raise UsageError(f"--seeds: at least {LEAST_SEEDS}, or there is no noise to compare with")
    part = make_plate(width=1.0, height=0.75)
    config = load_config(CONFIG).config
    view = make_view(part, config)
    total = len(seeds) * (len(ways) + 1)
    done = 0

    def see(way: Way, seed: int) -> _Seen:
        nonlocal done
        run = observe(part, config_of(way, seed), AGES, PICTURE_AGES, way.threads)
        done += 1
        progress(done, total)
        return _Seen(run, {h: [view.draw(snapshot, h) for snapshot in run.snapshots] for h in HEIGHTS})

    say("compiling where that has not been done yet")
    warm_up(part, view, {(way.solver, way.threads) for way in (*ways, reference)})
    say(f"reference: {reference.label}")
    truth = {seed: see(reference, seed) for seed in seeds}
    noise = _noise(truth, view)
    rows = [_row(reference, list(truth.values()), truth, noise, view)]
    for way in ways:
        say(way.label)
        rows.append(_row(way, [see(way, seed) for seed in seeds], truth, noise, view))
    shear_lag = config.fracture.shear_lag
    results = {
        "schema": 1,
        "machine": describe_machine(),
        "config": CONFIG,
        "shear_lag": shear_lag,
        "seeds": list(seeds),
        "ages": list(AGES),
        "picture_ages": list(PICTURE_AGES),
        "pixels_per_shear_lag": {str(h): h * view.pixels_per_size * shear_lag for h in HEIGHTS},
        "noise": noise,
        "ways": rows,
    }
    mark_front(results)
    return results


def config_of(way: Way, seed: int, name: str = CONFIG) -> Config:
    """A shipped config as a way runs it."""
    values = {"seed": seed, "remesh.faces": way.faces, **way.values()}
    return load_config(name, [f"{key}={value}" for key, value in values.items()]).config


def warm_up(part: Surface, view: View, kinds: set[tuple[str, int]]) -> None:
    """Use every solver once, so that no compiling is timed."""
    for solver, threads in sorted(kinds):
        run = observe(part, config_of(Way(500, 20, solver, 5), 1), (1.0,), (1.0,), threads)
        outline_difference(view, run.snapshots[0], run.snapshots[0])
        film_distance(run.snapshots[0], run.snapshots[0])
        view.draw(run.snapshots[0], HEIGHTS[-1])


def _noise(truth: dict[int, _Seen], view: View) -> dict[str, Any]:
    """How far two seeds are apart at the reference: means over their pairs, and for figures over the ages the
    mean error of one seed against the mean of all.
    """
    pairs = list(itertools.combinations(truth.values(), 2))
    mean = mean_curves([seen.run.curves for seen in truth.values()])
    single = [curve_errors(seen.run.curves, mean) for seen in truth.values()]
    return {
        **{name: fmean(error[name] for error in single) for name in single[0]},
        **_mean_gaps(pairs, view),
        "picture": {
            str(h): fmean(picture_difference(a.pictures[h], b.pictures[h]) for a, b in pairs) for h in HEIGHTS
        },
    }


def _mean_gaps(pairs: Sequence[tuple[_Seen, _Seen]], view: View) -> dict[str, float]:
    """Means over pairs of runs and over the ages of pictures."""
    films = [films for a, b in pairs for films in zip(a.run.snapshots, b.run.snapshots, strict=True)]
    return {
        "distance": fmean(film_distance(*pair) for pair in films),
        "outline": fmean(outline_difference(view, *pair) for pair in films),
    }


def _row(
    way: Way, seen: Sequence[_Seen], truth: dict[int, _Seen], noise: dict[str, Any], view: View
) -> dict[str, Any]:
    """What a way costs and how wrong it is, over the seeds."""
    pairs = list(zip(seen, truth.values(), strict=True))
    curves = mean_curves([one.run.curves for one in seen])
    pictures = {
        str(h): fmean(picture_difference(a.pictures[h], b.pictures[h]) for a, b in pairs) for h in HEIGHTS
    }
    seconds = {name: fmean(one.run.seconds[name] for one in seen) for name in ("remesh", "steps")}
    return {
        "label": way.label,
        **asdict(way),
        "seconds": {**seconds, "total": sum(seconds.values())},
        "curves": curves,
        "errors": {
            **curve_errors(curves, mean_curves([one.run.curves for one in truth.values()])),
            **_mean_gaps(pairs, view),
            "picture": pictures,
            "image": {h: pictures[h] / noise["picture"][h] for h in pictures},
        },
    }


def heights_of(results: dict[str, Any]) -> list[str]:
    """The heights of pictures, from large to small, as they name the results."""
    return sorted(results["pixels_per_shear_lag"], key=int, reverse=True)


def measures(row: dict[str, Any]) -> dict[str, float]:
    """The errors by which ways are compared, of which less is better."""
    errors = row["errors"]
    image = {f"image {height}": value for height, value in errors["image"].items()}
    return {name: errors[name] for name in ("areas", "spacing", "rims", "distance", "outline")} | image


def mark_front(results: dict[str, Any]) -> None:
    """Mark the ways that no other one beats: for which no cheaper way is as good in every measure (`front`),
    and in each measure by itself (`best_in`); and name the levels of quality that each is (`levels`).
    """
    rows = [row for row in results["ways"] if row["threads"] == 1]
    for row in results["ways"]:
        cheaper = [other for other in rows if other["seconds"]["total"] < row["seconds"]["total"]]
        own = measures(row)
        row["front"] = row in rows and not any(
            all(measures(other)[name] <= own[name] for name in own) for other in cheaper
        )
        row["best_in"] = [
            name
            for name in own
            if row in rows and all(measures(other)[name] > own[name] for other in cheaper)
        ]
        row["levels"] = []
    results["ways"][0]["front"] = True  # the reference
    for name, row in _find_levels(results).items():
        row["levels"].append(name)


def limits_of(results: dict[str, Any]) -> dict[str, float]:
    """The largest errors of `areas` and `spacing` that are good enough: a tenth, or what one seed is from the
    mean of all where that is more, since a smaller one cannot be told from chance.
    """
    return {name: max(_MOST_STATISTICS, results["noise"][name]) for name in ("areas", "spacing")}


def _find_levels(results: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The cheapest ways on the front that are good enough for a small, a middle and a large picture, of those
    whose film curls; the one with the best picture where none is. Each level is dearer than the one before.
    """
    reference, *others = [row for row in results["ways"] if row["front"] and row["solver"] != "none"]
    others = sorted(others, key=_expected_seconds) or [reference]
    found: dict[str, dict[str, Any]] = {}
    for name, height in zip(LEVELS, (HEIGHTS[-1], HEIGHTS[1], HEIGHTS[0]), strict=False):
        good = [row for row in others if _is_good(row["errors"], str(height), results)]
        best = good[0] if good else min(others, key=lambda row: row["errors"]["image"][str(height)])
        found[name] = best
        others = others[others.index(best) + 1 :] or others[-1:]
    return {**found, LEVELS[-1]: reference}


def _expected_seconds(row: dict[str, Any]) -> float:
    """What a way is reckoned to cost: near ones come in another order by their measured seconds each time."""
    way = Way(row["faces"], row["steps"], row["solver"], row["sweeps"])
    return estimate_cost(config_of(way, 1), 2).seconds


def _is_good(errors: dict[str, Any], height: str, results: dict[str, Any]) -> bool:
    """Whether errors are within the limits of `plan` in a picture so high."""
    pixels = errors["distance"] / results["shear_lag"] * results["pixels_per_shear_lag"][height]
    return (
        pixels <= MOST_PIXELS
        and errors["image"][height] <= MOST_IMAGE
        and all(errors[name] <= limit for name, limit in limits_of(results).items())
    )
