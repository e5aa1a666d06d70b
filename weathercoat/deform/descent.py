"""L-BFGS on islands of film, preconditioned with the factors of one matrix a step.

The matrix is the Gauss-Newton one at the step's start, so it knows the topology as cracks have left it and
how far the film has curled; what has changed since, the last few gradients tell. Each island has a memory,
a step length and an end of its own.

Sources: Nocedal, Updating quasi-Newton matrices with limited storage, 1980; Liu et al., Quasi-Newton
methods for real-time simulation of hyperelastic materials, 2017.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

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

_REMEMBERED = 12  # pairs; 6 need an eighth more iterations
_DAMPING = 1e-9  # of the mean of a diagonal block
_LEAST_COSINE = 1e-9  # between a move and the change of the gradient over it, to remember them


class Pair(NamedTuple):
    """A move (v, 3), the change of the gradient over it (v, 3), and 1 over their product by island (k,), 0
    where they tell nothing.
    """

    move: Vectors
    change: Vectors
    over: Vectors


def minimise_by_descent(
    elastic: Elastic, positions: Vectors, guess: Guess, *, iterations: int, tolerance: float
) -> Solved:
    """A `Minimise`."""
    e = elastic
    lift(e, positions)
    count = len(e.scale)
    places = find_places(e)
    factors = Factors(places.pattern, np.searchsorted(e.island, np.arange(count + 1)), 3)
    pairs: deque[Pair] = deque(maxlen=_REMEMBERED)
    live, gap = np.ones(count, np.bool_), np.full(count, np.inf)
    value, slope = energy(e, positions), gradient(e, positions)
    _prepare(e, places, factors, positions, slope, live)
    begun_anew = np.zeros(count, np.bool_)
    done = 0
    for done in range(1, iterations + 1):
        held = resting(e, positions, slope)
        free_slope = slide(e, slope, held)
        direction = slide(e, _downhill(e, factors, pairs, free_slope, live), held)
        gap = np.where(live, -0.5 * sum_islands(e, free_slope, direction) / e.scale, gap)
        if done == 1 and jump(e, positions, value, find_far(e, gap, value, live), guess):
            slope = gradient(e, positions)
            _prepare(e, places, factors, positions, slope, live)
            continue
        before, slope_before = positions[e.free], slope
        turn = np.zeros_like(direction)
        if not pairs:  # the matrix is that of here
            away = slide(e, bending_away(e, positions, direction), held)
            turn = slide(e, -factors.solve(np.flatnonzero(live), away), held)
        positions[:], value, share = search(e, positions, value, free_slope, direction, turn, live)
        live &= ~(gap <= tolerance)
        if not live.any():
            break
        slope = gradient(e, positions)
        stuck = live & (share == 0.0)
        if stuck.any():  # what is remembered misleads: begin anew from here
            live &= ~(stuck & begun_anew)
            pairs = deque([_forget(pair, stuck) for pair in pairs], _REMEMBERED)
            _prepare(e, places, factors, positions, slope, live & stuck)
        begun_anew = stuck
        pairs.append(_forget(_pair(e, positions[e.free] - before, slope - slope_before), stuck))
    return Solved(done, float(gap.max(initial=0.0)), int(live.sum()))


def _prepare(
    elastic: Elastic, places: Places, factors: Factors, positions: Vectors, slope: Vectors, islands: Flags
) -> None:
    """Factor the matrix of islands where they are."""
    e = elastic
    blocks = fill_blocks(e, places, positions, np.zeros(len(e.scale), np.bool_))
    damping = np.full(len(e.free), _DAMPING)
    hold_and_damp(blocks, places.pattern.diagonal(), e.normals, resting(e, positions, slope), damping)
    factors.factor(np.flatnonzero(islands), blocks)


def _downhill(elastic: Elastic, factors: Factors, pairs: deque[Pair], slope: Vectors, live: Flags) -> Vectors:
    """The direction (v, 3) against the gradient by the factors and what is remembered: the two loops."""
    e = elastic
    left = slope
    shares = []
    for pair in reversed(pairs):
        share = pair.over * sum_islands(e, pair.move, left)
        left = left - share[e.island][:, None] * pair.change
        shares.append(share)
    out = factors.solve(np.flatnonzero(live), left)
    for pair, share in zip(pairs, reversed(shares), strict=True):
        back = pair.over * sum_islands(e, pair.change, out)
        out += (share - back)[e.island][:, None] * pair.move
    return -out


def _pair(elastic: Elastic, move: Vectors, change: Vectors) -> Pair:
    e = elastic
    product = sum_islands(e, move, change)
    size = np.sqrt(sum_islands(e, move, move) * sum_islands(e, change, change))
    tells = product > _LEAST_COSINE * size
    return Pair(move, change, np.where(tells, 1.0 / np.where(tells, product, 1.0), 0.0))


def _forget(pair: Pair, islands: Flags) -> Pair:
    """The pair without what it tells of some islands."""
    return pair._replace(over=np.where(islands, 0.0, pair.over))
