"""Grades that inspectors use, computed from areas, and the limits at which a run may be told to stop.

The tables hold percent of the area. The ISO scales give nominal values, between which an inspector decides by
pictures; here a class reaches from half-way to the one below to half-way to the one above, in the logarithm
of the area, and class 0 ends as far below class 1 as class 2 begins above it. What comes of that is a
grade-equivalent computed from area, never an assessment by the standard.

Sources: ISO 4628-3:2016, table 1; ISO 4628-5:2016, tables 1 and 2; ASTM D610-08 (2019), table 1.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

RUST_NOMINAL = (0.05, 0.5, 1.0, 8.0, 40.0)  # Ri1 to Ri5, which is 40 to 50
FLAKING_NOMINAL = (0.1, 0.3, 1.0, 3.0, 15.0)  # classes 1 to 5
D610_MOST = (50.0, 33.0, 16.0, 10.0, 3.0, 1.0, 0.3, 0.1, 0.03, 0.01)  # the most of grades 1 to 10
FLAKE_MOST = (1.0, 3.0, 10.0, 30.0)  # the largest dimension [mm] of size classes 1 to 4


def _edges(nominal: Sequence[float]) -> tuple[float, ...]:
    """Where the classes from 1 begin."""
    between = [math.sqrt(low * high) for low, high in pairwise(nominal)]
    return (nominal[0] ** 2 / between[0], *between)


RUST_FROM = _edges(RUST_NOMINAL)
FLAKING_FROM = _edges(FLAKING_NOMINAL)


def rusting_degree(percent: float) -> str:
    """Equivalent of the degree of rusting of ISO 4628-3, Ri0 to Ri5, for a rusted area."""
    return f"Ri{sum(percent >= edge for edge in RUST_FROM)}"


def flaking_class(percent: float) -> int:
    """Equivalent of the class of quantity of ISO 4628-5, 0 to 5, for a flaked area."""
    return sum(percent >= edge for edge in FLAKING_FROM)


def flake_size_class(length: float) -> int:
    """Size class of ISO 4628-5, 0 to 5, for a largest dimension [mm]; 0 is no flaking at all."""
    return 0 if length <= 0.0 else 1 + sum(length > most for most in FLAKE_MOST)


def d610_grade(percent: float) -> int:
    """Equivalent of the rust grade of ASTM D610, 10 to 0, for a rusted area."""
    return sum(percent <= most for most in D610_MOST)


def d610_distribution(grade: int, areas: Sequence[float], area: float) -> str:
    """Kind of distribution of ASTM D610: S (spot), G (general), P (pinpoint) or H (hybrid), of rusted patches
    whose areas fall, on a surface of the area `area`; empty for grades 10 and 0, which have none.

    Specks are patches that each alone would leave the grade at 10. P: three quarters of the rusted area are
    specks. S: three quarters are the three largest patches that are none. G: neither has half. H: else.
    """
    if grade in (0, 10):
        return ""
    speck = D610_MOST[-1] / 100.0 * area
    total = math.fsum(areas)
    specks = math.fsum(patch for patch in areas if patch <= speck) / total
    spots = math.fsum(patch for patch in areas[:3] if patch > speck) / total
    if specks >= 0.75:
        return "P"
    if spots >= 0.75:
        return "S"
    return "G" if max(specks, spots) < 0.5 else "H"


@dataclass(frozen=True)
class Limit:
    """What has to be reached: a figure of severity, `rusted` or `flaked`, of `percent` of the area.

    is_beyond: whether it has to be exceeded, not only reached. group: of which material group or part; none
    for the whole. text: as it was asked for.
    """

    figure: str
    percent: float
    is_beyond: bool
    group: str | None
    text: str

    def is_reached(self, percent: float) -> bool:
        """Whether an area of so many percent is enough."""
        return percent > self.percent if self.is_beyond else percent >= self.percent


_FORM = re.compile(r"(rust|flaking|bare)(?:@([^=]+))?=(?:(Ri|D610:)?(\d+)|(\d+(?:\.\d+)?)\s*%)")


def parse_limits(text: str) -> tuple[Limit, ...]:
    """The limits of a text such as `rust=Ri3`, `rust=D610:5`, `flaking=4` or `bare@hull=12%`; commas join
    those that have to be reached all.

    Raises ValueError, which says what is wanted instead.
    """
    return tuple(_parse_limit(part.strip()) for part in text.split(","))


def _parse_limit(text: str) -> Limit:
    found = _FORM.fullmatch(text)
    if found is None:
        raise ValueError("must be a limit such as rust=Ri3, flaking=4 or bare=12%")
    what, group, scale, grade, percent = found.groups()
    figure = "rusted" if what == "rust" else "flaked"
    if percent is not None:
        if not 0.0 < float(percent) <= 100.0:
            raise ValueError("must be above 0 and at most 100 percent")
        return Limit(figure, float(percent), False, group, text)
    value = int(grade)
    if what == "rust" and scale == "D610:" and value <= 9:
        return Limit(figure, D610_MOST[value], True, group, text)
    if what == "rust" and scale == "Ri" and 1 <= value <= 5:
        return Limit(figure, RUST_FROM[value - 1], False, group, text)
    if what == "flaking" and scale is None and 1 <= value <= 5:
        return Limit(figure, FLAKING_FROM[value - 1], False, group, text)
    wanted = {"rust": "Ri1 to Ri5, D610:9 to D610:0 or percent", "flaking": "1 to 5 or percent"}
    raise ValueError(f"must be {what}= with {wanted.get(what, 'percent')}")
