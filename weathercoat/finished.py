"""What a finished run holds, for the commands that make more of it: pictures, maps, other formats, labels."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from weathercoat.config.schema import Config
from weathercoat.errors import CorruptError, UsageError
from weathercoat.mesh.read import name_of, read_surface
from weathercoat.mesh.surface import Surface
from weathercoat.output.folder import REPORT, UNTOUCHED, read_report, snapshot_files
from weathercoat.output.report import sha256
from weathercoat.output.snapshots import read_snapshot_ply
from weathercoat.sim.snapshot import Snapshot


@dataclass(frozen=True)
class FinishedRun:
    """The folder of a finished run; `report` is the content of its run.json."""

    path: Path
    report: dict[str, Any]

    @cached_property
    def config(self) -> Config:
        """The config of the run; CorruptError where it is none of this version."""
        from pydantic import ValidationError

        try:
            return Config.model_validate(self.report.get("config"))
        except ValidationError as error:
            raise CorruptError(
                "holds no config of this version", file=str(self.path / REPORT), remedy="run again"
            ) from error

    @property
    def up(self) -> tuple[float, float, float]:
        """The direction against gravity, in the model's axes."""
        x, y, z = self.report["meshes"]["input"]["up"]
        return x, y, z

    @property
    def steps(self) -> list[int]:
        """The steps of which there are snapshots, rising."""
        return [int(row["step"]) for row in self.report["snapshots"]]

    @cached_property
    def untouched(self) -> Surface | None:
        """The parts that carry no paint, if there are any."""
        path = self.path / UNTOUCHED
        return read_surface(path) if path.exists() else None

    def read_snapshot(self, step: int | None = None) -> Snapshot:
        """The snapshot of a step, by default of the last.

        Raises UsageError where there is none of this step, FormatError where the run wrote no PLY, and what
        `read_snapshot_ply` raises.
        """
        files = snapshot_files(self.path)
        wanted = max(files) if step is None else step
        if wanted not in files:
            steps = ", ".join(map(str, files))
            raise UsageError(
                f"the run has no snapshot of step {step}", file=str(self.path), remedy=f"there are {steps}"
            )
        return read_snapshot_ply(files[wanted])

    def read_snapshots(self, steps: Sequence[int], model: Surface | None) -> list[Snapshot]:
        """The snapshots of steps, with the materials of the run's model, where that is given."""
        snapshots = [self.read_snapshot(step) for step in steps]
        if model is None:
            return snapshots
        return [with_materials(snapshot, model) for snapshot in snapshots]

    def find_model(self, model: Path | None = None) -> Surface | None:
        """As `read_model`, but None where no model is given and none is found."""
        if model is not None:
            return self.read_model(model)
        return self.read_model(self._beside()) if self._beside() is not None else None

    def _beside(self) -> Path | None:
        """The run's model, where it is beside its folder or in the working one."""
        name = self.report["model"]
        digest = self.report["inputs"][name]["sha256"]
        for place in (self.path.parent / name, Path(name)):
            if place.is_file() and sha256(place) == digest:
                return place
        return None

    def read_model(self, model: Path | None = None) -> Surface:
        """The model of the run as it was read then, repaired; by default the file of its name beside the
        run's folder or in the working folder.

        Raises UsageError where it is not found, or is another than the run was made of, and what
        `read_surface` raises.
        """
        name = self.report["model"]
        place = self._beside() if model is None else model
        if place is None or not place.is_file():
            raise UsageError(
                f"the model of the run, {name}, is not there", file=str(model or name), remedy="give --model"
            )
        if sha256(place) != self.report["inputs"][name]["sha256"]:
            raise UsageError(
                f"is not the model of the run {self.path}, which was made of {name}", file=name_of(place)
            )
        return read_surface(place, up=self.config.model.up)


def with_materials(snapshot: Snapshot, model: Surface) -> Snapshot:
    """A snapshot that was read, with the parts and materials of the model that it is of."""
    if snapshot.surface is None:
        return snapshot
    own = replace(snapshot.surface, parts=model.parts, materials=model.materials, tree=model.tree)
    return replace(snapshot, surface=replace(own, up=model.up, name=model.name))


def open_run(path: Path | str) -> FinishedRun:
    """The finished run in a folder, or the one whose snapshots the folder holds.

    Raises AccessError where there is none, CorruptError where its report is broken.
    """
    folder = Path(path)
    if not os.path.exists(folder / REPORT) and os.path.exists(folder.parent / REPORT):  # noqa: PTH110
        folder = folder.parent  # os.path takes any text
    return FinishedRun(folder, read_report(folder))
