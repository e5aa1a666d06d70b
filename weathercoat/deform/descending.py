"""What descent and Newton share: the substrate's bounds, and a step length for each island."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from weathercoat.deform.energy import Elastic, energy, sum_by_island
from weathercoat.mesh.surface import Vectors

_ON_PLANE = 1e-9  # film this close to the substrate lies on it [sizes]
_ENOUGH = 1e-4  # least share of the decrease that the slope promises
_SHORTER = 0.4
_TRIALS = 14

_FAR, _FLAT = 0.1, 0.9  # a gap, or an energy over that at rest, above which a guess is tried

Flags = NDArray[np.bool_]
Guess = Callable[[Flags], Vectors]
"""Positions (n, 3) with the free vertices of some islands (k,) where a guess puts them."""


class Solved(NamedTuple):
    """How a solver ended: iterations, of the island that took most, or sweeps; gap, the largest estimate of
    how far an island's energy is above its minimum, in units of its energy at rest, None where a solver
    knows none; unfinished, the islands whose gap is above the tolerance.
    """

    iterations: int
    gap: float | None
    unfinished: int


class Minimise(Protocol):
    """A solver that brings free vertices to a minimum of the energy, down to a gap (see `Solved`) or until
    its iterations are spent; changes positions (n, 3). No step raises an island's energy.
    """

    def __call__(
        self, elastic: Elastic, positions: Vectors, guess: Guess, *, iterations: int, tolerance: float
    ) -> Solved: ...


def lift(elastic: Elastic, positions: Vectors) -> None:
    """Put each free vertex below its plane back on it; changes positions (n, 3)."""
    e = elastic
    depth = _dot(e.normals, positions[e.free]) - e.offsets
    below = depth < 0.0
    positions[e.free[below]] -= depth[below, None] * e.normals[below]


def resting(elastic: Elastic, positions: Vectors, slope: Vectors) -> Flags:
    """The free vertices (v,) that lie on the substrate and are pressed against it by a gradient (v, 3)."""
    e = elastic
    on_plane = _dot(e.normals, positions[e.free]) - e.offsets <= _ON_PLANE
    return on_plane & (_dot(e.normals, slope) > 0.0)


def slide(elastic: Elastic, vectors: Vectors, held: Flags) -> Vectors:
    """The vectors (v, 3) without the part along the normal, where a vertex is held on its plane."""
    normals = elastic.normals[held]
    out = vectors.copy()
    out[held] -= _dot(normals, vectors[held])[:, None] * normals
    return out


def sum_islands(elastic: Elastic, a: Vectors, b: Vectors) -> Vectors:
    """The scalar products of two fields (v, 3), for each island (k,)."""
    return sum_by_island(elastic.island, _dot(a, b), len(elastic.scale))


def find_far(elastic: Elastic, gap: Vectors, value: Vectors, live: Flags) -> Flags:
    """The live islands (k,) for which a guess is worth its price, from their gaps and energies (k,).

    The gap alone does not tell: on some meshes the first step from flat promises little, since lengths hold
    it back.
    """
    return live & ((gap > _FAR) | (value > _FLAT * elastic.scale))


def jump(elastic: Elastic, positions: Vectors, value: Vectors, far: Flags, guess: Guess) -> bool:
    """Take the guess for the islands that are far from their minimum, where it lowers their energy; changes
    positions (n, 3) and energies (k,), and says whether it did.
    """
    if not far.any():
        return False
    e = elastic
    guessed = guess(far)
    lift(e, guessed)
    new = energy(e, guessed)
    better = far & (new < value)
    moved = e.free[better[e.island]]
    positions[moved] = guessed[moved]
    value[better] = new[better]
    return bool(better.any())


def search(
    elastic: Elastic,
    positions: Vectors,
    value: Vectors,
    slope: Vectors,
    direction: Vectors,
    turn: Vectors,
    live: Flags,
) -> tuple[Vectors, Vectors, Vectors]:
    """Go along a direction (v, 3) as far as each live island's energy falls enough, over the substrate.

    From energies (k,) and the gradient (v, 3). Returns the new positions, their energies, and the share of
    the direction that each island went, 0 where none would do.
    """
    e = elastic
    live = live & np.isfinite(sum_islands(e, direction, direction))
    direction = np.where(live[e.island, None], direction, 0.0)
    turn = np.where((live & np.isfinite(sum_islands(e, turn, turn)))[e.island, None], turn, 0.0)
    share = live.astype(np.float64)
    for _ in range(_TRIALS):
        reached = _go(e, positions, direction, turn, share)
        new = energy(e, reached)
        promised = sum_islands(e, slope, reached[e.free] - positions[e.free])
        searching = live & ~((new <= value + _ENOUGH * promised) & (promised < 0.0))
        if not searching.any():
            return reached, new, share
        share = np.where(searching, _SHORTER * share, share)
    share = np.where(searching, 0.0, share)
    reached = _go(e, positions, direction, turn, share)
    return reached, energy(e, reached), share


def _go(elastic: Elastic, positions: Vectors, direction: Vectors, turn: Vectors, share: Vectors) -> Vectors:
    e = elastic
    reached = positions.copy()
    along = share[e.island][:, None]
    reached[e.free] += along * (direction + 0.5 * along * turn)
    lift(e, reached)
    return reached


def _dot(a: Vectors, b: Vectors) -> Vectors:
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]
