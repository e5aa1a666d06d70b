"""How far the film is from its constraints and from balance, whatever solver moved it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.deform.constraints import Constraints
from weathercoat.deform.descending import resting, slide
from weathercoat.deform.energy import energy, gradient, make_elastic, sum_of_forces
from weathercoat.deform.parameters import Aim, DeformParameters
from weathercoat.deform.targets import wanted_bend
from weathercoat.mesh.dihedral import half_edge_bend
from weathercoat.mesh.halfedge import HalfEdgeMesh, next_of
from weathercoat.mesh.surface import Vectors


@dataclass(frozen=True)
class Residual:
    """How far the film is from its constraints: strain of active edges, and error of angles [rad], RMS and
    largest. How far it is from balance: energy, in units of that at rest; imbalance, the forces that are left
    on vertices over the sum of all that act on them, both RMS, so 0 in balance and about 1 where nothing
    cancels.
    """

    strain_rms: float
    strain_max: float
    angle_rms: float
    angle_max: float
    energy: float
    imbalance: float


def measure_residual(
    mesh: HalfEdgeMesh, constraints: Constraints, parameters: DeformParameters, age: float
) -> Residual:
    """The residual of all constraints of separated film at an age, sleepers included; zeros without any."""
    p, c = parameters, constraints
    is_free = (c.inverse_mass > 0.0) | c.asleep
    strain, error = np.zeros(len(mesh.twin)), np.zeros(len(mesh.twin))
    strains = _strains(mesh, is_free, c.rest_length, strain)
    errors = _errors(mesh, c.angle_start, c.angle_age, c.span, p.aim_at(age), error)
    strain, error = strain[:strains], error[:errors]
    return Residual(
        float(np.sqrt(np.mean(strain**2))) if strains else 0.0,
        float(strain.max(initial=0.0)),
        float(np.sqrt(np.mean(error**2))) if errors else 0.0,
        float(error.max(initial=0.0)),
        *_measure_balance(mesh, c, p, age),
    )


def _measure_balance(
    mesh: HalfEdgeMesh, constraints: Constraints, parameters: DeformParameters, age: float
) -> tuple[float, float]:
    """Energy and imbalance, as in `Residual`; zeros where nothing moves."""
    elastic = make_elastic(mesh, constraints, parameters, age)
    positions = mesh.positions[: mesh.vertex_count]
    force = gradient(elastic, positions)
    force = slide(elastic, force, resting(elastic, positions, force))
    acting = float(np.sqrt(np.sum(sum_of_forces(elastic, positions) ** 2)))
    return (
        float(energy(elastic, positions).sum() / elastic.scale.sum()) if len(elastic.free) else 0.0,
        float(np.sqrt(np.sum(force**2))) / acting if acting > 0.0 else 0.0,
    )


@kernel
def _strains(mesh: HalfEdgeMesh, is_free: NDArray[np.bool_], rest_length: Vectors, out: Vectors) -> int:
    """Unsigned strain of the live edges that have a free end and a length; returns how many."""
    found = 0
    for h in range(len(mesh.twin)):
        a, b = mesh.tail[h], mesh.tail[next_of(h)]
        if not mesh.alive[h // 3] or 0 <= mesh.twin[h] < h or not (is_free[a] or is_free[b]):
            continue
        if rest_length[h] > 0.0:
            squared = 0.0
            for axis in range(3):
                side = mesh.positions[a, axis] - mesh.positions[b, axis]
                squared += side * side
            out[found] = abs(math.sqrt(squared) / rest_length[h] - 1.0)
            found += 1
    return found


@kernel
def _errors(mesh: HalfEdgeMesh, start: Vectors, since: Vectors, span: Vectors, aim: Aim, out: Vectors) -> int:
    """Unsigned error of the live hinges that have a target; returns how many."""
    by_curvature, radius, rate, floor, age = aim.by_curvature, aim.radius, aim.rate, aim.floor, aim.age
    found = 0
    for h in range(len(mesh.twin)):
        if not mesh.alive[h // 3] or mesh.twin[h] < h or math.isnan(start[h]):
            continue
        wanted = wanted_bend(start[h], since[h], span[h], by_curvature, radius, rate, floor, age)
        out[found] = abs(half_edge_bend(h, mesh.positions, mesh.tail, mesh.twin) - wanted)
        found += 1
    return found
