"""Steering: parameters that are changed place by place, and over time.

A change has a mask, 0 to 1 on the rest vertices; faces take the mean of their corners, half-edges that of
their ends. Changes of one parameter follow one another: `value (1 + mask (x - 1))` multiplies, and `value +
mask (x - value)` sets. What x is may change with the age, linearly between keys; all that the film holds with
is then brought up to date at the start of a step, with the x of that step's age, and the agenda forgets what
it had foreseen. Everything follows from the age alone, so a run that was resumed is the same to the bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from weathercoat.deform.constraints import Constraints
from weathercoat.film.state import FilmState
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Vectors

PARAMETERS = ("adhesion", "tension", "cohesion", "thickness", "dirt", "protection")

# Gauss and Legendre's three points, exact for what up to five changes with keys make of a parameter.
_NODES = (-math.sqrt(0.6), 0.0, math.sqrt(0.6))
_WEIGHTS = (5.0 / 9.0, 8.0 / 9.0, 5.0 / 9.0)


@dataclass(frozen=True)
class Change:
    """A change of one of `PARAMETERS`: mask (n0,), 0 to 1, on the rest vertices; whether it multiplies or
    sets; and the keys (age, x), rising in age, before and after which x stays: one for a constant.
    """

    parameter: str
    mask: Vectors
    multiplies: bool
    keys: tuple[tuple[float, float], ...]

    def at(self, ages: Vectors | float) -> Vectors:
        """x at an age, or at ages (n0,)."""
        when, values = zip(*self.keys, strict=True)
        return np.asarray(np.interp(ages, when, values))


class Steering:
    """Changes of the parameters of one simulation, and what of them its arrays hold now.

    Adhesion and cohesion are those of the film at age 0. Tension is the drying stress relative to that of the
    paint, by which every tension counts; it lifts in proportion. Thickness is relative to that of the paint:
    by Stoney, a thicker film pulls in proportion, and curls to a radius that is larger in proportion;
    within the film load and strength both grow with it, so cracks do not change. It is above 0 and has no
    keys. Dirt is a factor on the rate of dust. Protection, 0 to 1, takes its share from the loss of
    adhesion and from the rust of the metal.
    """

    def __init__(
        self,
        mesh: HalfEdgeMesh,
        film: FilmState,
        constraints: Constraints,
        changes: Sequence[Change],
        lifts_by_face: bool,
    ) -> None:
        self._film, self._span = film, constraints.span
        self._changes = {name: [c for c in changes if c.parameter == name] for name in PARAMETERS}
        self._lifts_by_face = lifts_by_face
        self._corners = mesh.faces
        self._moment = math.nan
        self._adhesion, self._loss = film.adhesion.copy(), film.adhesion_loss.copy()
        self._cohesion = film.cohesion.copy()
        self._span /= self._on_half_edges("thickness", np.ones(len(film.cohesion)), 0.0)

    @property
    def is_keyed(self) -> bool:
        """Whether anything changes with the age."""
        return any(len(change.keys) > 1 for changes in self._changes.values() for change in changes)

    def go_to(self, age: float) -> bool:
        """Bring the film's arrays to an age; whether that changed them."""
        moment = self._moment_of(age)
        if moment == self._moment:
            return False
        self._moment = moment
        film, ones = self._film, np.ones(len(self._adhesion))
        open_share = 1.0 - self._on_vertices("protection", 0.0 * ones, moment)
        film.adhesion[:] = self._on_vertices("adhesion", self._adhesion, moment)
        film.adhesion_loss[:] = self._loss * open_share
        if self._is_keyed("protection"):  # a line of that slope through what is left now
            film.adhesion[:] += film.adhesion_loss * moment - self._loss * self.worn(ones * moment)
        film.lift_gain[:] = self._on_vertices("thickness", ones, moment)
        if not self._lifts_by_face:
            film.lift_gain[:] *= self._on_vertices("tension", ones, moment)
        film.stress[:] = self._on_faces("tension", np.ones(len(film.stress)), moment)
        film.cohesion[:] = self._on_half_edges("cohesion", self._cohesion, moment)
        return True

    def worn(self, ages: Vectors) -> Vectors:
        """The age that each rest vertex is worn by at ages (n0,): without what it was protected from."""
        return ages - self._integral("protection", np.zeros(len(ages)), ages)

    def mean_dirt(self, age: float) -> Vectors:
        """Mean factor (n0,) on the rate of dust from the start to an age."""
        ones = np.ones(len(self._adhesion))
        if age == 0.0:
            return self._on_vertices("dirt", ones, age)
        return self._integral("dirt", ones, ones * age) / age

    def _is_keyed(self, parameter: str) -> bool:
        return any(len(change.keys) > 1 for change in self._changes[parameter])

    def _key_ages(self, parameters: Sequence[str]) -> list[float]:
        """The ages after the start at which any of the parameters begins to change otherwise, rising."""
        keyed = [change for name in parameters for change in self._changes[name] if len(change.keys) > 1]
        return sorted({age for change in keyed for age, _ in change.keys if age > 0.0})

    def _moment_of(self, age: float) -> float:
        """The age whose values hold at an age: itself, or the start of the time through which all stays."""
        ages = [0.0, *self._key_ages(PARAMETERS)]
        begin = max(start for start in ages if start <= age)
        end = min((later for later in ages if later > begin), default=math.inf)
        keyed = (change for changes in self._changes.values() for change in changes)
        return begin if all(change.at(begin) == change.at(end) for change in keyed) else age

    def _integral(self, parameter: str, base: Vectors, ages: Vectors) -> Vectors:
        """The integral of a parameter (n0,) from the start to ages (n0,)."""
        if not self._is_keyed(parameter):
            return ages * self._on_vertices(parameter, base, 0.0)
        total = np.zeros(len(ages))
        for begin, end in pairwise([0.0, *self._key_ages([parameter]), math.inf]):
            half = 0.5 * (np.clip(ages, begin, end) - begin)
            for node, weight in zip(_NODES, _WEIGHTS, strict=True):
                total += half * weight * self._on_vertices(parameter, base, begin + half * (1.0 + node))
        return total

    def _on_vertices(self, parameter: str, base: Vectors, age: Vectors | float) -> Vectors:
        """A parameter (n0,) at an age, or at ages (n0,), from what it is without changes."""
        value = base
        for change in self._changes[parameter]:
            value = _changed(value, change, change.mask, age)
        return value

    def _on_faces(self, parameter: str, base: Vectors, age: float) -> Vectors:
        """As `_on_vertices`, of faces (m,)."""
        value = base
        for change in self._changes[parameter]:
            corner = change.mask[self._corners]
            value = _changed(value, change, (corner[:, 0] + corner[:, 1] + corner[:, 2]) / 3.0, age)
        return value

    def _on_half_edges(self, parameter: str, base: Vectors, age: float) -> Vectors:
        """As `_on_vertices`, of half-edges (3 m,), the same for both of a pair."""
        value = base
        for change in self._changes[parameter]:
            corner = change.mask[self._corners]
            mask = 0.5 * (corner + np.roll(corner, -1, axis=1))
            value = _changed(value, change, mask.reshape(-1), age)
        return value


def _changed(value: Vectors, change: Change, mask: Vectors, age: Vectors | float) -> Vectors:
    x = change.at(age)
    return value * (1.0 + mask * (x - 1.0)) if change.multiplies else value + mask * (x - value)
