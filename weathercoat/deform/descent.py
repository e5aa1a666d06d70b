"""L-BFGS preconditioned with the factors of one Gauss-Newton matrix a step.

The matrix is that of the step's start, so it knows the topology as cracks have left it and where the film has
curled to; what has changed since, the last few gradients tell. Each island has its own memory and its own end.

Sources: Nocedal, Updating quasi-Newton matrices with limited storage, 1980; Liu et al., Quasi-Newton methods for
real-time simulation of hyperelastic materials, 2017.
"""

from __future__ import annotations

import numpy as np

from weathercoat.deform.descending import (
    FAR,
    Guess,
    Solved,
    jump,
    lift,
    resting,
    search,
    slide,
    sum_islands,
)
from weathercoat.deform.energy import Elastic, energy, gradient
from weathercoat.deform.factor import Factors
from weathercoat.deform.stiffness import fill_blocks, find_places, hold_and_damp
from weathercoat.mesh.surface import Vectors

_MEMORY = 6
_DAMPING = 1e-4


def minimise_by_descent(
    elastic: Elastic, positions: Vectors, guess: Guess, *, iterations: int, tolerance: float
) -> Solved:
    e = elastic
    lift(e, positions)
    count = len(e.scale)
    bounds = np.searchsorted(e.island, np.arange(count + 1))
    places = find_places(e)
    factors = Factors(places.pattern, bounds, 3)
    everything = np.arange(count)
    live, gap = np.ones(count, np.bool_), np.full(count, np.inf)
    value = energy(e, positions)
    refactor = True
    moves, turns, overs = [], [], []
    slope = gradient(e, positions)
    done = 0
    for done in range(1, iterations + 1):
        held = resting(e, positions, slope)
        if refactor:
            blocks = fill_blocks(e, places, positions, np.zeros(count, np.bool_))
            hold_and_damp(blocks, places.pattern.diagonal(), e.normals, held, np.full(len(e.free), _DAMPING))
            factors.factor(np.flatnonzero(live), blocks)
            refactor = False
        free_slope = slide(e, slope, held)
        q = free_slope.copy()
        alphas = []
        for m, t, o in zip(reversed(moves), reversed(turns), reversed(overs)):
            a = o * sum_islands(e, m, q)
            alphas.append(a)
            q -= a[e.island][:, None] * t
        q = factors.solve(np.flatnonzero(live), q)
        for (m, t, o), a in zip(zip(moves, turns, overs), reversed(alphas)):
            b = o * sum_islands(e, t, q)
            q += (a - b)[e.island][:, None] * m
        direction = slide(e, -q, held)
        gap = np.where(live, -0.5 * sum_islands(e, free_slope, direction) / e.scale, gap)
        if done == 1 and jump(e, positions, value, live & (gap > FAR), guess):
            refactor = True
            slope = gradient(e, positions)
            continue
        before = positions[e.free].copy()
        positions[:], value, share = search(e, positions, value, free_slope, direction, live)
        live &= gap > tolerance
        if not live.any():
            break
        new = gradient(e, positions)
        m, t = positions[e.free] - before, new - slope
        mt = sum_islands(e, m, t)
        good = live & (mt > 1e-12 * np.sqrt(sum_islands(e, m, m) * sum_islands(e, t, t))) & (mt > 0)
        o = np.where(good, 1.0 / np.where(good, mt, 1.0), 0.0)
        moves.append(m); turns.append(t); overs.append(o)
        if len(moves) > _MEMORY:
            del moves[0], turns[0], overs[0]
        slope = new
    return Solved(done, float(gap.max(initial=0.0)), int(live.sum()))
