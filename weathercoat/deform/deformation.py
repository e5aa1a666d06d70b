"""Deformation: one step's sweeps over the separated film, and how far from its constraints they leave it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from weathercoat.compile import kernel
from weathercoat.deform.angle import DIHEDRAL, FORMS
from weathercoat.deform.constraints import Constraints
from weathercoat.deform.runs import LANES, Runs
from weathercoat.deform.sweeps import aim, sweep
from weathercoat.mesh.dihedral import bend_angle
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Vectors


@dataclass(frozen=True)
class DeformParameters:
    """How separated film curls. Lengths in sizes, rates per unit of age, angles in radians.

    The names are those of the config's sections: `curl_radius` is `curl.radius`. The string fields choose
    between forms.
    """

    curl_rule: str = "curvature"  # or "angle"
    curl_radius: float = 0.05
    curl_rate: float = 10.0
    curl_angle_rate: float = 0.8
    curl_angle_floor: float = 2.6
    deformation_sweeps: int = 10
    deformation_angle: str = "dihedral"  # or "split", "arccos"
    deformation_angle_stiffness: float = 1.0


def deform(mesh: HalfEdgeMesh, constraints: Constraints, parameters: DeformParameters, age: float) -> None:
    """Run the sweeps of one step; changes the positions of separated vertices."""
    p, c = parameters, constraints
    form = FORMS[p.deformation_angle]
    _aim(c.angles, p, age, as_tangent=form == DIHEDRAL)
    sweep(
        p.deformation_sweeps,
        form,
        p.deformation_angle_stiffness,
        mesh.positions,
        c.lengths,
        c.angles,
        c.planes,
    )


def _aim(angles: Runs, parameters: DeformParameters, age: float, *, as_tangent: bool) -> None:
    """Set the targets of all active hinges for an age."""
    p = parameters
    by_curvature = p.curl_rule == "curvature"
    rate = p.curl_rate if by_curvature else p.curl_angle_rate
    tiles = len(angles.tile_run) - 1
    aim(angles, by_curvature, p.curl_radius, rate, p.curl_angle_floor, as_tangent, age, 0, tiles)


@dataclass(frozen=True)
class Residual:
    """How far the film is from its constraints: strain of active edges, and error of angles [rad], RMS and
    largest.
    """

    strain_rms: float
    strain_max: float
    angle_rms: float
    angle_max: float


def measure_residual(
    mesh: HalfEdgeMesh, constraints: Constraints, parameters: DeformParameters, age: float
) -> Residual:
    """The residual of the active constraints at an age; zeros where there are none."""
    _aim(constraints.angles, parameters, age, as_tangent=False)
    strain = np.zeros(len(constraints.lengths.lane))
    error = np.zeros(len(constraints.angles.lane))
    strains = _strains(mesh.positions, constraints.lengths, strain)
    errors = _errors(mesh.positions, constraints.angles, error)
    strain, error = strain[:strains], error[:errors]
    return Residual(
        float(np.sqrt(np.mean(strain**2))) if strains else 0.0,
        float(strain.max(initial=0.0)),
        float(np.sqrt(np.mean(error**2))) if errors else 0.0,
        float(error.max(initial=0.0)),
    )


@kernel
def _strains(positions: Vectors, lengths: Runs, out: Vectors) -> int:
    """Unsigned strain of the active lengths that have one, by slots; returns how many."""
    found = 0
    for lane in lengths.lane:
        if lane < 0 or lengths.target[lane // LANES, lane % LANES] == 0.0:
            continue
        b, i = lane // LANES, lane % LANES
        span = positions[lengths.vertices[b, 0, i]] - positions[lengths.vertices[b, 1, i]]
        length = np.sqrt(span[0] * span[0] + span[1] * span[1] + span[2] * span[2])
        out[found] = abs(length / lengths.target[b, i] - 1.0)
        found += 1
    return found


@kernel
def _errors(positions: Vectors, angles: Runs, out: Vectors) -> int:
    """Unsigned error of the active hinges, whose targets are bends, by slots; returns how many."""
    found = 0
    for lane in angles.lane:
        if lane < 0:
            continue
        b, i = lane // LANES, lane % LANES
        v = angles.vertices[b]
        bend = bend_angle(positions, v[0, i], v[1, i], v[2, i], v[3, i])
        out[found] = abs(bend - angles.target[b, i])
        found += 1
    return found
