"""Figures of snapshots and meshes, and the two JSON files of a run: the report and its timing.

Areas and lengths are those of the mesh at the start (at rest), in units of the model; shares are of the
film's area at the start. Everything that depends on the machine's speed is in the timing, so that the report
of the same input and seed has the same bytes.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from weathercoat import __version__
from weathercoat.errors import AccessError, CheckError, Note
from weathercoat.lock import LOCK
from weathercoat.mesh.surface import Indices, Surface, Vectors, face_areas
from weathercoat.output.cracks import find_openings
from weathercoat.output.folder import REPORT, TIMING
from weathercoat.output.severity import measure_severity
from weathercoat.sim.snapshot import Snapshot
from weathercoat.target import target

REPORT_VERSION = 1
LIBRARIES = ("numpy", "scipy", "numba", "qdldl")
LARGEST_FLAKES = 20
SIGNIFICANT_DIGITS = 12

# The rows of the paper's table of times, by the name of the stage that fills them.
PAPER_ROWS = {
    "failure": "failure tests and constraint set-up",
    "deformation": "deformation",
    "mesh": "mesh generation",
    "stains": "stains and colours",
    "other": "other",
}


def measure_snapshot(
    snapshot: Snapshot,
    *,
    flake_areas: ArrayLike = (),
    strain: float = 0.0,
    residual: float = 0.0,
    energy: float = 0.0,
    imbalance: float = 0.0,
    millimetres: float | None = None,
) -> dict[str, Any]:
    """The figures of one snapshot.

    flake_areas: rest area of every flake that has fallen so far; the next four: how far the film is from its
    constraints and from balance, as the simulation gives them; millimetres: the length of a unit of the
    model, where it is known. The result:

    - separated_share: area of the film that has let go and not fallen, a face counting by its separated
    corners; - lost_area, lost_share: area of the film that has fallen; affected_share: the sum of both
    shares; - crack_length: length of the edges along which two faces of the film have come apart; a single
    broken edge whose ends still hold together is not open and does not count. outline_length: length of the
    edges between film and lost film; - flakes: count, total, median and largest area, and the areas of the
    largest (at most 20); - film_rust, substrate_rust, dust: means by area, over the film that is left and
    over the whole metal; - strain, residual, energy, imbalance; - severity, see `severity.measure_severity`.
    """
    areas = face_areas(snapshot.substrate_vertices, snapshot.substrate_faces)
    total = float(areas.sum())
    film_areas = areas[snapshot.film_face]
    has_fallen = np.ones(len(areas), np.bool_)
    has_fallen[snapshot.film_face] = False
    lost = float(areas[has_fallen].sum())
    separated = float((film_areas * snapshot.separated[snapshot.film_faces].mean(axis=1)).sum())
    openings = find_openings(snapshot)
    lengths = openings.lengths(snapshot)
    flakes = np.sort(np.asarray(flake_areas, np.float64).ravel())[::-1]
    return {
        "step": int(snapshot.step),
        "age": float(snapshot.age),
        "film_faces": len(snapshot.film_faces),
        "film_vertices": len(snapshot.film_vertices),
        "separated_share": separated / total,
        "lost_area": lost,
        "lost_share": lost / total,
        "affected_share": (separated + lost) / total,
        "crack_length": 0.5 * float(lengths[openings.apart].sum()),
        "outline_length": float(lengths[openings.at_loss].sum()),
        "flakes": {
            "count": len(flakes),
            "area": float(flakes.sum()),
            "median_area": float(np.median(flakes)) if len(flakes) else 0.0,
            "largest_area": float(flakes[0]) if len(flakes) else 0.0,
            "largest_areas": flakes[:LARGEST_FLAKES].tolist(),
        },
        "film_rust": _mean(snapshot.film_rust, snapshot.film_faces, film_areas),
        "substrate_rust": _mean(snapshot.substrate_rust, snapshot.substrate_faces, areas),
        "dust": _mean(snapshot.dust, snapshot.substrate_faces, areas),
        "strain": float(strain),
        "residual": float(residual),
        "energy": float(energy),
        "imbalance": float(imbalance),
        "severity": measure_severity(snapshot, openings, millimetres),
    }


def measure_surface(surface: Surface) -> dict[str, Any]:
    """Counts, area, diagonal and the statistics of edges and angles of a mesh."""
    faces = surface.faces.astype(np.int64)
    ahead = np.roll(faces, -1, axis=1)
    count = len(surface.vertices)
    keys = np.sort((np.minimum(faces, ahead) * count + np.maximum(faces, ahead)).ravel())
    first = np.flatnonzero(np.diff(keys, prepend=-1))
    uses = np.diff(first, append=len(keys))
    edges = keys[first]
    length = np.linalg.norm(surface.vertices[edges % count] - surface.vertices[edges // count], axis=1)
    smallest = _smallest_angles(surface.vertices, surface.faces)
    return {
        "faces": len(faces),
        "vertices": int(np.count_nonzero(np.bincount(faces.ravel(), minlength=count))),
        "area": surface.area(),
        "diagonal": surface.diagonal(),
        "edges": {
            "count": len(edges),
            "mean_length": float(length.mean()),
            "length_variation": float(length.std() / length.mean()) if length.any() else 0.0,
            "boundary_length": float(length[uses == 1].sum()),
        },
        "smallest_angle": {"median": float(np.median(smallest)), "worst": float(smallest.min())},
        "groups": [name for i, name in enumerate(surface.groups) if np.any(surface.face_group == i)],
        "up": [float(part) for part in surface.up],
    }


def make_report(
    *,
    config: Mapping[str, Any],
    seed: int,
    inputs: Mapping[str, str],
    meshes: Mapping[str, Mapping[str, Any]],
    notes: Iterable[Note],
    quality: Mapping[str, Any] | None,
    stopped: str,
    solver: Mapping[str, Any],
    snapshots: Sequence[Mapping[str, Any]],
    files: Mapping[str, str],
) -> dict[str, Any]:
    """The content of `run.json`.

    config: the resolved values; inputs: SHA-256 by file name, without folders, which differ from machine to
    machine; meshes: the statistics of each mesh by its name; notes: repairs and losses; quality: what
    a quality that was asked for has set, None without one; stopped: why the run ended; solver: what it did
    in all steps; snapshots: the figures of each; files: the `manifest` of all others. Figures are rounded to
    12 digits, the config is not.
    """
    return {
        "report_version": REPORT_VERSION,
        "config": dict(config),
        "seed": seed,
        "versions": versions(),
        "model": next(iter(inputs)),
        "inputs": {name: {"sha256": digest} for name, digest in inputs.items()},
        "meshes": rounded(meshes),
        "notes": [{"code": note.code, "count": note.count, "message": note.message} for note in notes],
        "quality": rounded(quality),
        "stopped": stopped,
        "solver": rounded(solver),
        "snapshots": rounded(snapshots),
        "files": dict(files),
    }


def manifest(folder: Path) -> dict[str, str]:
    """SHA-256 of every file of a run but its reports, by its path in the folder with slashes, sorted.

    Raises AccessError where one cannot be read.
    """
    apart = {folder / name for name in (REPORT, TIMING, LOCK)}
    files = (path for path in folder.rglob("*") if path.is_file() and path not in apart)
    digests = {path.relative_to(folder).as_posix(): sha256(path) for path in files}
    return dict(sorted(digests.items()))


def make_timing(simulation: Mapping[str, float], around: Mapping[str, float]) -> dict[str, Any]:
    """The content of `timing.json`.

    simulation: seconds of the steps by the keys of `PAPER_ROWS`; around: seconds of what comes before and
    after them, by any name. The paper's table gives shares of the steps alone, and so does this one. KeyError
    for an unknown row.
    """
    unknown = sorted(set(simulation) - set(PAPER_ROWS))
    if unknown:
        raise KeyError(f"no row of the table: {', '.join(unknown)}")
    total = float(sum(simulation.values()))
    rows = []
    for key, title in PAPER_ROWS.items():
        seconds = float(simulation.get(key, 0.0))
        rows.append(
            {"row": title, "seconds": seconds, "percent": 100.0 * seconds / total if total > 0 else 0.0}
        )
    return {
        "simulation": {"seconds": total, "rows": rows},
        "around": {name: float(seconds) for name, seconds in around.items()},
        "seconds": total + float(sum(around.values())),
    }


@cache
def versions() -> dict[str, str]:
    """Versions of Python, of the libraries that figures depend on, and of weathercoat; and the target, where
    one is pinned.
    """
    found = {name: metadata.version(name) for name in LIBRARIES}
    pinned = target()
    about = {"target": pinned} if pinned else {}
    return {"python": platform.python_version(), "weathercoat": __version__, **found, **about}


def sha256(content: bytes | Path) -> str:
    """SHA-256 of bytes or of a file, in hexadecimal. Raises AccessError where the file cannot be read."""
    if isinstance(content, bytes):
        return hashlib.sha256(content).hexdigest()
    try:
        with content.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise AccessError(error.strerror or "cannot be read", file=str(content)) from error


def write_json(path: Path | str, content: Mapping[str, Any]) -> None:
    """Write JSON with sorted keys, lists of plain values on one line, and floats in the fewest digits that
    are exact.

    Raises CheckError for a value that is not finite or that JSON has no form for, naming its key, before
    anything is written; OSError where the file cannot be written.
    """
    Path(path).write_bytes(format_json(content, Path(path).name).encode("utf-8", "backslashreplace"))


def format_json(content: Mapping[str, Any], file: str = "standard output") -> str:
    """The text of `write_json`, for whatever it is written to."""
    return _text(_plain(content, "", file), "\n") + "\n"


def _text(value: Any, line: str) -> str:
    """JSON of a value in Python's own types, where `line` breaks to its indentation."""
    inner = line + "  "
    if isinstance(value, dict) and value:
        items = (f"{_text(key, inner)}: {_text(value[key], inner)}" for key in sorted(value))
        return "{" + inner + f",{inner}".join(items) + line + "}"
    if isinstance(value, list) and any(isinstance(item, (dict, list)) for item in value):
        return "[" + inner + f",{inner}".join(_text(item, inner) for item in value) + line + "]"
    return json.dumps(value, ensure_ascii=False)


