"""A run as a filter of the shell: the aged mesh goes to standard output, and nothing else is kept."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from weathercoat import unfinished

if TYPE_CHECKING:
    from weathercoat.config.load import Override
    from weathercoat.mesh.surface import Surface

FORMATS = ("glb", "ply", "obj")


def settings(kind: str) -> Iterator[Override]:
    """What comes on top of a config, so that it makes one mesh, in the format `kind`, and no more."""
    from weathercoat.config.load import Override

    needed = "ply" if kind == "obj" else kind
    for key, value in {
        "snapshots.steps": [],
        "snapshots.count": 1,
        "output.formats": [needed],
        "output.preview": False,
        "checkpoint.minutes": 0,
        "checkpoint.steps": 0,
        "checkpoint.keep": False,
    }.items():
        yield Override(key, value, "-o -")


def aged_mesh(run: Callable[[Path], dict[str, Any]], kind: str) -> bytes:
    """The file of the last snapshot of a run by `settings`; `run` writes it into the folder that it is given.

    As OBJ it is metal, paint and parts without paint, as groups with colours; as PLY without the latter.
    """
    from weathercoat.output.folder import SNAPSHOTS

    with _scratch() as scratch:
        folder = scratch / "run"
        report = run(folder)
        if kind != "obj":
            (path,) = (folder / SNAPSHOTS).glob(f"*.{kind}")
            return path.read_bytes()
        return _as_obj(folder, report)


def _as_obj(folder: Path, report: dict[str, Any]) -> bytes:
    from io import BytesIO

    from weathercoat.cli.writing import turned
    from weathercoat.mesh.read import read_surface
    from weathercoat.output.folder import UNTOUCHED, read_run
    from weathercoat.output.meshes import write_mesh
    from weathercoat.output.snapshots import hair, set_in

    _, (snapshot,) = read_run(folder)
    metal = set_in(snapshot, hair(snapshot))
    parts: list[tuple[str, Any, Any, Any]] = [
        ("metal", metal, snapshot.substrate_faces, snapshot.substrate_color),
        ("paint", snapshot.film_vertices, snapshot.film_faces, snapshot.film_color),
    ]
    if (folder / UNTOUCHED).is_file():
        other = read_surface(folder / UNTOUCHED)
        parts.append(("unpainted", other.vertices, other.faces, None))
    up = tuple(report["meshes"]["input"]["up"])
    stream = BytesIO()
    write_mesh(stream, turned(_joined(parts, up), "obj"), format="obj")
    return stream.getvalue()


def _joined(parts: list[tuple[str, Any, Any, Any]], up: tuple[float, float, float]) -> Surface:
    """One surface of parts: name, vertices (n, 3), faces (m, 3), and colours (n, 3) or None for white."""
    import numpy as np

    from weathercoat.mesh.surface import Surface

    starts = np.cumsum([0, *(len(vertices) for _, vertices, _, _ in parts)])
    colors = [np.ones((len(v), 3)) if color is None else color for _, v, _, color in parts]
    return Surface(
        np.concatenate([vertices for _, vertices, _, _ in parts]),
        np.concatenate([faces + start for (_, _, faces, _), start in zip(parts, starts, strict=False)]),
        np.repeat(np.arange(len(parts), dtype=np.int32), [len(faces) for _, _, faces, _ in parts]),
        groups=tuple(name for name, *_ in parts),
        colors=np.concatenate(colors),
        up=up,
    )


@contextmanager
def _scratch() -> Iterator[Path]:
    """A folder for temporary files, which goes however the process ends, but by a kill."""
    folder = Path(tempfile.mkdtemp(prefix="weathercoat-"))

    def give_up(told: list[str]) -> None:
        shutil.rmtree(folder, ignore_errors=True)

    unfinished.begin(give_up)
    try:
        yield folder
    finally:
        give_up([])
        unfinished.end(give_up)
