"""The state of a simulation as arrays, and back: what events have changed and no closed form gives again.

What follows from the surface, the parameters and the seed is made anew by `make_simulation`; the agenda of
failure, the runoff and what the lanes of the constraints hold follow from the state; which lane a constraint
has is part of it, since their order comes from the events and decides the result. Arrays over film vertices
are cut to those in use. Random numbers have no state: each is a hash of the seed, the name of its stream, and
a place.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.sim.simulation import Simulation, Solving

Arrays = dict[str, NDArray[Any]]

# By owner: the arrays over film vertices, of which those in use are kept, and the others, kept whole.
_FILM_VERTICES = {
    "mesh": ("positions", "half_edge", "origin"),
    "film": ("separated", "separation_age", "is_tip", "crack_direction", "disturbed"),
    "constraints": ("inverse_mass", "asleep"),
    "seats": ("seat",),
    "rust": ("film", "source"),
    "rest": ("calm", "last"),
    "momentum": ("velocity", "run"),
}
_WHOLE = {
    "mesh": ("tail", "twin", "alive", "used"),
    "film": ("tension", "tension_age", "tension_cap", "relief", "fray_age", "crack_budget"),
    "constraints": ("angle_start", "angle_age"),
    "lengths": ("filled", "lane", "slot_at"),
    "angles": ("filled", "lane", "slot_at"),
    "seats": ("filled", "vertex"),
    "rust": ("lifted_age", "bare_age", "film_corners"),
    "rest": ("clock",),
}


def state_arrays(simulation: Simulation) -> Arrays:
    """Views of all arrays that are the state, by `owner.field`, and copies of the counts."""
    used = simulation.mesh.vertex_count
    arrays = {name: array[:used] for name, array in _film_vertex_arrays(simulation)}
    arrays.update(_whole_arrays(simulation))
    solving = simulation.solving
    gap = np.nan if solving.largest_gap is None else solving.largest_gap
    arrays["step_count"] = np.array([simulation.step_count])
    arrays["flake_areas"] = np.array(simulation.flake_areas, np.float64)
    arrays["solving"] = np.array([solving.iterations, gap, solving.unfinished_steps], np.float64)
    return arrays


def restore_state(simulation: Simulation, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Bring a simulation at age 0 to the state of `state_arrays`, made of the same surface and parameters.

    Raises KeyError or ValueError where the arrays are not those of such a simulation.
    """
    used = int(arrays["mesh.used"][0])
    if not len(simulation.mesh.rest_positions) <= used <= len(simulation.mesh.tail):
        raise ValueError(f"{used} film vertices")
    for name, array in _film_vertex_arrays(simulation):
        _fill(name, array[:used], arrays)
    for name, array in _whole_arrays(simulation):
        _fill(name, array, arrays)
    simulation.step_count = int(arrays["step_count"][0])
    simulation.flake_areas = arrays["flake_areas"].tolist()
    iterations, gap, unfinished = arrays["solving"]
    simulation.solving = Solving(int(iterations), None if np.isnan(gap) else float(gap), int(unfinished))
    simulation.derive()


def _film_vertex_arrays(simulation: Simulation) -> Iterator[tuple[str, NDArray[Any]]]:
    return _named_arrays(simulation, _FILM_VERTICES)


def _whole_arrays(simulation: Simulation) -> Iterator[tuple[str, NDArray[Any]]]:
    return _named_arrays(simulation, _WHOLE)


def _named_arrays(
    simulation: Simulation, fields: Mapping[str, tuple[str, ...]]
) -> Iterator[tuple[str, NDArray[Any]]]:
    constraints = simulation.constraints
    owners = {
        "mesh": simulation.mesh,
        "film": simulation.film,
        "constraints": constraints,
        "lengths": constraints.lengths,
        "angles": constraints.angles,
        "seats": constraints.seats,
        "rust": simulation.rust,
        "rest": simulation.rest,
        "momentum": simulation.momentum,
    }
    for owner, names in fields.items():
        if owners[owner] is not None:
            yield from ((f"{owner}.{name}", getattr(owners[owner], name)) for name in names)


def _fill(name: str, array: NDArray[Any], arrays: Mapping[str, NDArray[Any]]) -> None:
    kept = arrays[name]
    if kept.shape != array.shape or kept.dtype != array.dtype:
        raise ValueError(f"{name} is {kept.dtype} {kept.shape}, not {array.dtype} {array.shape}")
    array[...] = kept
