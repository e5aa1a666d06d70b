"""Damaged model files: each must be refused in one line, or come in as a whole surface that the file holds.

`python -m tests.fuzz files --count 1000 --seed 1` judges 1000 files in one process under limits; a file that
breaks the promise is written to `build/fuzz` and is judged again by `--replay PATH`, or by `--seed` and
`--only` with its number.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.fuzz import strict
from tests.fuzz.mutations import mutate
from tests.fuzz.seeds import Seed, foreign_seeds, make_seeds, real_seeds
from tests.fuzz.workers import Verdict, Worker, case_numbers
from weathercoat.errors import WeathercoatError
from weathercoat.mesh import topology
from weathercoat.mesh.read import read_surface
from weathercoat.mesh.surface import Surface

_EXIT_CODES = (3, 4, 5)
_REAL_SHARE = 0.25  # of the cases, where there are real files
_FOREIGN_SHARE = 0.01  # of what meshio reads, in a process of its own that takes half a second
Case = tuple[str, bytes]  # extension, content


@dataclass(frozen=True)
class Sources:
    """The seeds: those of every checkout, and real files where there are any."""

    own: list[Seed]
    real: list[Seed] = field(default_factory=list)
    foreign: list[Seed] = field(default_factory=foreign_seeds)


def make_case(sources: Sources, seed: int, number: int) -> Case:
    """The damaged file of this number; the same for the same sources and `seed`."""
    random = np.random.default_rng([seed, number])
    share = random.random()
    seeds = sources.own
    if share < _FOREIGN_SHARE:
        seeds = sources.foreign
    elif sources.real and share < _FOREIGN_SHARE + _REAL_SHARE:
        seeds = sources.real
    source = seeds[int(random.integers(len(seeds)))]
    return source.extension, mutate(source, random)


def judge(case: Case) -> Verdict:
    """Read a file and compare what comes with what was promised and with the strict parser."""
    extension, data = case
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"model.{extension}")
        path.write_bytes(data)
        try:
            surface = read_surface(path)
        except WeathercoatError as error:
            return _judge_refusal(error, extension, data)
    wrong = flaw_of_surface(surface) or _contradiction(surface, data)
    return Verdict("violation", wrong) if wrong else Verdict("accepted", surface.format)


def _judge_refusal(error: WeathercoatError, extension: str, data: bytes) -> Verdict:
    line = error.line()
    if "\n" in line or len(line) > 500 or not line.isprintable():
        return Verdict("violation", f"not one clear line: {line[:300]!r}")
    if error.exit_code not in _EXIT_CODES:
        return Verdict("violation", f"exit code {error.exit_code}: {line[:300]}")
    return Verdict("refused", error.code)


def flaw_of_surface(surface: Surface) -> str | None:
    """What is wrong with a surface that reading should have made whole; None for nothing."""
    vertices, faces = surface.vertices, surface.faces
    if not len(faces):
        return "no faces"
    values = [vertices, *(v for v in (surface.uv, surface.colors) if v is not None)]
    if not all(np.isfinite(v).all() for v in values):
        return "not finite"
    if not np.array_equal(np.unique(faces), np.arange(len(vertices))):
        return "an index is out of range, or a vertex unused"
    if len(surface.face_group) != len(faces) or not surface.face_group.max() < len(surface.groups):
        return "a group that does not exist"
    if not (surface.face_areas() > 0).all():
        return "a face without area"
    twin, crowded = topology.match_twins(vertices, faces)
    _, parent = topology.split_vertices(len(vertices), faces, twin)
    if len(crowded) or len(parent) > len(vertices):
        return "not manifold"
    orientation = topology.orient(vertices, faces, twin)
    return "not oriented" if orientation.cut or orientation.flipped.any() else None


def _contradiction(surface: Surface, data: bytes) -> str | None:
    """How the strict parser contradicts an accepted file; None where it does not."""
    try:
        content = strict.parse(data, surface.format)
    except strict.BrokenError as broken:
        return f"accepted as {surface.format}, though broken: {broken}"
    if content is None:
        return None
    notes = {note.code for note in surface.notes}
    for flaw in content.flaws:
        if not notes & set(flaw.notes):
            return f"accepted as {surface.format} without {' or '.join(flaw.notes)}, though {flaw.why}"
    if len(surface.faces) > content.triangles:
        return f"{len(surface.faces)} faces of a file with {content.triangles} triangles"
    if content.points is not None and not content.points.issuperset(map(tuple, surface.vertices.tolist())):
        return "a position that the file does not hold"
    return None


def run(
    sources: Sources,
    count: int | None,
    seed: int,
    found: Callable[[int, Case, Verdict], None],
    *,
    seconds: float | None = None,
) -> Counter[str]:
    """Judge `count` cases, or as many as `seconds` allow, and tell `found` of each violation; how often each
    outcome."""
    outcomes: Counter[str] = Counter()
    first = sources.own[0]
    with Worker(judge, (first.extension, first.data)) as worker:
        for number in case_numbers(count, seconds):
            case = make_case(sources, seed, number)
            verdict = worker.judge(case)
            outcomes[f"{verdict.kind} {verdict.what}" if verdict.kind != "violation" else "violation"] += 1
            if verdict.kind == "violation":
                found(number, case, verdict)
    return outcomes


def main(arguments: list[str]) -> int:
    """The command; returns the number of violations."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz files", description=__doc__)
    parser.add_argument("--count", type=int, help="files; without it, as many as --seconds allow")
    parser.add_argument("--seconds", type=float, help="stop after so long")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int, help="judge only the file of this number")
    parser.add_argument("--replay", type=Path, help="judge this file, as it is")
    parser.add_argument("--output", type=Path, default=Path("build/fuzz"), help="folder of what is found")
    options = parser.parse_args(arguments)
    if options.replay is not None:
        print(judge((options.replay.suffix[1:], options.replay.read_bytes())))
        return 0
    sources = Sources(make_seeds(), real_seeds())
    if options.only is not None:
        case = make_case(sources, options.seed, options.only)
        path = _write(options.output, options.seed, options.only, case)
        print(f"{path}: {judge(case)}")
        return 0
    if options.count is None and options.seconds is None:
        parser.error("give --count or --seconds")
    start = time.monotonic()

    def report(number: int, case: Case, verdict: Verdict) -> None:
        path = _write(options.output, options.seed, number, case)
        print(f"{path}: {verdict.what}", flush=True)

    outcomes = run(sources, options.count, options.seed, report, seconds=options.seconds)
    seeds = f"{len(sources.own)} + {len(sources.real)} seeds"
    print(f"{outcomes.total()} files from {seeds} in {time.monotonic() - start:.0f} s")
    for outcome, times in sorted(outcomes.items()):
        print(f"{times:8d} {outcome}")
    return outcomes["violation"]


def _write(folder: Path, seed: int, number: int, case: Case) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{seed}-{number}.{case[0]}"
    path.write_bytes(case[1])
    return path