def _plain(value: Any, key: str, file: str) -> Any:
    """The value in Python's own types; CheckError where that cannot be."""
    if isinstance(value, Mapping):
        return {
            str(name): _plain(item, f"{key}.{name}" if key else str(name), file)
            for name, item in value.items()
        }
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(item, f"{key}[{i}]", file) for i, item in enumerate(value)]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        if not np.isfinite(value):
            raise CheckError(f"{key} is {value}", file=file)
        return float(value)
    if value is None or isinstance(value, str):
        return value
    raise CheckError(f"{key} is a {type(value).__name__}, which JSON has no form for", file=file)


def rounded(value: Any) -> Any:
    """Figures to 12 significant digits: those beyond are the round-off of sums, whose order differs from CPU
    to CPU."""
    if isinstance(value, Mapping):
        return {name: rounded(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(item) for item in value]
    if isinstance(value, float):
        return float(f"{value:.{SIGNIFICANT_DIGITS}g}")
    return value


def _mean(values: Vectors, faces: Indices, areas: Vectors) -> float:
    """Mean of a linear function on triangles, given at their corners; 0 where there are none."""
    total = float(areas.sum())
    return float((values[faces].mean(axis=1) * areas).sum()) / total if total > 0 else 0.0


def _smallest_angles(vertices: Vectors, faces: Indices) -> NDArray[np.float64]:
    """Smallest angle of each face, in degrees, (m,); 0 where a face has no area."""
    corner = vertices[faces]
    angles = np.empty(faces.shape)
    for i in range(3):
        a = corner[:, (i + 1) % 3] - corner[:, i]
        b = corner[:, (i + 2) % 3] - corner[:, i]
        angles[:, i] = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
    return np.degrees(angles.min(axis=1))
