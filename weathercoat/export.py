"""A finished run in other formats: snapshots as OBJ, PLY, GLB and VTU, the run as an animated GLB, PVD or
USD.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from weathercoat.finished import FinishedRun
from weathercoat.mesh.surface import Surface
from weathercoat.output.folder import output_errors, snapshot_stem
from weathercoat.output.glb import Node, Sheet, write_glb
from weathercoat.output.glb_series import Moment, write_glb_series
from weathercoat.output.lods import coarser, require_lods
from weathercoat.output.obj import write_obj
from weathercoat.output.parts import part_sheets, write_parts_glb
from weathercoat.output.pieces import number_flakes, rest_centers
from weathercoat.output.sheets import surface_nodes
from weathercoat.output.snapshots import Look, film_sheets, metal_sheets, write_snapshot_ply
from weathercoat.output.usd import Frame, require_usd, write_usd
from weathercoat.output.vtu import write_pvd, write_snapshot_vtu
from weathercoat.recording import unit_color
from weathercoat.sim.snapshot import Snapshot

FORMATS = ("obj", "ply", "glb", "vtu", "animation", "usd")


@dataclass(frozen=True)
class ExportParameters:
    """What is written.

    formats: of `FORMATS`. steps: those of the snapshots. thickness: whether the film has a back and a rim;
    flakes: whether loose pieces of film are objects of their own; lods: how many coarser levels follow the
    full one, as OBJ and GLB; seconds: for which an animation shows each snapshot. model: the run's model with
    its materials, or None, for which the film shows its paint.
    """

    formats: Sequence[str]
    steps: Sequence[int]
    thickness: bool = True
    flakes: bool = False
    lods: int = 0
    seconds: float = 0.5
    model: Surface | None = None


def export_run(
    run: FinishedRun, folder: Path, parameters: ExportParameters, say: Callable[[str], None] | None = None
) -> list[Path]:
    """Write a run into an empty folder; the files that were written.

    say: called with the name of each snapshot that is done. Raises UsageError where a format needs an extra
    that is not installed, OutputError where a file cannot be written, and what reading the snapshots raises.
    """
    if "usd" in parameters.formats:
        require_usd()
    if parameters.lods:
        require_lods()
    exporter = _Exporter(run, folder, parameters)
    with output_errors(folder):
        for step in parameters.steps:
            exporter.write_snapshot(step)
            if say is not None:
                say(f"step {step}")
        exporter.write_run()
    return sorted(path for path in folder.rglob("*") if path.is_file())


class _Exporter:
    def __init__(self, run: FinishedRun, folder: Path, parameters: ExportParameters) -> None:
        self.run, self.folder, self.wanted = run, folder, parameters
        colors = run.config.appearance
        size = float(run.report["meshes"]["film"]["area"]) ** 0.5
        self.thickness = colors.thickness * size if parameters.thickness else 0.0
        self.back = unit_color(colors.back)
        self.look = Look(colors.look, unit_color(colors.rust))
        self.series: list[tuple[float, Sequence[str]]] = []

    def write_snapshot(self, step: int) -> None:
        """The files of one snapshot."""
        snapshot = self._read(step)
        stem = snapshot_stem(step, self.run.config.ageing.steps)
        for level in range(self.wanted.lods + 1):
            film, metal = coarser(snapshot, level) if level else (snapshot, snapshot)
            name = f"{stem}_lod{level}" if self.wanted.lods else stem
            if "obj" in self.wanted.formats:
                write_obj(self.folder / f"{name}.obj", [*self._nodes(film, metal), *self._still()])
            if "glb" in self.wanted.formats:
                self._write_glb(self.folder / f"{name}.glb", film, metal)
        if "ply" in self.wanted.formats:
            write_snapshot_ply(self.folder, snapshot, stem)
        if "vtu" in self.wanted.formats:
            self.series.append((snapshot.age, write_snapshot_vtu(self.folder, snapshot, stem)))

    def write_run(self) -> None:
        """The files of all snapshots together."""
        if self.series:
            write_pvd(self.folder / "run.pvd", self.series)
        if "animation" in self.wanted.formats:
            moments = [
                Moment(snapshot.step, snapshot.age, self._nodes(snapshot, snapshot))
                for snapshot in map(self._read, self.wanted.steps)
            ]
            target = self.folder / "run.glb"
            write_glb_series(target, moments, self._still(), up=self.run.up, seconds=self.wanted.seconds)
        if "usd" in self.wanted.formats:
            write_usd(
                self.folder / "run.usdc",
                self._frames(),
                up=self.run.up,
                metres_per_unit=self.run.config.metres_per_unit() or 1.0,
            )

    def _frames(self) -> Iterator[Frame]:
        for number, step in enumerate(self.wanted.steps):
            snapshot = self._read(step)
            yield Frame(number * self.wanted.seconds, [*self._nodes(snapshot, snapshot), *self._still()])

    def _read(self, step: int) -> Snapshot:
        return self.run.read_snapshots([step], self.wanted.model)[0]

    def _still(self) -> list[Node]:
        untouched = self.run.untouched
        return [] if untouched is None else surface_nodes(untouched)

    def _nodes(self, film: Snapshot, metal: Snapshot) -> list[Node]:
        """The film, its flakes where they are wanted, and the metal, as nodes of their own."""
        sheets, pieces = self._film(film)
        nodes = [Node(name, own) for name, own in _by_name(film, [s for s in sheets if not s.piece], "film")]
        nodes += self._flakes(film, sheets, pieces)
        nodes += [Node(name, own) for name, own in _by_name(metal, metal_sheets(metal), "metal")]
        return nodes

    def _film(self, film: Snapshot) -> tuple[list[Sheet], int]:
        """The sheets of the film, and the number of its flakes."""
        pieces = number_flakes(film) if self.wanted.flakes else None
        sheets = film_sheets(film, self.thickness, self.back, self.look, pieces)
        return sheets, 0 if pieces is None or not len(pieces) else int(pieces.max())

    def _flakes(self, film: Snapshot, sheets: Sequence[Sheet], count: int) -> list[Node]:
        if count == 0:
            return []
        own: dict[int, list[Sheet]] = {}
        for sheet in sheets:
            own.setdefault(sheet.piece, []).append(sheet)
        centers = rest_centers(film, number_flakes(film))
        digits = max(4, len(str(count)))
        return [
            Node(f"flake_{number:0{digits}}", own[number], pivot=centers[number - 1])
            for number in range(1, count + 1)
            if number in own
        ]

    def _write_glb(self, path: Path, film: Snapshot, metal: Snapshot) -> None:
        extras = {"step": int(film.step), "age": float(film.age)}
        surface, model = film.surface, self.wanted.model
        if self.wanted.flakes or surface is None or model is None or not surface.parts:
            nodes = [*self._nodes(film, metal), *self._still()]
            write_glb(path, nodes, up=self.run.up, extras=extras)
            return
        is_bare = ~np.isin(model.face_group, surface.face_group)  # parts carry no paint by whole groups
        others = part_sheets(model.select_faces(is_bare)) if is_bare.any() else []
        sheets = [*self._film(film)[0], *metal_sheets(metal), *others]
        write_parts_glb(path, surface, sheets, up=self.run.up, extras=extras)


def _by_name(snapshot: Snapshot, sheets: Sequence[Sheet], what: str) -> list[tuple[str, list[Sheet]]]:
    """Sheets by the name of their part, or of `what` they are where the model has none."""
    surface = snapshot.surface
    named: dict[str, list[Sheet]] = {}
    for sheet in sheets:
        part = surface.parts[sheet.part].name if surface is not None and sheet.part >= 0 else ""
        named.setdefault(f"{part} {what}".strip(), []).append(sheet)
    return list(named.items())
