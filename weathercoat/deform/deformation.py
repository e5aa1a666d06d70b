"""Deformation: one step's sweeps over the separated film, and how far from its constraints they leave it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.deform.angle import DIHEDRAL, FORMS
from weathercoat.deform.constraints import Constraints
from weathercoat.deform.runs import Runs
from weathercoat.deform.seats import return_positions, seat_positions
from weathercoat.deform.sleep import Rest, settle
from weathercoat.deform.sweeps import aim, sweep, sweep_angles, sweep_lengths, sweep_substrate
from weathercoat.deform.targets import curved_bend, share_grown, shrunk_bend
from weathercoat.deform.team import Team
from weathercoat.mesh.dihedral import half_edge_bend
from weathercoat.mesh.halfedge import HalfEdgeMesh, next_of
from weathercoat.mesh.surface import Vectors

_WORTH_SHARING = 10_000  # hinges; below, handing work over costs more than it saves


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
    deformation_sleep_tolerance: float = 0.0


def deform(
    mesh: HalfEdgeMesh,
    constraints: Constraints,
    parameters: DeformParameters,
    age: float,
    *,
    team: Team | None = None,
    rest: Rest | None = None,
) -> None:
    """Run the sweeps of one step; changes the positions of separated vertices.

    A team of threads shares the work where there is enough of it; the result is the same bits. `rest` is
    needed where vertices may sleep.
    """
    p, c = parameters, constraints
    if team is not None and team.size > 1 and _hinge_count(c.angles) >= _WORTH_SHARING:
        _deform_together(mesh.positions, c, p, age, team)
    else:
        form = FORMS[p.deformation_angle]
        _aim(c.angles, p, age, as_tangent=form == DIHEDRAL)
        sweep(
            p.deformation_sweeps, form, p.deformation_angle_stiffness,
            mesh.positions, c.lengths, c.angles, c.seats,
        )  # fmt: skip
    if p.deformation_sleep_tolerance > 0.0 and rest is not None:
        settle(mesh, c, rest, p.deformation_sleep_tolerance)


def _deform_together(
    positions: Vectors, constraints: Constraints, parameters: DeformParameters, age: float, team: Team
) -> None:
    """The same sweeps, with the tiles shared among threads.

    What a thread does to a tile, no other tile sees; constraints across tiles are met by one thread.
    """
    p, lengths, angles, seats = parameters, constraints.lengths, constraints.angles, constraints.seats
    form, stiffness = FORMS[p.deformation_angle], p.deformation_angle_stiffness
    inside, length_tiles, angle_tiles = lengths.inside, len(lengths.tile_run) - 1, len(angles.tile_run) - 1
    cuts = _cut_evenly(angles, team.size)

    def begin(number: int) -> None:
        tiles = cuts[number], cuts[number + 1]
        seat_positions(positions, seats, *tiles)
        _aim(angles, p, age, as_tangent=form == DIHEDRAL, tiles=tiles)
        sweep_lengths(seats, lengths, *tiles)

    def go_on(number: int) -> None:
        tiles = cuts[number], cuts[number + 1]
        sweep_substrate(seats, *tiles)
        sweep_lengths(seats, lengths, *tiles)

    def bend(number: int) -> None:
        sweep_angles(form, seats, angles, stiffness, cuts[number], cuts[number + 1])

    def end(number: int) -> None:
        sweep_substrate(seats, cuts[number], cuts[number + 1])
        return_positions(positions, seats, cuts[number], cuts[number + 1])

    _aim(angles, p, age, as_tangent=form == DIHEDRAL, tiles=(inside, angle_tiles))
    for number in range(p.deformation_sweeps):
        team.share(begin if number == 0 else go_on)
        sweep_lengths(seats, lengths, inside, length_tiles)
        team.share(bend)
        sweep_angles(form, seats, angles, stiffness, inside, angle_tiles)
    if p.deformation_sweeps > 0:
        team.share(end)


def _hinge_count(angles: Runs) -> int:
    """Active hinges."""
    return int(angles.filled.sum())


def _cut_evenly(angles: Runs, parts: int) -> list[int]:
    """Bounds, (parts + 1,), of ranges of the tiles inside that hold about equally many active hinges."""
    before = np.concatenate([[0], np.cumsum(angles.filled)])[angles.tile_run[: angles.inside + 1]]
    wanted = before[-1] * np.arange(1, parts) / parts
    return [0, *np.searchsorted(before, wanted).tolist(), angles.inside]


def _aim(
    angles: Runs,
    parameters: DeformParameters,
    age: float,
    *,
    as_tangent: bool,
    tiles: tuple[int, int] | None = None,
) -> None:
    """Set the targets of active hinges for an age, of all tiles or of a range."""
    p = parameters
    by_curvature = p.curl_rule == "curvature"
    rate = p.curl_rate if by_curvature else p.curl_angle_rate
    first, last = tiles or (0, len(angles.tile_run) - 1)
    aim(angles, by_curvature, p.curl_radius, rate, p.curl_angle_floor, as_tangent, age, first, last)


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
    """The residual of all constraints of separated film at an age, sleepers included; zeros without any."""
    p, c = parameters, constraints
    is_free = (c.inverse_mass > 0.0) | c.asleep
    strain, error = np.zeros(len(mesh.twin)), np.zeros(len(mesh.twin))
    strains = _strains(mesh, is_free, c.rest_length, strain)
    by_curvature = p.curl_rule == "curvature"
    rate = p.curl_rate if by_curvature else p.curl_angle_rate
    errors = _errors(
        mesh,
        c.angle_start,
        c.angle_age,
        c.span,
        by_curvature,
        p.curl_radius,
        rate,
        p.curl_angle_floor,
        age,
        error,
    )
    strain, error = strain[:strains], error[:errors]
    return Residual(
        float(np.sqrt(np.mean(strain**2))) if strains else 0.0,
        float(strain.max(initial=0.0)),
        float(np.sqrt(np.mean(error**2))) if errors else 0.0,
        float(error.max(initial=0.0)),
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
                squared += (mesh.positions[a, axis] - mesh.positions[b, axis]) ** 2
            out[found] = abs(math.sqrt(squared) / rest_length[h] - 1.0)
            found += 1
    return found


@kernel
def _errors(
    mesh: HalfEdgeMesh, start: Vectors, since: Vectors, span: Vectors,
    by_curvature: bool, radius: float, rate: float, floor: float, age: float, out: Vectors,
) -> int:  # fmt: skip
    """Unsigned error of the live hinges that have a target; returns how many."""
    found = 0
    for h in range(len(mesh.twin)):
        if not mesh.alive[h // 3] or mesh.twin[h] < h or math.isnan(start[h]):
            continue
        if by_curvature:
            wanted = curved_bend(start[h], span[h], radius, share_grown(rate * (age - since[h])))
        else:
            wanted = shrunk_bend(start[h], rate * (age - since[h]), floor)
        out[found] = abs(half_edge_bend(h, mesh.positions, mesh.tail, mesh.twin) - wanted)
        found += 1
    return found
