"""The figures of a run over its age, in sizes and shares, so that runs of any scale can be compared."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from weathercoat.comparison.patterns import PATTERN_FIGURES, measure_pattern
from weathercoat.errors import AccessError, CorruptError
from weathercoat.output.folder import REPORT, SNAPSHOTS, snapshot_stem
from weathercoat.output.snapshots import read_snapshot_ply

# Figures of `run.json` by their names here: the keys that lead to them, and the power of the size that they
# are divided by.
_REPORTED = {
    "separated_share": (("separated_share",), 0),
    "lost_share": (("lost_share",), 0),
    "affected_share": (("affected_share",), 0),
    "crack_length": (("crack_length",), 1),
    "outline_length": (("outline_length",), 1),
    "flakes": (("flakes", "count"), 0),
    "flake_median_area": (("flakes", "median_area"), 2),
    "flake_largest_area": (("flakes", "largest_area"), 2),
    "film_rust": (("film_rust",), 0),
    "substrate_rust": (("substrate_rust",), 0),
    "dust": (("dust",), 0),
}
FIGURES = (*_REPORTED, *PATTERN_FIGURES)


@dataclass(frozen=True)
class RunFigures:
    """The figures of a run: for each its values at the ages of the snapshots, in their order.

    Lengths are in sizes, the square root of the film's area at the start, and areas in squares of them.
    faces: of the film at the start; None where that is not known.
    """

    name: str
    ages: tuple[float, ...]
    figures: Mapping[str, tuple[float, ...]]
    faces: int | None = None


def measure_run(folder: Path | str) -> RunFigures:
    """The figures of the finished run in a folder: those of `run.json`, and where it wrote PLY snapshots
    those of their crack patterns, as `patterns.measure_pattern` has them.

    Raises AccessError where there is no such run, CorruptError where its files are none of a run.
    """
    folder = Path(folder)
    report = read_report(folder)
    try:
        rows = report["snapshots"]
        size = float(report["meshes"]["film"]["area"]) ** 0.5
        faces = int(report["meshes"]["film"]["faces"])
        ages = tuple(float(row["age"]) for row in rows)
        figures = {
            name: tuple(float(_at(row, keys)) / size**power for row in rows)
            for name, (keys, power) in _REPORTED.items()
        }
        files = list(_snapshot_files(folder, report))
    except (KeyError, TypeError, ValueError, ZeroDivisionError) as error:
        what = f"{REPORT} lacks figures of a run ({error})"
        raise CorruptError(what, file=str(folder), remedy="run again") from error
    if all(file.exists() for file in files):
        patterns = [measure_pattern(read_snapshot_ply(file)) for file in files]
        figures |= {name: tuple(pattern[name] for pattern in patterns) for name in PATTERN_FIGURES}
    return RunFigures(folder.name, ages, figures, faces)


def read_report(folder: Path) -> dict[str, Any]:
    """The content of a run's report. Raises AccessError and CorruptError."""
    path = folder / REPORT
    try:
        content = json.loads(path.read_bytes())
    except OSError as error:
        reason = f"{REPORT}: {error.strerror or error}"
        raise AccessError(reason, file=str(folder), remedy="give the folder of a finished run") from error
    except ValueError as error:
        raise CorruptError("is no JSON", file=str(path), remedy="run again") from error
    if not isinstance(content, dict):
        raise CorruptError("is no report of a run", file=str(path), remedy="run again")
    return content


def _snapshot_files(folder: Path, report: Mapping[str, Any]) -> Iterator[Path]:
    steps = int(report["config"]["ageing"]["steps"])
    for row in report["snapshots"]:
        yield folder / SNAPSHOTS / f"{snapshot_stem(int(row['step']), steps)}.ply"


def _at(row: Mapping[str, Any], keys: tuple[str, ...]) -> Any:
    value: Any = row
    for key in keys:
        value = value[key]
    return value
