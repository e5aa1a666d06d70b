"""What a run will be like before it begins: the values that its quality stands for, why, what it is expected
to cost, and how wrong it is expected to be.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from weathercoat.config.load import LoadedConfig
from weathercoat.config.quality import AUTO, Point, kept_keys, point_of, read_front, with_point
from weathercoat.cost import Cost, estimate_cost, in_megabytes, what_fits
from weathercoat.memory import MemoryLimit
from weathercoat.mesh.surface import Surface

SWEEPING = ("sweeps", "momentum")  # the solvers that heed deformation.sweeps
MOST_PIXELS = 1.0  # mean distance of the film from the reference's
MOST_IMAGE = 0.5  # difference of pictures, relative to that of two seeds


@dataclass(frozen=True)
class Plan:
    """A run to be: its config, in which the quality has set what it sets; the triangles of its model; its
    cost; and what `run.json` says of the quality, None where none is asked for.
    """

    loaded: LoadedConfig
    model_faces: int
    cost: Cost
    quality: dict[str, Any] | None


@dataclass(frozen=True)
class _View:
    """How large the surface is seen at most: pixels for a unit of the model, a size and a shear lag."""

    per_unit: float
    per_size: float
    per_lag: float


def make_plan(loaded: LoadedConfig, painted: Surface, model_faces: int) -> Plan:
    """The plan of a run by `loaded` on the `painted` part of a model of so many triangles.

    Raises ConfigError where what the quality sets does not go with the rest of the config.
    """
    quality = loaded.config.quality
    if quality is None:
        return Plan(loaded, model_faces, estimate_cost(loaded.config, model_faces), None)
    view = _view_of(loaded, painted)
    if quality == AUTO:
        assert view is not None  # the schema asks for a scene
        point, settled, why = _choose(loaded, view, model_faces)
    else:
        point, settled = point_of(quality), loaded
        why = f"the config asks for {quality}"
    cost = estimate_cost(settled.config, model_faces)
    config = settled.config
    kept = kept_keys(loaded, point)
    chosen = {
        "edge_length": point.edge_length * config.fracture.shear_lag * painted.size(),
        "faces": config.remesh.faces if config.remesh else model_faces,
        "steps": config.ageing.steps,
        "solver": config.deformation.solver,
        "curls": config.deformation.solver != "none",
    }
    if config.deformation.solver in SWEEPING:
        chosen["sweeps"] = config.deformation.sweeps
    return Plan(
        settled,
        model_faces,
        cost,
        {
            "asked": quality,
            "chosen": chosen,
            "why": why,
            "kept": kept,
            "scene": None if view is None else vars(view),
            "expected": {
                "seconds": round(cost.seconds, 1),
                "errors": None if kept else _expected_errors(point, view),
            },
        },
    )


def plan_lines(plan: Plan) -> Iterator[str]:
    """A plan for people, one thing a line."""
    config = plan.loaded.config
    solver = config.deformation.solver
    how = f", {config.deformation.sweeps} a step" if solver in SWEEPING else ""
    faces = f"{config.remesh.faces:,}" if config.remesh else "the model's own"
    yield f"{'faces':18} {faces}"
    until = " or ".join(config.ageing.until)
    yield f"{'steps':18} {config.ageing.steps:,}" + (f" at most, until {until}" if until else "")
    yield f"{'deformation':18} " + ("none: the film stays flat" if solver == "none" else solver + how)
    quality = plan.quality
    if quality is not None:
        yield f"{'quality':18} {quality['asked']}: {quality['why']}"
        for key, origin in quality["kept"].items():
            yield f"{'kept':18} {key}, as it is set by {origin}"
        scene = quality["scene"]
        if scene is not None:
            edge = quality["chosen"]["edge_length"] * scene["per_unit"]
            yield f"{'an edge is':18} {edge:.2g} pixels long"
        errors = quality["expected"]["errors"]
        yield f"{'expected errors':18} " + (", ".join(_error_words(errors)) if errors else "unknown")
    yield f"{'expected cost':18} about {plan.cost.seconds:,.0f} s and {in_megabytes(plan.cost.memory)}"


def cost_figures(plan: Plan, limit: MemoryLimit | None) -> dict[str, Any]:
    """What a run is expected to cost, and whether it keeps within a limit of memory, ready for JSON."""
    return {
        "seconds": round(plan.cost.seconds, 1),
        "memory_mb": round(plan.cost.memory / 1e6),
        "memory_limit_mb": None if limit is None else round(limit.bytes / 1e6),
        "fits": limit is None or plan.cost.memory <= limit.bytes,
    }


def refusal_lines(plan: Plan, limit: MemoryLimit | None) -> Iterator[str]:
    """That a run would be refused, and what would fit; nothing where it would not."""
    if limit is not None and plan.cost.memory > limit.bytes:
        yield f"{'too much memory':18} more than {in_megabytes(limit.bytes)}, {limit.origin}"
        yield f"{'instead':18} {what_fits(plan.loaded.config, plan.model_faces, limit)}"


def _view_of(loaded: LoadedConfig, painted: Surface) -> _View | None:
    per_unit = loaded.config.pixels_per_unit()
    if per_unit is None:
        return None
    per_size = per_unit * painted.size()
    return _View(per_unit, per_size, per_size * loaded.config.fracture.shear_lag)


def _choose(loaded: LoadedConfig, view: _View, model_faces: int) -> tuple[Point, LoadedConfig, str]:
    """The cheapest point that is good enough for the scene, the config with it, and why."""
    settled = [(point, with_point(loaded, point, f"quality {AUTO}")) for point in read_front().points]
    *others, reference = settled
    by_cost = sorted(others, key=lambda pair: estimate_cost(pair[1].config, model_faces).seconds)
    lacking = ""
    for point, config in by_cost:
        faults = list(_faults(point, view))
        if not faults:
            errors = ", ".join(_error_words(_expected_errors(point, view) or {}))
            why = f"the cheapest measured way that is good enough for the scene ({errors})"
            return point, config, f"{why}{lacking}"
        lacking = f"; the next cheaper one lacks: {', '.join(faults)}"
    why = "no cheaper way is good enough for the scene; this is what the others are measured against"
    return *reference, f"{why}{lacking}"


def _faults(point: Point, view: _View) -> Iterator[str]:
    """In what a point is not good enough for a view, in words."""
    errors = _expected_errors(point, view)
    assert errors is not None  # only the reference has none
    limits = {"pixels": MOST_PIXELS, "image": MOST_IMAGE, **read_front().limits}
    words = dict(zip(errors, _error_words(errors), strict=True))
    for name, limit in limits.items():
        if errors[name] > limit:
            yield words[name]


def _expected_errors(point: Point, view: _View | None) -> dict[str, float] | None:
    """The errors of a point, without a scene those alone that need none; None of the reference."""
    if point.errors is None:
        return None
    errors = {"areas": point.errors.areas, "spacing": point.errors.spacing}
    if view is None:
        return errors
    pixels, image = point.errors.distance * view.per_lag, point.errors.image_at(view.per_lag)
    return {"pixels": float(f"{pixels:.3g}"), "image": float(f"{image:.3g}"), **errors}


def _error_words(errors: dict[str, float]) -> Iterator[str]:
    words = {
        "pixels": "film off by {:.2g} pixels",
        "image": "picture off by {:.2g} of what two seeds are",
        "areas": "areas off by {:.0%}",
        "spacing": "distance of cracks off by {:.0%}",
    }
    return (words[name].format(value) for name, value in errors.items())
