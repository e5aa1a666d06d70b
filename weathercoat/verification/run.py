"""Proving a finished run whole: every file listed and unchanged, every snapshot sound, every figure right.

The room reads with readers of its own and imports nothing of the package but its errors, so that a fault of
what writes a run is not repeated in what checks it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import AccessError, CheckError
from weathercoat.verification.fields import is_number, read_object, take
from weathercoat.verification.figures import check_figures, check_row
from weathercoat.verification.film import Film, check_arrays, check_film
from weathercoat.verification.findings import BrokenFileError, Finding, Ledger
from weathercoat.verification.glb import Glb, read_glb
from weathercoat.verification.history import check_history
from weathercoat.verification.inherited import check_inherited
from weathercoat.verification.listing import REPORT, Listing
from weathercoat.verification.metal import Metal, check_same, make_metal
from weathercoat.verification.ply import PlySnapshot, read_snapshot, read_triangles
from weathercoat.verification.png import check_png
from weathercoat.verification.precision import REPORTED
from weathercoat.verification.sheets import check_agreement, check_glb

_PREVIEW, _UNTOUCHED, _VIEWER = "preview.png", "untouched.ply", "view.html"
_REPORT_VERSION = 1
_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Verification:
    """What a verification found.

    files, snapshots, checks: how many were looked at; findings: what is wrong, none where the run is whole;
    unproved: what could not be checked, in words, because the run did not write it.
    """

    folder: Path
    files: int
    snapshots: int
    checks: int
    findings: tuple[Finding, ...]
    unproved: tuple[str, ...]

    @property
    def is_whole(self) -> bool:
        """Whether nothing is wrong."""
        return not self.findings


def verify_run(folder: Path | str, *, ignored: Collection[str] = ()) -> Verification:
    """Check the folder of a finished run; whatever is in its files becomes a finding, not an error.

    ignored: files that may be in the folder without being of the run.
    Raises AccessError where there is no such folder, or no report in it that can be read.
    """
    folder = Path(folder)
    if not os.path.isdir(folder):  # noqa: PTH112 (any text will do)
        raise AccessError("there is no such folder", file=str(folder), remedy="give the folder of a run")
    try:
        if (folder / REPORT).exists() and not (folder / REPORT).is_file():
            raise OSError("is no file")
        content = (folder / REPORT).read_bytes()
    except OSError as error:
        reason = f"{REPORT}: {error.strerror or error}"
        raise AccessError(reason, file=str(folder), remedy="give the folder of a finished run") from error
    ledger = Ledger()
    files = snapshots = 0
    unproved: list[str] = []
    # Numbers of broken files may be anything; what they lead to is compared, and fails.
    with np.errstate(all="ignore"):
        try:
            report = read_object(content)
            listing = Listing(folder, report, ledger, ignored)
            run = _Run(report, listing, ledger)
        except BrokenFileError as error:
            ledger.expect("report", REPORT, False, str(error))
        else:
            run.check()
            files, snapshots, unproved = 1 + listing.read, run.snapshots, run.unproved
    return Verification(folder, files, snapshots, ledger.checks, tuple(ledger.findings), tuple(unproved))


def require_whole(folder: Path | str, *, ignored: Collection[str] = ()) -> None:
    """Raises CheckError, which tells of the first finding, where `verify_run` finds any."""
    findings = verify_run(folder, ignored=ignored).findings
    if findings:
        more = f", and {len(findings) - 1:,} more" if len(findings) > 1 else ""
        raise CheckError(f"the result fails its checks: {findings[0]}{more}")


class _Run:
    """The checks of one run, snapshot after snapshot in order of time; `snapshots` have been read so far."""

    def __init__(self, report: dict[str, Any], listing: Listing, ledger: Ledger) -> None:
        """Takes what all checks need out of the report; raises BrokenFileError."""
        version = take(report, "report_version", int)
        if version != _REPORT_VERSION:
            raise BrokenFileError(f"is of version {version}, and {_REPORT_VERSION} is known")
        self.report, self.listing, self.ledger = report, listing, ledger
        self.rows = take(report, "snapshots", list)
        self.steps = [take(row, "step", int) for row in self.rows]
        self.formats = take(report, "config.output.formats", list)
        if not self.formats or not all(name in ("ply", "glb") for name in self.formats):
            raise BrokenFileError(f"config.output.formats is {str(self.formats)[:40]}")
        self.has_preview = take(report, "config.output.preview", bool)
        self.duration = take(report, "config.ageing.duration", float)
        self.last_step = take(report, "config.ageing.steps", int)
        if self.last_step < 0 or not all(map(is_number, (self.last_step, *self.steps))):
            raise BrokenFileError(
                f"config.ageing.steps is {self.last_step}, or a snapshot is of no such step"
            )
        self.width = max(4, len(str(self.last_step)))
        self.metal_faces = take(report, "meshes.film.faces", int)
        # In sizes of the painted surface, which is no larger than the input.
        size = np.sqrt(max(take(report, "meshes.input.area", float), take(report, "meshes.film.area", float)))
        self.thickness = take(report, "config.appearance.thickness", float) * float(size)
        self.up = take(report, "meshes.input.up", list)
        if len(self.up) != 3 or not all(map(is_number, self.up)) or not 0.5 < np.linalg.norm(self.up) < 2.0:
            raise BrokenFileError(f"meshes.input.up is {str(self.up)[:40]}")
        self.snapshots = 0
        self.other_faces = 0
        self.metal: Metal | None = None
        self.first: PlySnapshot | None = None
        self.film: Film | None = None

    @property
    def unproved(self) -> list[str]:
        """What the formats that were not written leave open."""
        missing = []
        if "ply" not in self.formats:
            missing.append("the film's half-edges and planes, areas and figures: the run wrote no PLY")
        if "glb" not in self.formats:
            missing.append("that PLY and GLB agree: the run wrote no GLB")
        return missing

    def check(self) -> None:
        """Every check, into the ledger."""
        snapshots = {self._name(step, format) for step in self.steps for format in self.formats}
        pages = {_VIEWER} if take(self.report, "config.output.viewer", bool, False) else set()
        self.listing.check_names(snapshots | pages | ({_PREVIEW} if self.has_preview else set()))
        others = [name for name in self.listing.names if name not in snapshots]
        for name in others:
            if name.startswith("snapshots/"):
                self.ledger.expect("snapshots-listed", name, False, "is of no snapshot of run.json")
            self._check_other(name)
        self.ledger.expect(
            "order",
            REPORT,
            all(a < b for a, b in pairwise(self.steps)),
            f"the steps {', '.join(map(str, self.steps))[:60]} do not rise",
        )
        self.ledger.expect(
            "order",
            REPORT,
            all(0 <= step <= self.last_step for step in self.steps),
            f"the steps {', '.join(map(str, self.steps))[:60]} are not among {self.last_step:,} of the run",
        )
        for row, step in zip(self.rows, self.steps, strict=True):
            self._check_snapshot(row, step)

    def _check_other(self, name: str) -> None:
        """A file that belongs to no snapshot."""
        if name == _PREVIEW:
            self._read("preview", name, check_png)
        elif name == _UNTOUCHED:
            found = self._read("untouched", name, read_triangles)
            if found is not None:
                self._check_untouched(name, *found)
        else:
            self.listing.content(name)

    def _check_untouched(self, name: str, positions: NDArray[np.float64], faces: NDArray[np.int32]) -> None:
        self.other_faces = len(faces)
        self.ledger.expect_all(
            "finite",
            name,
            np.isfinite(positions),
            lambda i: f"the position of vertex {i} is not finite",
        )
        self.ledger.expect_all(
            "indices",
            name,
            (faces >= 0) & (faces < len(positions)),
            lambda i: f"face {i} has corners {faces[i].tolist()}, but there are {len(positions):,} vertices",
        )

    def _check_snapshot(self, row: dict[str, Any], step: int) -> None:
        """The row of the report and the files of one snapshot."""
        has_figures = self._guard("figures", REPORT, lambda: self._check_row(row, step)) is not None
        snapshot: PlySnapshot | None = None
        film: Film | None = None
        if "ply" in self.formats:
            name = self._name(step, "ply")
            snapshot = self._read("ply", name, read_snapshot)
            if snapshot is not None:
                film = self._guard("ply", REPORT, lambda: self._check_ply(name, snapshot, row))
            if snapshot is not None and film is not None and self.metal is not None:
                if has_figures:
                    check_figures(self.ledger, name, row, snapshot, film, self.metal)
                if self.film is not None:
                    check_history(self.ledger, name, self.film, film, self.metal)
                self.film = film
        if "glb" in self.formats:
            name = self._name(step, "glb")
            glb = self._read("glb", name, read_glb)
            if glb is not None:
                self._guard("glb", REPORT, lambda: self._check_glb(name, glb, row, snapshot, film))
        self.snapshots += 1

    def _check_row(self, row: dict[str, Any], step: int) -> bool:
        """What a row of the report says by itself; true, or BrokenFileError where something is missing."""
        told, own = take(row, "age", float), self.duration * (step / max(self.last_step, 1))
        self.ledger.expect(
            "ages",
            REPORT,
            abs(told - own) <= REPORTED * own,
            f"the age of step {step} is {told!r}, which is not that share of {self.duration!r}",
        )
        return check_row(self.ledger, row)

    def _check_ply(self, name: str, snapshot: PlySnapshot, row: dict[str, Any]) -> Film | None:
        """The film of a snapshot, or None where it is too broken to go on."""
        self._check_time(name, snapshot.step, snapshot.age, row)
        if not check_arrays(self.ledger, name, snapshot):
            return None
        if self.metal is None:
            self.metal = make_metal(self.ledger, name, snapshot, self.report)
        elif not check_same(self.ledger, name, snapshot, self.metal):
            return None
        if self.metal is None:
            return None
        check_inherited(self.ledger, name, snapshot, self.metal, self.first)
        self.first = self.first or snapshot
        counts = {
            "film_vertices": len(snapshot.part) - len(self.metal.vertices),
            "film_faces": len(snapshot.face_part) - len(self.metal.faces),
        }
        for key, count in counts.items():
            told = take(row, key, int)
            self.ledger.expect(
                "counts", name, count == told, f"holds {count:,} {key}, but run.json says {told:,}"
            )
        return check_film(self.ledger, name, snapshot, self.metal)

    def _check_glb(
        self, name: str, glb: Glb, row: dict[str, Any], snapshot: PlySnapshot | None, film: Film | None
    ) -> None:
        self._check_time(name, glb.step, glb.age, row)
        is_sound = check_glb(
            self.ledger,
            name,
            glb,
            film_faces=take(row, "film_faces", int),
            metal_faces=self.metal_faces,
            other_faces=self.other_faces,
            is_shell=self.thickness > 0.0,
        )
        if is_sound and snapshot is not None and film is not None and self.metal is not None:
            check_agreement(
                self.ledger, name, glb, snapshot, film, self.metal, up=self.up, thickness=self.thickness
            )

    def _check_time(self, name: str, step: int, age: float, row: dict[str, Any]) -> None:
        told_step, told_age = take(row, "step", int), take(row, "age", float)
        self.ledger.expect(
            "time",
            name,
            step == told_step and abs(age - told_age) <= REPORTED * abs(told_age),
            f"is of step {step}, age {age!r}, but run.json says {told_step}, {told_age!r}",
        )

    def _name(self, step: int, format: str) -> str:
        return f"snapshots/step_{step:0{self.width}d}.{format}"

    def _read(self, check: str, name: str, read: Callable[[bytes], _Result]) -> _Result | None:
        """What a file holds, or None where it is missing or broken."""
        content = self.listing.content(name)
        return None if content is None else self._guard(check, name, lambda: read(content))

    def _guard(self, check: str, file: str, work: Callable[[], _Result]) -> _Result | None:
        """What the work returns; a finding and None where it meets something that is not as it must be."""
        self.ledger.checks += 1
        try:
            return work()
        except BrokenFileError as error:
            self.ledger.findings.append(Finding(check, file, str(error)))
            return None
