"""The speed benchmark from its first case to its results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from weathercoat.bench.apart import measure_apart, measure_machine_apart
from weathercoat.bench.cases import PAPER_MACHINE, STAGES, find_paper_timing, make_cases
from weathercoat.bench.compare import compare_ends
from weathercoat.bench.growth import fit_exponent
from weathercoat.bench.peer import peer_version
from weathercoat.bench.roofline import floor_ms
from weathercoat.bench.situation import load_speed_config
from weathercoat.errors import CheckError, UsageError
from weathercoat.mesh.halfedge import make_half_edges
from weathercoat.mesh.read import read_surface
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.mesh.surface import Surface

FEWEST_FACES, FEWEST_STEPS = 100, 10
_LEAST_CPU_SHARE = 0.9  # of the wall time; with less, figures say more about other processes
_GROWTH_FROM = 10_000  # faces: below, what does not depend on them counts too much


def bench_speed(
    meshes: Sequence[Path],
    plates: Sequence[int],
    *,
    steps: int = 1000,
    repeats: int = 3,
    threads: int = 2,
    progress: Callable[[int, int], None] = lambda done, total: None,
    say: Callable[[str], None] = lambda line: None,
) -> dict[str, Any]:
    """The results for meshes as they are and for generated plates of so many faces, as plain values.

    steps: of a run; all times are given for 1,000 of them. threads: of the variants on several. progress:
    called with the steps done, of all cases and repeats, and their number. say: called with what is worth
    knowing, a line each. Errors: those of reading; UsageError for too few faces, steps, repeats or threads;
    CheckError where a case cannot be measured.
    """
    _check(meshes, plates, steps, repeats, threads)
    surfaces = [(path.stem, _read(path)) for path in meshes]
    cases = make_cases([(name, len(surface.faces)) for name, surface in surfaces], plates, steps, threads)
    ready = dict(surfaces)
    if peer_version() is None:
        say("pypbd is not installed (`pip install 'weathercoat[bench]'`), so no peer is timed")
    say("measuring the machine, and compiling where that has not been done yet")
    machine = measure_machine_apart()
    found: list[dict[str, Any]] = []
    total = len(cases) * repeats * steps
    meshes_of: dict[str, Path] = {}
    ends_of: dict[str, Path] = {}
    with TemporaryDirectory() as folder:
        for number, case in enumerate(cases):
            say(f"{case.label}: {case.faces:,} faces")
            mesh = meshes_of.get(case.variant_of) or Path(folder) / f"mesh_{number}.npz"
            end = Path(folder) / f"end_{number}.npz"
            if not case.variant_of:
                _save(ready.get(case.label) or make_random_sheet(case.faces), mesh)
            tell = partial(_report, progress, number * repeats * steps, total)
            figures = measure_apart(case, mesh, end, repeats, tell)
            for deviation in figures["deviations"]:
                say(f"{case.label}: not the benchmark's situation: {deviation}")
            share = figures["cpu_seconds"] / figures["seconds"]["total"]
            if share < _LEAST_CPU_SHARE:
                say(f"{case.label}: the machine was busy: {share:.0%} of the time was this process's own")
            apart = compare_ends(end, ends_of[case.variant_of]) if case.variant_of else None
            found.append({**_completed(figures, machine), "apart": apart})
            meshes_of[case.label], ends_of[case.label] = mesh, end
    return {
        "schema": 1,
        "machine": machine,
        "paper_machine": PAPER_MACHINE,
        "config": load_speed_config(steps).as_dict(),
        "cases": found,
        "growth": _growth(found),
    }


def _read(path: Path) -> Surface:
    """The mesh as it is; CheckError where it is no oriented manifold."""
    surface = read_surface(path)
    try:
        make_half_edges(surface.vertices, surface.faces)
    except ValueError as error:
        raise CheckError(f"the mesh is no manifold: {error}", file=str(path), remedy="remesh it") from error
    return surface


def _check(meshes: Sequence[Path], plates: Sequence[int], steps: int, repeats: int, threads: int) -> None:
    if not meshes and not plates:
        raise UsageError(
            "there is nothing to measure", remedy="give meshes, or numbers of faces with --faces"
        )
    for faces in plates:
        if faces < FEWEST_FACES:
            raise UsageError(f"--faces: a plate has at least {FEWEST_FACES} faces, not {faces}")
    if steps < FEWEST_STEPS:
        raise UsageError(f"--steps: a run has at least {FEWEST_STEPS} steps, not {steps}")
    if repeats < 1:
        raise UsageError(f"--repeats: at least 1, not {repeats}")
    if threads < 1:
        raise UsageError(f"--threads: at least 1, not {threads}")
    names = [path.stem for path in meshes]
    if len(set(names)) < len(names):
        raise UsageError("two meshes have the same name", remedy="rename one")


def _report(progress: Callable[[int, int], None], before: int, total: int, done: int) -> None:
    progress(before + done, total)


def _save(surface: Surface, path: Path) -> None:
    np.savez(path, vertices=surface.vertices, faces=surface.faces)


def _completed(figures: dict[str, Any], machine: dict[str, Any]) -> dict[str, Any]:
    """The figures of a case with the paper's beside them, and with what the machine allows at most."""
    is_variant = bool(figures["variant_of"])
    paper = None if is_variant else find_paper_timing(figures["label"], figures["faces"])
    sweep = figures["sweep"]
    floor = floor_ms(sweep["flops"], sweep["bytes"], machine["arithmetic_peak"], machine["copy_bandwidth"])
    return {
        **figures,
        "sweep": {**sweep, "floor_ms": floor},
        "paper": None
        if paper is None
        else {
            "name": paper.name,
            "faces": paper.faces,
            "seconds": paper.stage_seconds(),
            "times_faster": paper.seconds / figures["seconds"]["total"],
        },
    }


def _growth(cases: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The exponent of each stage over the plates, from 10,000 faces on where there are several."""
    plates = [case for case in cases if case["label"].startswith("plate ") and not case["variant_of"]]
    large = [case for case in plates if case["faces"] >= _GROWTH_FROM]
    fitted = large if len(large) >= 2 else plates
    faces = [case["faces"] for case in fitted]
    stages = [*(stage for stage in STAGES if stage != "other"), "total"]
    exponents = {name: fit_exponent(faces, [case["seconds"][name] for case in fitted]) for name in stages}
    exponents["sweep"] = fit_exponent(faces, [case["sweep"]["ms"] for case in fitted])
    return {"faces": faces, "exponents": exponents}
