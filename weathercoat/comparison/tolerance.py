"""How far results may differ: by figure, in themselves or in the noise between seeds."""

from __future__ import annotations

import fnmatch
import math
from dataclasses import dataclass

LEVEL = 0.01


@dataclass(frozen=True)
class Rule:
    """What the figures whose names match `pattern` may differ by: the largest of what is given.

    absolute: in the figure's unit; relative: to the larger of the two values; sigmas: standard deviations
    between seeds.
    """

    pattern: str
    absolute: float | None = None
    relative: float | None = None
    sigmas: float | None = None


@dataclass(frozen=True)
class Tolerance:
    """What is let pass.

    level: how often runs that differ by chance alone may be called different. omitted: patterns of figures
    that are not judged. rules: for figures that are judged by a rule instead of by the level; the first one
    that matches counts. positions, distances: mean distances, in sizes; pictures: mean perceptual difference,
    0 to 1. Infinite ones are reported, and not judged: other seeds have other cracks.
    """

    level: float = LEVEL
    omitted: tuple[str, ...] = ()
    rules: tuple[Rule, ...] = ()
    positions: float = math.inf
    distances: float = math.inf
    pictures: float = math.inf

    def is_omitted(self, figure: str) -> bool:
        """Whether a figure is left out."""
        return any(fnmatch.fnmatchcase(figure, pattern) for pattern in self.omitted)

    def rule_of(self, figure: str) -> Rule | None:
        """The rule that a figure is judged by, if there is one."""
        return next((rule for rule in self.rules if fnmatch.fnmatchcase(figure, rule.pattern)), None)
