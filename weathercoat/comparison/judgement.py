"""Whether runs differ by more than chance: the verdict on two groups of runs, from their figures alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["same", "within noise", "different"]


@dataclass(frozen=True)
class Difference:
    """One figure of two groups of runs at one age.

    a, b: means over the runs of each group; difference: b - a. spread: standard deviation between seeds.
    allowed: how large the difference may be; is_beyond: whether it is larger, and has a say in the verdict.
    """

    figure: str
    age: float
    a: float
    b: float
    difference: float
    spread: float
    allowed: float
    is_beyond: bool

    @property
    def sigmas(self) -> float:
        """The difference in standard deviations between seeds; 0 where there is none of either."""
        if self.spread > 0.0:
            return self.difference / self.spread
        return 0.0 if self.difference == 0.0 else float("inf")


@dataclass(frozen=True)
class Judgement:
    """The verdict on two groups of runs, every figure that was compared, and in a sentence how they were."""

    verdict: Verdict
    differences: tuple[Difference, ...]
    method: str
