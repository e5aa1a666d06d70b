"""Levenberg-Marquardt with sparse factors, a line search, and the active set of the substrate.

Each island has a damping and an end of its own. The first steps are Gauss-Newton, whose matrix is never
negative; near the minimum all of the second derivative is used, where it is positive definite, so that
convergence becomes quadratic also for targets that cannot be met. Film that lies on the substrate and is
pressed against it only slides in that step. A step also follows the curve that lengths force on it, by its
second-order correction.

Sources: Marquardt, An algorithm for least-squares estimation of nonlinear parameters, 1963; Bertsekas,
Projected Newton methods for optimization problems with simple constraints, 1982; Transtrum and Sethna,
Improvements to the Levenberg-Marquardt algorithm for nonlinear least-squares minimization, 2012.
"""

from __future__ import annotations

import numpy as np

from weathercoat.deform.descending import (
    Flags,
    Guess,
    Solved,
    find_far,
    jump,
    lift,
    resting,
    search,
    slide,
    sum_islands,
)
from weathercoat.deform.energy import Elastic, bending_away, energy, gradient
from weathercoat.deform.factor import Factors
from weathercoat.deform.stiffness import Places, fill_blocks, find_places, hold_and_damp
from weathercoat.mesh.surface import Vectors

_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-9, 1e-14, 1e3  # of the mean of a diagonal block
_NEAR = 1e-2  # the gap below which all of the second derivative is tried


def minimise_by_newton(
    elastic: Elastic, positions: Vectors, guess: Guess, *, iterations: int, tolerance: float
) -> Solved:
    """A `Minimise`."""
    e = elastic
    lift(e, positions)
    count = len(e.scale)
    bounds = np.searchsorted(e.island, np.arange(count + 1))
    places = find_places(e)
    factors = Factors(places.pattern, bounds, 3)
    damping = np.full(count, _DAMPING)
    live, whole, gap = np.ones(count, np.bool_), np.zeros(count, np.bool_), np.full(count, np.inf)
    value = energy(e, positions)
    done = 0
    for done in range(1, iterations + 1):
        slope = gradient(e, positions)
        held = resting(e, positions, slope)
        slope = slide(e, slope, held)
        _factor(e, places, factors, positions, damping, held, live, whole)
        direction = slide(e, -factors.solve(np.flatnonzero(live), slope), held)
        gap = np.where(live, -0.5 * sum_islands(e, slope, direction) / e.scale, gap)
        if done == 1 and jump(e, positions, value, find_far(e, gap, value, live), guess):
            continue
        away = slide(e, bending_away(e, positions, direction), held)
        turn = slide(e, -factors.solve(np.flatnonzero(live), away), held)
        positions[:], value, share = search(e, positions, value, slope, direction, turn, live)
        live &= ~(gap <= tolerance)
        if not live.any():
            break
        damping = np.clip(
            np.where(share > 0.9, 0.2, np.where(share > 0.3, 1.0, 8.0)) * damping,
            _LEAST_DAMPING,
            _MOST_DAMPING,
        )
        whole = live & (gap < _NEAR) & (share > 0.0)
    return Solved(done, float(gap.max(initial=0.0)), int(live.sum()))


def _factor(
    elastic: Elastic,
    places: Places,
    factors: Factors,
    positions: Vectors,
    damping: Vectors,
    held: Flags,
    live: Flags,
    whole: Flags,
) -> None:
    """Factor the live islands, with all of the second derivative where that is wanted and positive; changes
    `whole` where it is not.
    """
    islands = np.flatnonzero(live)
    factors.factor(islands, _damped(elastic, places, positions, damping, held, whole))
    negative = [i for i in np.flatnonzero(whole & live).tolist() if not factors.is_positive(i)]
    if negative:
        whole[negative] = False
        factors.factor(np.array(negative), _damped(elastic, places, positions, damping, held, whole))


def _damped(
    elastic: Elastic, places: Places, positions: Vectors, damping: Vectors, held: Flags, whole: Flags
) -> Vectors:
    e = elastic
    blocks = fill_blocks(e, places, positions, whole)
    hold_and_damp(blocks, places.pattern.diagonal(), e.normals, held, damping[e.island])
    return blocks
