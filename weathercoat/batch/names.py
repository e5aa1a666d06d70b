"""Names of jobs, which are the folders of their results: stable, safe, and hanging on nothing but the job.

A name is made of the model's path or given by a manifest. It never depends on what else is in the batch, so
that a result keeps its place when models are added; where two jobs would have one folder, that is an error.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path, PurePath, PurePosixPath
from typing import NamedTuple

from weathercoat.batch.record import RECORD
from weathercoat.batch.storage import is_url
from weathercoat.errors import OutputExistsError, UsageError
from weathercoat.output.folder import REPORT, safe_name

STYLES = ("stem", "path")
PARTIAL = ".partial"  # ends the names of folders that are being written

_END_OF_PATH = re.compile(r"::|[?#]")  # in a URL: chained file systems, a query, a fragment


class Named(NamedTuple):
    """A name, the model that it stands for, and where the job was asked for, for messages."""

    name: str
    asset: str
    place: str


def model_name(model: str, style: str = "stem") -> str:
    """The name of a job whose model was named by itself: `chair` for `models/chair.obj`, or by `path`
    `models/chair.obj`, without a root and `..`.
    """
    if is_url(model):
        model = _END_OF_PATH.split(model.partition("://")[2], maxsplit=1)[0].strip("/")
    path = PurePath(model)
    return safe_path(path.parts if style == "path" else [path.stem])


def found_name(folder: str, found: PurePath, style: str = "stem") -> str:
    """The name of a job whose model was found below a folder: its path there without extension, or by `path`
    the whole one with it.
    """
    if style == "path":
        return safe_path(PurePath(folder, found).parts)
    return safe_path(found.with_name(found.stem).parts)


def safe_path(parts: Iterable[str]) -> str:
    """Safe file names with slashes between them, without a root, `.` and `..`."""
    kept = [_safe_part(part) for part in parts if part.strip("/\\") not in ("", ".", "..")]
    if not kept:
        return safe_name("")
    if kept[0].casefold() == RECORD:
        kept[0] = kept[0].replace(".", "_")
    return "/".join(kept)


def _safe_part(part: str) -> str:
    name = safe_name(part)
    if name.casefold().endswith(PARTIAL):
        name = f"{name[: -len(PARTIAL)]}_{PARTIAL[1:]}"
    return name


def check_names(jobs: Iterable[Named]) -> None:
    """Raise UsageError where two jobs have one name, compared without case as some file systems do, or where
    the folder of one would lie within that of another.
    """
    taken: dict[str, Named] = {}
    for job in jobs:
        other = taken.setdefault(job.name.casefold(), job)
        if other is not job:
            raise _clash(other, job)
    for key, job in taken.items():
        parts = key.split("/")
        for depth in range(1, len(parts)):
            outer = taken.get("/".join(parts[:depth]))
            if outer is not None:
                what = f"the results of {_shown(job)} would lie within those of {_shown(outer)}"
                raise UsageError(what, remedy=_REMEDY)


def check_room(jobs: Iterable[str], out: Path) -> None:
    """Raise OutputExistsError where the folder of a job would lie within the result of an earlier one, which
    would take it along when it is replaced.
    """
    above = dict.fromkeys(parent for job in jobs for parent in PurePosixPath(job).parents if parent.parts)
    for parent in above:
        folder = out / parent
        if (folder / REPORT).is_file():
            what = f"is the result of a job {parent}, in which others would lie now"
            raise OutputExistsError(
                what, file=str(folder), remedy="choose another folder with -o, or remove it"
            )


_REMEDY = "give --names path, or names in a manifest"


def _clash(one: Named, other: Named) -> UsageError:
    if one.asset == other.asset:
        what = f"{one.asset} is asked for twice under the name {one.name}, by {one.place} and {other.place}"
        return UsageError(what, remedy="give it once, or names in a manifest")
    return UsageError(f"{_shown(one)} and {_shown(other)} would have one folder", remedy=_REMEDY)


def _shown(job: Named) -> str:
    return f"{job.name} ({job.asset})"
