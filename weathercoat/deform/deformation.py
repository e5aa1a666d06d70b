"""Deformation: one step of the separated film, by the solver that the parameters name."""

from __future__ import annotations

import numpy as np

from weathercoat.deform.angle import DIHEDRAL, FORMS
from weathercoat.deform.constraints import Constraints
from weathercoat.deform.descending import Flags, Minimise, Solved
from weathercoat.deform.descent import minimise_by_descent
from weathercoat.deform.energy import make_elastic
from weathercoat.deform.momentum import (
    Momentum,
    make_momentum,
    sweep_with_momentum,
    sweep_with_momentum_together,
)
from weathercoat.deform.newton import minimise_by_newton
from weathercoat.deform.parameters import DeformParameters
from weathercoat.deform.runs import Runs
from weathercoat.deform.seats import return_positions, seat_positions
from weathercoat.deform.sleep import Rest, settle
from weathercoat.deform.sweeps import aim, sweep, sweep_angles, sweep_lengths, sweep_substrate
from weathercoat.deform.team import Team
from weathercoat.deform.unrolling import unroll
from weathercoat.mesh.halfedge import HalfEdgeMesh
from weathercoat.mesh.surface import Vectors

_MINIMISERS: dict[str, Minimise] = {"descent": minimise_by_descent, "newton": minimise_by_newton}
_WORTH_SHARING = 10_000  # hinges; below, handing work over costs more than it saves


def deform(
    mesh: HalfEdgeMesh,
    constraints: Constraints,
    parameters: DeformParameters,
    age: float,
    *,
    team: Team | None = None,
    rest: Rest | None = None,
    momentum: Momentum | None = None,
) -> Solved:
    """Run the solver of one step; changes the positions of separated vertices.

    A team of threads shares the sweeps where there are enough of them; the result is the same bits. `rest` is
    needed where vertices may sleep, `momentum` where it is to live on from step to step.
    """
    match parameters.deformation_solver:
        case "sweeps":
            return _sweep(mesh, constraints, parameters, age, team, rest, None)
        case "momentum":
            moving = momentum or make_momentum(mesh, constraints)
            return _sweep(mesh, constraints, parameters, age, team, rest, moving)
        case "none":
            return Solved(0, 0.0, 0)
        case name:
            return _converge(mesh, constraints, parameters, age, _MINIMISERS[name])


def _converge(
    mesh: HalfEdgeMesh, constraints: Constraints, parameters: DeformParameters, age: float, minimise: Minimise
) -> Solved:
    """Follow the minimum of the energy."""
    p = parameters
    elastic = make_elastic(mesh, constraints, p, age)
    positions = mesh.positions[: mesh.vertex_count]

    def guess(islands: Flags) -> Vectors:
        return unroll(mesh, elastic, positions, islands)

    return minimise(
        elastic, positions, guess, iterations=p.deformation_iterations, tolerance=p.deformation_tolerance
    )


def _sweep(
    mesh: HalfEdgeMesh,
    constraints: Constraints,
    parameters: DeformParameters,
    age: float,
    team: Team | None,
    rest: Rest | None,
    momentum: Momentum | None,
) -> Solved:
    """The paper's way: every constraint in turn, a number of times; with momentum where there is one."""
    p, c = parameters, constraints
    is_shared = team is not None and team.size > 1 and _hinge_count(c.angles) >= _WORTH_SHARING
    sharing = team if is_shared else None
    if momentum is not None:
        _deform_with_momentum(mesh, c, p, age, sharing, momentum)
    elif sharing is not None:
        _deform_together(mesh.positions, c, p, age, sharing)
    else:
        form = FORMS[p.deformation_angle]
        _aim(c.angles, p, age, as_tangent=form == DIHEDRAL)
        sweep(
            p.deformation_sweeps, form, p.deformation_angle_stiffness,
            mesh.positions, c.lengths, c.angles, c.seats,
        )  # fmt: skip
    if p.deformation_sleep_tolerance > 0.0 and rest is not None:
        settle(mesh, c, rest, p.deformation_sleep_tolerance)
    return Solved(p.deformation_sweeps, None, 0)


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


def _deform_with_momentum(
    mesh: HalfEdgeMesh,
    constraints: Constraints,
    parameters: DeformParameters,
    age: float,
    team: Team | None,
    momentum: Momentum,
) -> None:
    """Sweeps that go on in the direction of the ones before, alone or as a team."""
    p, angles = parameters, constraints.angles
    form, stiffness = FORMS[p.deformation_angle], p.deformation_angle_stiffness
    _aim(angles, p, age, as_tangent=form == DIHEDRAL)
    if team is None:
        sweep_with_momentum(p.deformation_sweeps, form, stiffness, mesh, constraints, momentum)
    else:
        cuts = _cut_evenly(angles, team.size)
        sweep_with_momentum_together(
            p.deformation_sweeps, form, stiffness, mesh, constraints, momentum, team, cuts
        )


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
    first, last = tiles or (0, len(angles.tile_run) - 1)
    to = parameters.aim_at(age)
    aim(angles, to.by_curvature, to.radius, to.rate, to.floor, as_tangent, age, first, last)
