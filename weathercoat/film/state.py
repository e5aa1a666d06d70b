"""The film's parameters and state: scalars on vertices, faces and half-edges that decide how it fails.

What ages by a closed form is stored as (value at the last event, age of that event) and evaluated when it is
needed, so that the number of steps is a resolution and not a part of the paint.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.halfedge import EventLog
from weathercoat.mesh.surface import Vectors

TURNING = 0.5  # shear lags over which a crack forgets the direction that it came from


@dataclass(frozen=True)
class FilmParameters:
    """How the film ages and fails. Lengths in sizes, rates per unit of age, forces dimensionless.

    The names are those of the config's sections: `adhesion_base` is `adhesion.base`. The string fields choose
    between the paper's literal rules and the default ones; the default is the first.
    """

    tension_law: str = "saturating"  # or "linear"
    tension_initial: float = 0.0
    tension_rate: float = 3.0
    adhesion_base: float = 1.0
    adhesion_amplitude: float = 0.8
    adhesion_wavelength: float = 0.3
    adhesion_octaves: int = 4
    adhesion_gain: float = 0.65
    adhesion_decay_rate: float = 0.5
    cohesion_base: float = 1.5
    cohesion_scatter: float = 0.2
    cohesion_decay_rate: float = 0.3
    defects_rule: str = "per_area"  # or "share"
    defects_density: float = 400.0
    defects_share: float = 0.01
    defects_strength: float = 0.001
    lift_coefficient: float = 0.3
    lift_convexity: float = 2.0
    lift_sum: str = "per_valence"  # or "plain"
    lift_tension: str = "drying"  # or "face"
    fracture_direction_threshold: float = 0.45
    fracture_direction_factor: float = 0.20
    fracture_relaxation: str = "shear_lag"  # or "faces"
    fracture_shear_lag: float = 0.04
    fracture_face_factor: float = 0.5
    fracture_rounds: str = "by_speed"  # or "one"
    fracture_speed: float = 20.0
    flaking_rule: str = "islands"  # or "faces"
    flaking_hanging_share: float = 0.1


class FilmRules(NamedTuple):
    """The parameters that kernels need, as numbers."""

    saturating: bool
    tension_initial: float
    tension_rate: float
    lift_coefficient: float
    lift_convexity: float
    lift_per_valence: bool
    lifts_by_face: bool
    cohesion_decay_rate: float
    direction_threshold: float
    direction_factor: float
    turning_length: float  # over which a crack turns; 0 where its last edge alone gives its direction
    shear_lag: float  # 0 where a break relaxes its two faces only
    face_factor: float
    crack_speed: float  # infinite where each step has one round of fracture
    drops_islands: bool
    hanging_share: float


class FilmState(NamedTuple):
    """State of the film, plain arrays. n0 rest vertices, m faces; arrays over vertices have the capacity 3 m.

    Vertices: adhesion (n0,) at age 0 and adhesion_loss (n0,), per age, on origins; lift_gain (n0,), a
    factor on what lifts them, on origins; separated bool (3 m,); separation_age (3 m,), infinite while
    attached; is_tip bool (3 m,), where the vertex is the end of one crack, and crack_direction (3 m, 3)
    there, a unit vector on the rest surface. Faces: tension, tension_age, tension_cap (m,): the value at
    its last event, the age of it, and what it tends to; relief (m, 3), the direction at rest of the broken
    edge that relaxed the face most, zero where none did; stress (m,), the drying stress there relative to
    that of the paint, by which tensions count; fray_age (m,), when the face got its first broken edge,
    infinite before. Half-edges: cohesion (3 m,) before fraying; lift_factor (3 m,), the sigmoid of the
    dihedral at rest; tie uint64 (3 m,), a hash of the edge's rest midpoint that decides between equals.
    crack_budget: (1,), the fraction of a round of fracture carried over between steps. mean_edge: mean rest
    length of the edges. rest_lift (n0,): what the film lifts with at tension 1 while nothing round the
    vertex has moved; disturbed bool (3 m,), the attached vertices round which something has.
    """

    adhesion: Vectors
    adhesion_loss: Vectors
    lift_gain: Vectors
    separated: NDArray[np.bool_]
    separation_age: Vectors
    is_tip: NDArray[np.bool_]
    crack_direction: Vectors
    tension: Vectors
    tension_age: Vectors
    tension_cap: Vectors
    relief: Vectors
    stress: Vectors
    fray_age: Vectors
    cohesion: Vectors
    lift_factor: Vectors
    tie: NDArray[np.uint64]
    crack_budget: Vectors
    mean_edge: float
    rest_lift: Vectors
    disturbed: NDArray[np.bool_]


def make_film_rules(parameters: FilmParameters) -> FilmRules:
    """The numbers that kernels need."""
    p = parameters
    shear_lag = p.fracture_shear_lag if p.fracture_relaxation == "shear_lag" else 0.0
    return FilmRules(
        saturating=p.tension_law == "saturating",
        tension_initial=p.tension_initial,
        tension_rate=p.tension_rate,
        lift_coefficient=p.lift_coefficient,
        lift_convexity=p.lift_convexity,
        lift_per_valence=p.lift_sum == "per_valence",
        lifts_by_face=p.lift_tension == "face",
        cohesion_decay_rate=p.cohesion_decay_rate,
        direction_threshold=p.fracture_direction_threshold,
        direction_factor=p.fracture_direction_factor,
        turning_length=TURNING * shear_lag,
        shear_lag=shear_lag,
        face_factor=p.fracture_face_factor,
        crack_speed=p.fracture_speed if p.fracture_rounds == "by_speed" else math.inf,
        drops_islands=p.flaking_rule == "islands",
        hanging_share=p.flaking_hanging_share,
    )


@kernel
def tension_at(value: float, since: float, cap: float, rate: float, saturating: bool, age: float) -> float:
    """Tension at an age, from its value at the age `since`: towards `cap`, or linear without one."""
    if saturating:
        return cap + (value - cap) * math.exp(-rate * (age - since))
    return value + rate * (age - since)


@kernel
def drying_tension(rules: FilmRules, age: float) -> float:
    """Tension of a film that nothing has relaxed, at an age."""
    return tension_at(rules.tension_initial, 0.0, 1.0, rules.tension_rate, rules.saturating, age)


@kernel
def face_tension(state: FilmState, rules: FilmRules, f: int, age: float) -> float:
    """Tension of face f at an age, in units of the drying stress there."""
    return tension_of(state.tension, state.tension_age, state.tension_cap, rules, f, age)


@kernel
def tension_of(
    tension: Vectors, tension_age: Vectors, tension_cap: Vectors, rules: FilmRules, f: int, age: float
) -> float:
    """As `face_tension`, from the arrays of the state; at the age of the last event just what that left."""
    if age == tension_age[f]:
        return tension[f]
    return tension_at(tension[f], tension_age[f], tension_cap[f], rules.tension_rate, rules.saturating, age)


def adhesion_at(adhesion: Vectors, loss: Vectors | float, age: float) -> Vectors:
    """Adhesion at an age, from that at age 0: it falls linearly, by its loss per age, and not below 0."""
    return np.maximum(adhesion - loss * age, 0.0)


@kernel
def inherit_film(state: FilmState, log: EventLog, first: int) -> None:
    """Give the vertices of the log's splits from `first` on what their parents have; copies are no tips."""
    for i in range(first, log.counts[0]):
        new, parent = log.splits[i, 0], log.splits[i, 1]
        state.separated[new] = state.separated[parent]
        state.separation_age[new] = state.separation_age[parent]
        state.is_tip[new] = False
        state.is_tip[parent] = False
