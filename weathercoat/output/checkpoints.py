"""What a run goes on from, in the folder `checkpoint` of its results.

    state.npz         the arrays of `sim.checkpoint`, and in `about.json` what the run is and has recorded
    surface.npz       the remeshed surface, where it was remeshed
    step_0100.png     the picture of each snapshot, for the contact sheet

The state comes last and replaces the one before at once, so that at any moment it is whole and all that it
refers to is there. Files of the same run have the same bytes. They are for the program itself, of the same
version: no format to exchange.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat import __version__
from weathercoat.errors import CorruptError, Note, ResumeError
from weathercoat.mesh.surface import Place, Surface
from weathercoat.output.folder import CHECKPOINT, CHECKPOINT_STATE

FORMAT = 1
SURFACE = f"{CHECKPOINT}/surface.npz"
_ABOUT = "about.json"

Arrays = Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class Checkpoint:
    """What a checkpoint holds: the arrays of the state, and what its run is and has recorded until then."""

    arrays: dict[str, NDArray[Any]]
    about: dict[str, Any]

    @property
    def step(self) -> int:
        """The step that was reached."""
        return int(self.arrays["step_count"][0])


def write_checkpoint(folder: Path, checkpoint: Checkpoint) -> None:
    """Replace the checkpoint in the folder of a run; raises OSError where that cannot be written."""
    about = {**checkpoint.about, "format": FORMAT, "weathercoat": __version__}
    _write_arrays(folder / CHECKPOINT_STATE, checkpoint.arrays, about)


def read_checkpoint(folder: Path) -> Checkpoint | None:
    """The checkpoint in the folder of a run, None where there is none.

    Raises CorruptError where it is broken and ResumeError where another version wrote it.
    """
    path = folder / CHECKPOINT_STATE
    if not path.is_file():
        return None
    arrays, about = _read_arrays(path)
    if about.get("format") != FORMAT or about.get("weathercoat") != __version__:
        raise ResumeError(
            f"weathercoat {about.get('weathercoat')} wrote its checkpoint, and this is {__version__}",
            file=str(folder),
        )
    return Checkpoint(arrays, about)


def write_surface(folder: Path, surface: Surface) -> None:
    """Keep a surface, but for its parts and materials, beside the checkpoint; raises OSError where that
    cannot be written.
    """
    arrays: dict[str, NDArray[Any]] = {
        "vertices": surface.vertices,
        "faces": surface.faces,
        "face_group": surface.face_group,
    }
    if surface.uv is not None:
        arrays["uv"] = surface.uv
    if surface.colors is not None:
        arrays["colors"] = surface.colors
    if surface.normals is not None:
        arrays["normals"] = surface.normals
    if surface.face_part is not None:
        arrays["face_part"] = surface.face_part
    if surface.place is not None:
        arrays["place_face"] = surface.place.face
        arrays["place_barycentric"] = surface.place.barycentric
    about = {
        "groups": surface.groups,
        "up": surface.up,
        "notes": [[note.code, note.count, note.message] for note in surface.notes],
        "name": surface.name,
        "format": surface.format,
    }
    _write_arrays(folder / SURFACE, arrays, about)


def read_kept_surface(folder: Path) -> Surface:
    """The surface beside the checkpoint; raises CorruptError where it is broken or missing."""
    path = folder / SURFACE
    arrays, about = _read_arrays(path)
    try:
        place = None
        if "place_face" in arrays:
            place = Place(arrays["place_face"], arrays["place_barycentric"])
        return Surface(
            vertices=arrays["vertices"],
            faces=arrays["faces"],
            face_group=arrays["face_group"],
            groups=tuple(about["groups"]),
            uv=arrays.get("uv"),
            colors=arrays.get("colors"),
            up=tuple(about["up"]),
            notes=tuple(Note(*note) for note in about["notes"]),
            place=place,
            normals=arrays.get("normals"),
            face_part=arrays.get("face_part"),
            name=about["name"],
            format=about["format"],
        )
    except (KeyError, TypeError, ValueError) as error:
        raise broken(path) from error


def broken(path: Path) -> CorruptError:
    """The error of a file that is no part of a checkpoint."""
    return CorruptError("the checkpoint is broken", file=str(path), remedy="begin anew with --overwrite")


def _write_arrays(path: Path, arrays: Arrays, about: Mapping[str, Any]) -> None:
    """Write a `.npz` that holds JSON as well, all of it or nothing."""
    path.parent.mkdir(exist_ok=True)
    aside = path.with_suffix(".new")
    with aside.open("wb") as stream:
        with zipfile.ZipFile(stream, "w") as archive:
            text = json.dumps(about, sort_keys=True, ensure_ascii=False)
            archive.writestr(zipfile.ZipInfo(_ABOUT), text.encode("utf-8", "surrogatepass"))
            for name, array in arrays.items():
                with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w") as member:
                    np.lib.format.write_array(member, np.ascontiguousarray(array), allow_pickle=False)
        stream.flush()
        os.fsync(stream.fileno())
    aside.replace(path)


def _read_arrays(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files if name != _ABOUT}
            about = json.loads(archive[_ABOUT].decode("utf-8", "surrogatepass"))
        if not isinstance(about, dict):
            raise ValueError("no object")
    except (OSError, EOFError, KeyError, ValueError, AttributeError, zipfile.BadZipFile) as error:
        raise broken(path) from error
    return arrays, about
