"""How a deformation behaves over its steps: what is recorded of it, and the classes that it falls into."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from statistics import median

import numpy as np

from weathercoat.bench.reference import (
    ReferenceCase,
    bends_at,
    lengths_at,
    momentum_of,
    root_mean_square,
    turn_between,
    view_film,
)
from weathercoat.deform.deformation import DeformParameters, deform
from weathercoat.mesh.surface import Vectors
from weathercoat.sim.simulation import Simulation

CLASSES = ("converged", "slow", "oscillating", "flipped", "differs", "non-finite", "refused")
_ANGLE, _STRAIN = 0.05, 2e-3  # RMS errors of what has converged: relative to the targets, and of lengths
_FARTHEST = 1e3  # sizes; what is beyond is as good as infinite
_AT_REST, _RESTLESS = 1e-3, 1e-2  # largest movement in a step, in mean edges
_ONWARD = 0.5  # cosine between the movements of a step and of the one before, where both go the same way
_FOLDED = 0.5 * math.pi  # rad from its target: on the wrong side of flat, or folded through


@dataclass
class History:
    """What each step left: RMS angle error relative to the targets, RMS strain, the largest movement in mean
    edges, and the cosine between all movements and those of the step before; of the end, the largest angle
    error [rad] and whether every position is finite and near.
    """

    angle: list[float] = field(default_factory=list)
    strain: list[float] = field(default_factory=list)
    movement: list[float] = field(default_factory=list)
    onward: list[float] = field(default_factory=list)
    farthest_angle: float = 0.0
    is_finite: bool = True


def classify(history: History) -> str:
    """The class of a history.

    - non-finite: a position is not a number, or farther than 1,000 sizes away;
    - converged: the RMS angle error is at most 5 % of the RMS target, and the RMS strain at most 0.2 %;
    - flipped: a hinge is more than 90 degrees from its target, and the film is at rest: it stays there;
    - oscillating: in each step of the last third some vertex moves by a hundredth of an edge, and it gets
      nowhere: movements do not go on in the direction of those before, or the angle error rises;
    - slow: none of these, so on its way, or at rest short of the target.
    """
    h = history
    if not h.is_finite:
        return "non-finite"
    if h.angle[-1] <= _ANGLE and h.strain[-1] <= _STRAIN:
        return "converged"
    last = max(len(h.angle) // 3, 1)
    if h.farthest_angle > _FOLDED and max(h.movement[-last:]) < _AT_REST:
        return "flipped"
    before = h.angle[-last - 1] if len(h.angle) > last else math.inf
    gets_nowhere = median(h.onward[-last:]) < _ONWARD or h.angle[-1] > before
    if min(h.movement[-last:]) > _RESTLESS and gets_nowhere:
        return "oscillating"
    return "slow"


def follow(
    case: ReferenceCase, parameters: DeformParameters, shares: Sequence[float], start: Vectors | None = None
) -> History:
    """Deform a case from its start, or from other positions (n, 3), step by step, its targets growing to the
    given shares.
    """
    mesh = case.mesh_at(case.start if start is None else start)
    recorder, momentum = _Recorder(), momentum_of(case, parameters)
    for share in shares:
        case.aim(share)
        deform(mesh, case.constraints, parameters, case.age, momentum=momentum)
        at_share = replace(case, mesh=mesh, targets=share * case.targets)
        if not recorder.add(at_share, root_mean_square(case.targets)):
            break
    return recorder.history


def follow_run(simulation: Simulation, rest_steps: int) -> History:
    """Run a simulation without cracks to its end, and deform its film for so many steps more."""
    recorder = _Recorder()
    s = simulation
    for step in range(s.steps + rest_steps):
        if step < s.steps:
            s.step()
        else:
            deform(s.mesh, s.constraints, s.deform_parameters, s.age, momentum=s.momentum)
        case = view_film(s.mesh, s.constraints, s.deform_parameters, s.age)
        if len(case.targets) and not recorder.add(case, root_mean_square(case.targets)):
            break
    return recorder.history


class _Recorder:
    """Adds steps to a history."""

    def __init__(self) -> None:
        self.history = History()
        self._before: Vectors | None = None
        self._movement: Vectors | None = None

    def add(self, case: ReferenceCase, scale: float) -> bool:
        """Record where a case's film is now, angles relative to `scale`; returns whether all is finite and
        near.
        """
        history, positions = self.history, case.start
        if not (np.isfinite(positions).all() and np.abs(positions).max() < _FARTHEST):
            history.is_finite = False
            return False
        before = case.mesh.rest_positions[case.mesh.origin[: len(positions)]]
        movement = positions - (before if self._before is None else self._before)
        off = np.abs(turn_between(bends_at(case, positions), case.targets))
        history.angle.append(root_mean_square(off) / (scale or 1.0))
        history.strain.append(root_mean_square(strains(case, positions)))
        farthest = np.linalg.norm(movement, axis=1).max()
        history.movement.append(float(farthest / case.active.rest_length.mean()))
        history.onward.append(_cosine(movement, movement if self._movement is None else self._movement))
        history.farthest_angle = float(off.max())
        self._before, self._movement = positions.copy(), movement
        return True


def _cosine(movement: Vectors, other: Vectors) -> float:
    """The cosine between two movements of all vertices; 1 where one is none."""
    norms = float(np.linalg.norm(movement) * np.linalg.norm(other))
    return float(np.sum(movement * other)) / norms if norms > 0.0 else 1.0


def strains(case: ReferenceCase, positions: Vectors) -> Vectors:
    """The strain of the active edges that have a length, (l,)."""
    rest = case.active.rest_length
    return (lengths_at(case, positions) - rest)[rest > 0.0] / rest[rest > 0.0]
