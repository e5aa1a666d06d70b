"""What `quality: auto` picks for a near, a middle and a far view, and how far that is from the reference.

The parts and seeds are not those that the front was measured with. The bars are those that auto promises:
pictures differ by under half of what two seeds at the reference do, areas and the distance between cracks by
under a tenth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

from weathercoat.bench.fidelity import AGES, PICTURE_AGES, warm_up
from weathercoat.bench.fidelity_errors import curve_errors, film_distance, mean_curves, picture_difference
from weathercoat.bench.fidelity_run import Observed, View, make_view, observe
from weathercoat.bench.files import rows_as_csv
from weathercoat.bench.machine import describe_machine
from weathercoat.bench.tables import Table
from weathercoat.config.load import load_config
from weathercoat.config.quality import read_front
from weathercoat.mesh.shapes import make_barrel, make_plate
from weathercoat.mesh.surface import Surface
from weathercoat.plan import Plan, make_plan

SCENES = {"hero": 1080, "mid": 240, "far": 24}  # pixels of height that the part fills
SEEDS = (3, 4)
_CONFIG = "standard"


def bench_scenes(
    *,
    seeds: tuple[int, int] = SEEDS,
    scenes: dict[str, int] = SCENES,
    overrides: Sequence[str] = (),
    progress: Callable[[int, int], None] = lambda done, total: None,
    say: Callable[[str], None] = lambda line: None,
) -> dict[str, Any]:
    """The results as plain values, a row for each part and scene.

    overrides: `key=value` of the config, for all runs. progress: called with the runs done and their number.
    say: called with what is worth knowing.
    """
    parts = {"plate": make_plate(width=1.0, height=0.75), "barrel": make_barrel()}
    total = len(parts) * (1 + len(scenes))
    rows = []
    say("compiling where that has not been done yet")
    solvers = {(point.values["deformation.solver"], 1) for point in read_front().points}
    warm_up(parts["plate"], make_view(parts["plate"], load_config(_CONFIG).config), solvers)
    for number, (name, part) in enumerate(parts.items()):
        bench = _Part(part, seeds, overrides)
        say(f"{name}: reference")
        truth = bench.run("reference", 1)
        progress(number * (1 + len(scenes)) + 1, total)
        for place, (scene, height) in enumerate(scenes.items()):
            say(f"{name}: {scene}")
            found = _compare(bench.run("auto", height), truth, bench.view, height)
            rows.append({"part": name, "scene": scene, **found})
            progress(number * (1 + len(scenes)) + 2 + place, total)
    return {
        "schema": 1,
        "machine": describe_machine(),
        "config": _CONFIG,
        "seeds": list(seeds),
        "overrides": list(overrides),
        "rows": rows,
    }


@dataclass(frozen=True)
class _Runs:
    """Runs with every seed, and what was planned of them."""

    runs: tuple[Observed, ...]
    quality: dict[str, Any]


class _Part:
    """Runs of one part; what two qualities have in common runs once."""

    def __init__(self, part: Surface, seeds: Sequence[int], overrides: Sequence[str]) -> None:
        self.part, self.seeds, self.overrides = part, seeds, overrides
        self.view = make_view(part, load_config(_CONFIG).config)
        self._known: dict[tuple[int, str], Observed] = {}

    def run(self, quality: str, height: int) -> _Runs:
        """The runs by a quality where the picture is so many pixels high."""
        per_unit = height * self.view.pixels_per_size / self.part.size()
        asked = [*self.overrides, f"quality={quality}", f"scene.pixels_per_metre={per_unit!r}"]
        plans = [
            make_plan(load_config(_CONFIG, [*asked, f"seed={seed}"]), self.part, len(self.part.faces))
            for seed in self.seeds
        ]
        runs = tuple(self._observe(seed, plan) for seed, plan in zip(self.seeds, plans, strict=True))
        return _Runs(runs, plans[0].quality or {})

    def _observe(self, seed: int, plan: Plan) -> Observed:
        key = seed, repr((plan.quality or {})["chosen"])
        if key not in self._known:
            self._known[key] = observe(self.part, plan.loaded.config, AGES, PICTURE_AGES)
        return self._known[key]


def _compare(ours: _Runs, truth: _Runs, view: View, height: int) -> dict[str, Any]:
    """How far runs are from those of the reference, in pictures so high."""
    theirs = [[view.draw(snapshot, height) for snapshot in run.snapshots] for run in truth.runs]
    pictures = [[view.draw(snapshot, height) for snapshot in run.snapshots] for run in ours.runs]
    picture, noise = fmean(map(picture_difference, pictures, theirs)), picture_difference(*theirs)
    films = [
        films
        for pair in zip(ours.runs, truth.runs, strict=True)
        for films in zip(pair[0].snapshots, pair[1].snapshots, strict=True)
    ]
    per_size = height * view.pixels_per_size
    return {
        "height": height,
        "pixels_per_size": per_size,
        "chosen": ours.quality["chosen"],
        "why": ours.quality["why"],
        "expected": ours.quality["expected"],
        "seconds": fmean(run.seconds["remesh"] + run.seconds["steps"] for run in ours.runs),
        "picture": picture,
        "picture_of_two_seeds": noise,
        "image": picture / noise,
        "pixels": fmean(film_distance(*pair) for pair in films) * per_size,
        "errors": curve_errors(
            mean_curves([run.curves for run in ours.runs]), mean_curves([run.curves for run in truth.runs])
        ),
    }


def scenes_table(results: dict[str, Any]) -> Table:
    """A row for each part and scene: what auto chose, what it cost, and how wrong it was."""
    table = [
        [
            "",
            "pixels high",
            "faces",
            "steps",
            "solver",
            "s",
            "times cheaper than hero",
            "picture",
            "film, pixels",
            "areas",
            "cracks",
            "rims",
        ]
    ]
    hero = {row["part"]: row["seconds"] for row in results["rows"] if row["scene"] == "hero"}
    for row in results["rows"]:
        chosen, errors = row["chosen"], row["errors"]
        solver = chosen["solver"] + (f" of {chosen['sweeps']}" if "sweeps" in chosen else "")
        table.append(
            [
                f"{row['part']}, {row['scene']}",
                f"{row['height']:,}",
                f"{chosen['faces']:,}",
                f"{chosen['steps']:,}",
                solver,
                f"{row['seconds']:.3g}",
                f"{hero[row['part']] / row['seconds']:.0f}" if row["part"] in hero else "",
                f"{row['image']:.2f}",
                f"{row['pixels']:.2f}",
                f"{errors['areas']:.1%}",
                f"{errors['spacing']:.1%}",
                f"{errors['rims']:.1%}",
            ]
        )
    return table


def as_csv(results: dict[str, Any]) -> str:
    """A line for each part and scene."""
    rows = []
    for row in results["rows"]:
        plain = {key: value for key, value in row.items() if not isinstance(value, dict)}
        chosen = {key: row["chosen"][key] for key in ("edge_length", "faces", "steps", "solver")}
        rows.append({**plain, **chosen, **row["errors"]})
    return rows_as_csv(rows)
