"""What the benchmark runs, and what the paper's authors measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

STAGES = ("failure", "deformation", "mesh", "stains", "other")  # the rows of the paper's table
FACES = (3_000, 10_000, 100_000, 300_000, 1_000_000)
PEER_FACES = (10_000, 100_000)  # plates on which the peer is timed too
THREADED_FACES = (100_000,)  # plates that are run on several threads too
SLEEPING_FACES = (10_000,)  # plates that are run with film at rest asleep too
SLEEP_TOLERANCE = 1e-5  # sizes a step on 10,000 faces: a 1,500th of an edge
_MOST_WORK = 30_000_000  # faces times steps of a run that is timed whole
_SAMPLED_WORK = 2_000_000  # faces times timed steps in each tenth of a longer one
_FEWEST_SAMPLED = 5


@dataclass(frozen=True)
class PaperTiming:
    """A column of the paper's table: seconds for 1,000 steps, and the percentage of each stage."""

    name: str
    stem: str  # in the file name of the public prototype's mesh
    faces: int
    seconds: float
    percent: tuple[float, ...]

    def stage_seconds(self) -> dict[str, float]:
        """Seconds by stage and in total."""
        by_stage = {s: self.seconds * p / 100 for s, p in zip(STAGES, self.percent, strict=True)}
        return {**by_stage, "total": self.seconds}


# The number of sweeps is not given. The public prototype's flat plate has 3,012 faces and its curved one
# 3,005: the same counts with the labels exchanged.
PAPER_MACHINE = "Intel Core i9-10980, 32 GB, Unity"
PAPER = (
    PaperTiming("flat plate", "plane", 3005, 15.4, (46.7, 33.7, 13.3, 4.7, 1.6)),
    PaperTiming("curved plate", "curve", 3012, 16.7, (44.4, 36.8, 12.4, 4.8, 1.6)),
    PaperTiming("Stanford bunny", "bunny", 10_000, 65.8, (45.4, 36.7, 11.7, 4.6, 1.6)),
)


@dataclass(frozen=True)
class Case:
    """A run to time.

    sample: the number of steps that are timed in each tenth of the run, 0 for all. with_peer: whether the
    peer is timed on the state at the end. overrides: `key=value` of the config in which it differs from the
    benchmark's. variant_of: the label of the case whose mesh it has and with whose end its own is compared,
    empty for none.
    """

    label: str
    faces: int
    steps: int
    sample: int = 0
    with_peer: bool = False
    threads: int = 1
    overrides: tuple[str, ...] = ()
    variant_of: str = ""


def make_cases(
    meshes: Sequence[tuple[str, int]], plates: Sequence[int], steps: int, threads: int
) -> list[Case]:
    """The cases for meshes, given as (name, number of faces), and for generated plates of so many faces, each
    followed by its variants.

    threads: of the variant on several, where more than 1.
    """
    cases = [Case(name, faces, steps, sample_size(faces, steps)) for name, faces in meshes]
    for faces in plates:
        plate = Case(f"plate {faces:,}", faces, steps, sample_size(faces, steps))
        cases.append(replace(plate, with_peer=faces in PEER_FACES))
        if faces in THREADED_FACES and threads > 1:
            cases.append(_vary(plate, f"{threads} threads", threads=threads))
        if faces in SLEEPING_FACES:
            asleep = f"deformation.sleep_tolerance={SLEEP_TOLERANCE!r}"
            cases.append(_vary(plate, "asleep at rest", overrides=(asleep,)))
    return cases


def _vary(case: Case, how: str, **changes: Any) -> Case:
    return replace(case, label=f"{case.label}, {how}", variant_of=case.label, **changes)


def sample_size(faces: int, steps: int) -> int:
    """The steps to time in each tenth of a run, 0 where all of them are."""
    if faces * steps <= _MOST_WORK:
        return 0
    return max(_FEWEST_SAMPLED, _SAMPLED_WORK // faces)


def find_paper_timing(name: str, faces: int) -> PaperTiming | None:
    """The paper's timing of that mesh, or of one with as many faces within 1 %."""
    alike = [timing for timing in PAPER if abs(faces / timing.faces - 1) <= 0.01]
    of_that_name = [timing for timing in alike if timing.stem in name.lower()]
    return next(iter(of_that_name + alike), None)
