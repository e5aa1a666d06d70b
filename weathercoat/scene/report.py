"""The report of an aged scene, `scene.json`: each object's exposure, degree, result and detail.

Its form is that of `schemas/scene_report.json`. It holds no times, so the same scene gives the same report.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from weathercoat.errors import Note, printable
from weathercoat.output.report import versions
from weathercoat.scene.detail import pixels_per_unit
from weathercoat.scene.exposure import ground_level
from weathercoat.scene.graph import Scene, SceneObject
from weathercoat.scene.plan import ScenePlan, VariantPlan

REPORT = "scene.json"
REPORT_VERSION = 1
_MOST_ROWS = 60  # of the table; the report has all


def make_report(plan: ScenePlan, source: str, batch: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The content of `scene.json`.

    source: name of the file of the scene. batch: content of `batch.json`, None where nothing has been run.
    """
    scene, camera = plan.scene, plan.scene.camera
    results = {} if batch is None else {row["name"]: row for row in batch["jobs"]}
    return {
        "scene_version": REPORT_VERSION,
        "versions": versions(),
        "source": source,
        "up": list(scene.up),
        "ground": ground_level(scene),
        "camera": None
        if camera is None
        else {
            "places": len(camera.positions),
            "field_of_view": camera.field_of_view,
            "image_height": camera.image_height,
        },
        "objects": [_object_row(plan, item) for item in scene.objects],
        "variants": [
            _variant_row(variant, plan.assets, results.get(job_name(variant))) for variant in plan.variants
        ],
        "notes": [
            {"mesh": mesh, "code": note.code, "count": note.count, "message": note.message}
            for mesh, notes in _notes(scene)
            for note in notes
        ],
    }


def _notes(scene: Scene) -> Iterator[tuple[str | None, Sequence[Note]]]:
    """The notes of the scene, and those of each mesh."""
    yield None, scene.notes
    yield from ((key, surface.notes) for key, surface in scene.meshes.items())


def note_lines(scene: Scene) -> Iterator[str]:
    """What could not be kept, and what was repaired, for people."""
    for mesh, notes in _notes(scene):
        for note in notes:
            yield printable(f"{scene.name}: " + (f"{mesh}: " if mesh is not None else "")) + note.line()


def job_name(variant: VariantPlan) -> str:
    """Where the run of a variant lies in the folder of the scene."""
    return f"objects/{variant.variant.name}"


def _object_row(plan: ScenePlan, item: SceneObject) -> dict[str, Any]:
    name = item.name
    row: dict[str, Any] = {"name": name, "mesh": item.mesh, "kept": plan.why_kept(item) or None}
    if name not in plan.shown:
        return {**row, "variant": None, "weathering": None, "detail": None}
    shown, camera, distance = plan.shown[name], plan.scene.camera, plan.distances.get(name)
    seen = None if camera is None or distance is None else pixels_per_unit(camera, distance)
    return {
        **row,
        "variant": shown.variant.name,
        "weathering": asdict(plan.weathering[name]),
        "detail": {
            "seen": None if camera is None else distance is not None,
            "distance": None if distance is None else _short(distance),
            **_detail(shown),
            "pixels_per_unit": None if seen is None else _short(seen),
        },
    }


def _variant_row(
    shown: VariantPlan, assets: Mapping[str, str], result: Mapping[str, Any] | None
) -> dict[str, Any]:
    variant, config = shown.variant, shown.loaded.config
    quality = shown.plan.quality
    return {
        "name": variant.name,
        "folder": job_name(shown),
        "mesh": variant.mesh,
        "asset": assets[variant.name],
        "config": shown.loaded.source,
        "seed": config.seed,
        "objects": [member.item.name for member in variant.members],
        "age": shown.age,
        "duration": config.ageing.duration,
        "up": list(shown.surface.up),
        "stretch": variant.placement.shape.tolist(),
        "weathering": asdict(variant.weathering),
        "detail": {**_detail(shown), "why": None if quality is None else quality["why"]},
        "expected": {
            "seconds": round(shown.cost.seconds, 1),
            "memory_mb": round(shown.cost.memory / 1e6),
            "disk_mb": round(shown.cost.disk / 1e6, 1),
        },
        "figures": None if result is None else result["figures"],
        "error": None if result is None else result["error"],
    }


def _detail(shown: VariantPlan) -> dict[str, Any]:
    """What was chosen for a variant, and the errors that are expected of it."""
    config, quality = shown.loaded.config, shown.plan.quality
    scene = None if quality is None else quality["scene"]
    faces = config.remesh.faces if config.remesh else len(shown.painted.faces)
    return {
        "quality": None if quality is None else quality["asked"],
        "pixels_per_unit": None if scene is None else _short(scene["per_unit"]),
        "faces": faces,
        "steps": config.ageing.steps,
        "solver": config.deformation.solver,
        "errors": None if quality is None else quality["expected"]["errors"],
        "kept": [] if quality is None else sorted(quality["kept"]),
    }


def table_lines(report: Mapping[str, Any]) -> Iterator[str]:
    """The report for people: a line for each object, where there are not too many, and the sums."""
    rows = report["objects"]
    shown = rows[:_MOST_ROWS]
    wide = max(len(row["name"]) for row in shown)
    of = max(len(row["variant"] or "-") for row in shown)
    yield (
        f"{'object':{wide}} {'variant':{of}} {'sky':>5} {'rain':>5} {'wet':>5} {'degree':>6} "
        f"{'distance':>8} {'faces':>7} {'steps':>5} {'solver':>8} {'off by':>9}"
    )
    for row in shown:
        if row["kept"] is not None:
            yield f"{row['name']:{wide}} {'-':{of}} kept: {row['kept']}"
            continue
        weathering, detail = row["weathering"], row["detail"]
        yield (
            f"{row['name']:{wide}} {row['variant']:{of}} {weathering['sky']:5.2f} {weathering['rain']:5.2f} "
            f"{weathering['wet']:5.2f} {weathering['degree']:6.2f} {_distance_word(detail):>8} "
            f"{detail['faces']:7,} {detail['steps']:5,} {detail['solver']:>8} {_error_word(detail):>9}"
        )
    if len(rows) > len(shown):
        yield f"... and {len(rows) - len(shown)} more, see {REPORT}"
    variants = report["variants"]
    seconds = sum(variant["expected"]["seconds"] for variant in variants)
    weathered = sum(row["kept"] is None for row in rows)
    yield (
        f"objects: {len(rows)}, weathered: {weathered}; meshes: {len({row['mesh'] for row in rows})}; "
        f"results: {len(variants)}, about {seconds:,.0f} s of work"
    )


def _distance_word(detail: Mapping[str, Any]) -> str:
    if detail["seen"] is None:
        return "-"
    return f"{detail['distance']:.3g}" if detail["seen"] else "unseen"


def _error_word(detail: Mapping[str, Any]) -> str:
    """The expected error that people see: of the film in pixels, or of areas where none are known."""
    errors = detail["errors"]
    if not errors:
        # none is measured for the finest way, which is what the others are measured against
        return "unknown" if detail["quality"] is None or detail["kept"] else "reference"
    return f"{errors['pixels']:.2f} px" if "pixels" in errors else f"{errors['areas']:.0%}"


def _short(value: float) -> float:
    return float(f"{value:.4g}")
