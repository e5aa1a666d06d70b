"""Age a whole scene: from the file to a folder with the aged scene, its report and its picture."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from weathercoat.batch.batch import Listener, run_batch
from weathercoat.batch.job import Executor, Job, Task
from weathercoat.config.derived import with_values
from weathercoat.mesh.surface import Surface
from weathercoat.output.folder import SNAPSHOTS, output_errors, snapshot_stem
from weathercoat.output.meshes import write_mesh
from weathercoat.output.report import write_json
from weathercoat.output.snapshots import read_snapshot_ply
from weathercoat.recording import unit_color
from weathercoat.scene.graph import AgedMesh
from weathercoat.scene.plan import MODELS, ScenePlan, VariantPlan
from weathercoat.scene.report import REPORT, job_name, make_report
from weathercoat.scene.write import write_scene

SCENE, PREVIEW = "scene.glb", "preview.png"


def age_scene(
    plan: ScenePlan,
    source: str,
    out: str | Path,
    executor: Executor,
    *,
    workers: int = 1,
    threads: int = 1,
    check: bool = True,
    max_memory: int | None = None,
    preview: bool = True,
    begin: Callable[[Sequence[Task]], None] | None = None,
    listen: Listener | None = None,
    log: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Age what is planned, write the folder `out`, and return the content of its `scene.json`.

    source: name of the file of the scene. The results are `objects/VARIANT` by way of `run_batch`, whose
    arguments the others are; what is there and unchanged is not done again. Objects of variants that fail
    stay as they are in `scene.glb`, and the variants have an `error` in the report. Raises OutputError where
    `out` cannot be written.
    """
    folder = Path(out)
    assets = plan.assets
    with output_errors(folder):
        (folder / MODELS).mkdir(parents=True, exist_ok=True)
    written = set()
    for variant in plan.variants:
        asset = assets[variant.variant.name]
        if asset not in written:
            write_mesh(folder / asset, _plain(variant.surface), overwrite=True)
            written.add(asset)
    jobs = [_job(variant, folder / assets[variant.variant.name]) for variant in plan.variants]
    batch = run_batch(
        jobs,
        folder,
        executor,
        workers=workers,
        threads=threads,
        check=check,
        max_memory=max_memory,
        begin=begin,
        listen=listen,
    )
    report = make_report(plan, source, batch)
    whole = {row["name"]: row["figures"]["step"] for row in report["variants"] if row["error"] is None}
    aged = {name: shown.variant.name for name, shown in plan.shown.items() if shown.variant.name in whole}
    films = Films(plan, folder, whole)
    write_scene(folder / SCENE, plan.scene, aged, films, overwrite=True)
    with output_errors(folder / REPORT):
        write_json(folder / REPORT, report)
    if preview:
        from weathercoat.scene.picture import write_preview

        write_preview(folder / PREVIEW, plan, aged, films, log or (lambda line: None))
    return report


@dataclass
class Films(Mapping[str, AgedMesh]):
    """The last films of variants by their names, each read when it is asked for; the last one stays.

    steps: that of the last snapshot, by name.
    """

    plan: ScenePlan
    folder: Path
    steps: Mapping[str, int]
    _last: tuple[str, AgedMesh] | None = field(default=None, init=False)

    def __getitem__(self, name: str) -> AgedMesh:
        if self._last is None or self._last[0] != name:
            self._last = (name, self._read(name))
        return self._last[1]

    def __iter__(self) -> Iterator[str]:
        return iter(self.steps)

    def __len__(self) -> int:
        return len(self.steps)

    def _read(self, name: str) -> AgedMesh:
        shown = next(shown for shown in self.plan.variants if shown.variant.name == name)
        config = shown.loaded.config
        stem = snapshot_stem(self.steps[name], config.ageing.steps)
        return AgedMesh(
            snapshot=read_snapshot_ply(self.folder / job_name(shown) / SNAPSHOTS / f"{stem}.ply"),
            thickness=config.appearance.thickness * shown.painted.size(),
            back_color=unit_color(config.appearance.back),
            untouched=shown.untouched,
            stretch=shown.variant.placement.shape,
        )


def _job(shown: VariantPlan, asset: Path) -> Job:
    """The run of a variant. Names of groups are spelled as in its model, where they have no spaces."""
    paint = shown.loaded.config.paint
    values = {
        "paint.only": [_unspaced(name) for name in paint.only],
        "paint.except": [_unspaced(name) for name in paint.excluded],
    }
    loaded = shown.loaded
    if any(list(was) != now for was, now in zip((paint.only, paint.excluded), values.values(), strict=True)):
        loaded = with_values(loaded, values, "the scene")
    return Job(job_name(shown), str(asset), loaded)


def _unspaced(name: str) -> str:
    return "_".join(name.split())


def _plain(surface: Surface) -> Surface:
    """A surface without what no run looks at."""
    return replace(surface, uv=None, colors=None)
