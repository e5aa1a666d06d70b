"""Reference cases: film whose deformed shape is known, and how far a solver's is from it.

A case is a mesh, what of it may move, and what each hinge and each edge aims at. Its answer is known in
advance where the aims are taken from a shape that exists; then the least energy is 0. Elsewhere no shape
meets all aims, and the answer is the converged minimum of the energy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat.deform.constraints import Constraints, make_constraints, refresh_round, release
from weathercoat.deform.deformation import deform
from weathercoat.deform.energy import energy, make_elastic
from weathercoat.deform.momentum import Momentum, make_momentum
from weathercoat.deform.parameters import DeformParameters
from weathercoat.deform.plain import Active, bends_wanted, find_active
from weathercoat.mesh.dihedral import all_bends
from weathercoat.mesh.halfedge import HalfEdgeMesh, make_half_edges
from weathercoat.mesh.order import order_surface
from weathercoat.mesh.surface import Surface, Vectors

_TIGHT, _MOST_ITERATIONS = 1e-12, 300  # of the solver that finds the answers
_GROWN_FACES = 2_000

Shape = Callable[[Vectors], Vectors]  # from flat positions (n, 3) to deformed ones


@dataclass(frozen=True)
class Answer:
    """What a case must come to.

    positions: (n, 3), of film vertices in use; bends [rad], (a,), and lengths, (l,), of what is active;
    energy: as `energy_at`; kind: "exact" for a shape with all aims met, or "minimum".
    """

    positions: Vectors
    bends: Vectors
    lengths: Vectors
    energy: float
    kind: str


@dataclass(frozen=True)
class ReferenceCase:
    """A film to deform.

    name: in file names; about: in a few words. mesh: its positions are the start; rest lengths and angles
    that begin are in the constraints, and `parameters` at `age` say what becomes of these. length: what
    distances are relative to. judged_by_aims: bends and lengths are held against what they aim at, also where
    the answer is a minimum that cannot meet it. growth_steps: in which its targets grow, where they do so.
    """

    name: str
    about: str
    mesh: HalfEdgeMesh
    constraints: Constraints
    parameters: DeformParameters
    age: float
    length: float
    active: Active
    targets: Vectors
    answer: Answer | None = None
    judged_by_aims: bool = False
    growth_steps: int = 20

    @property
    def can_grow(self) -> bool:
        """Whether the targets are the case's own, to be set; those of a run follow from its age."""
        return self.parameters.curl_rate == 0.0

    @property
    def faces(self) -> int:
        """Faces that have not fallen."""
        return int(self.mesh.alive.sum())

    @property
    def start(self) -> Vectors:
        """Positions to begin from, a view of those in use."""
        return self.mesh.positions[: self.mesh.vertex_count]

    def mesh_at(self, positions: Vectors) -> HalfEdgeMesh:
        """The mesh with a copy of positions (n, 3) in place of its own."""
        room = np.empty_like(self.mesh.positions)
        room[: len(positions)] = positions
        return self.mesh._replace(positions=room)

    def parameters_with(self, values: dict[str, Any]) -> DeformParameters:
        """The parameters with values of the config, by dotted keys, in place of some."""
        return replace(self.parameters, **{key.replace(".", "_"): value for key, value in values.items()})

    def aim(self, share: float) -> None:
        """Let every hinge aim at a share of its target from now on; for cases of `make_shaped_case`."""
        self.constraints.angle_start[self.active.hinge_edges] = share * self.targets
        refresh_round(self.mesh, self.constraints, self.active.free)


@dataclass(frozen=True)
class Errors:
    """How far a film is from the answer of its case.

    position: the largest distance, and position_rms: the RMS, relative to the case's length. angle: RMS of
    the bends' errors relative to that of the targets. length: RMS strain, and length_max: the largest.
    """

    position: float
    position_rms: float
    angle: float
    length: float
    length_max: float
    gap: float


def make_shaped_case(
    name: str,
    about: str,
    surface: Surface,
    *,
    clamped: Callable[[Vectors], NDArray[np.bool_]],
    shape: Shape,
    exact: bool = True,
    substrate: bool = True,
    clamp_shaped: bool = False,
    parameters: DeformParameters | None = None,
) -> ReferenceCase:
    """A flat film whose hinges aim at the bends of a deformed shape; the film lies still but for its clamp.

    clamped, shape: of flat positions (n, 3), which are scaled to unit area. exact: the edges aim at the
    lengths in the shape, which is then the answer; otherwise at those of the flat film. clamp_shaped: the
    clamp holds its vertices where the shape has them, not where the flat film has them.
    """
    surface = replace(surface, vertices=surface.vertices / surface.size())
    ordered, _ = order_surface(surface, surface.vertices)
    mesh = make_half_edges(ordered.vertices, ordered.faces)
    if not substrate:
        mesh.rest_normals[:] = 0.0
    flat = mesh.rest_positions
    held = clamped(flat)
    shaped = shape(flat)
    constraints = make_constraints(mesh)
    bends = np.empty(len(mesh.twin))
    all_bends(shaped, mesh.tail, mesh.twin, bends)
    if exact:
        corner = shaped[mesh.faces]
        constraints.rest_length[:] = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2).ravel()
    if clamp_shaped:
        mesh.positions[: len(flat)][held] = shaped[held]
    free = np.flatnonzero(~held).astype(np.int32)
    release(mesh, constraints, free, 0.0)
    paired = mesh.twin > np.arange(len(mesh.twin))
    constraints.angle_start[paired] = bends[paired]
    refresh_round(mesh, constraints, free)
    parameters = replace(parameters or DeformParameters(), curl_rule="curvature", curl_rate=0.0)
    active = find_active(mesh, constraints)
    answer = Answer(shaped, bends[active.hinge_edges], active.rest_length, 0.0, "exact") if exact else None
    extent = flat.max(axis=0) - flat.min(axis=0)
    return ReferenceCase(
        name=name,
        about=about,
        mesh=mesh,
        constraints=constraints,
        parameters=parameters,
        age=0.0,
        length=float(extent.max()),
        active=active,
        targets=bends[active.hinge_edges],
        answer=answer,
    )


def view_film(
    mesh: HalfEdgeMesh,
    constraints: Constraints,
    parameters: DeformParameters,
    age: float,
    *,
    name: str = "",
    about: str = "",
) -> ReferenceCase:
    """Film of a run as it is at an age, and what it aims at; it shares the arrays."""
    active = find_active(mesh, constraints)
    return ReferenceCase(
        name=name,
        about=about,
        mesh=mesh,
        constraints=constraints,
        parameters=parameters,
        age=age,
        length=1.0,
        active=active,
        targets=bends_wanted(constraints, active.hinge_edges, parameters, age),
    )


def with_answer(case: ReferenceCase, positions: Vectors) -> ReferenceCase:
    """The case with a converged minimum as its answer."""
    bends = case.targets if case.judged_by_aims else bends_at(case, positions)
    lengths = case.active.rest_length if case.judged_by_aims else lengths_at(case, positions)
    least = energy_at(case, positions)
    return replace(case, answer=Answer(positions.copy(), bends, lengths, least, "minimum"))


def bends_at(case: ReferenceCase, positions: Vectors) -> Vectors:
    """The bends of the active hinges [rad], (a,)."""
    bends = np.empty(len(case.mesh.twin))
    all_bends(positions, case.mesh.tail, case.mesh.twin, bends)
    return bends[case.active.hinge_edges]


def lengths_at(case: ReferenceCase, positions: Vectors) -> Vectors:
    """The lengths of the active edges, (l,)."""
    ends = positions[case.active.ends]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def momentum_of(case: ReferenceCase, parameters: DeformParameters) -> Momentum | None:
    """What a case's film at rest takes along from step to step, where the solver wants that."""
    has_momentum = parameters.deformation_solver == "momentum"
    return make_momentum(case.mesh, case.constraints) if has_momentum else None


def energy_at(case: ReferenceCase, positions: Vectors) -> float:
    """The energy of the film, relative to that of film as at rest."""
    elastic = make_elastic(case.mesh, case.constraints, case.parameters, case.age)
    return float(energy(elastic, positions).sum() / elastic.scale.sum())


def solve_case(case: ReferenceCase) -> ReferenceCase:
    """The case with the lowest minimum that Newton's method finds as its answer: from the start, from where
    descent ends, and on small films by targets that grow.
    """
    found = [_minimise(case, case.start, 1), _minimise(case, _minimise(case, case.start, 1, "descent"), 1)]
    if case.can_grow and case.faces <= _GROWN_FACES:
        found.append(_minimise(case, case.start, case.growth_steps))
    return with_answer(case, min(found, key=partial(energy_at, case)))


def _minimise(case: ReferenceCase, start: Vectors, steps: int, solver: str = "newton") -> Vectors:
    """Where a solver comes to from positions (n, 3), its targets growing in so many steps."""
    mesh = case.mesh_at(start)
    given = {"deformation.solver": solver, "deformation.tolerance": _TIGHT}
    for step in range(1, steps + 1):
        if case.can_grow:
            case.aim(step / steps)
        most = _MOST_ITERATIONS if step == steps else _MOST_ITERATIONS // 30
        deform(
            mesh, case.constraints, case.parameters_with({**given, "deformation.iterations": most}), case.age
        )
    return mesh.positions[: mesh.vertex_count]


def measure_errors(case: ReferenceCase, positions: Vectors) -> Errors:
    """How far positions (n, 3) are from the answer of a case; all infinite where one is not finite."""
    assert case.answer is not None
    if not np.isfinite(positions).all():
        return Errors(*[math.inf] * 6)
    answer = case.answer
    distance = np.linalg.norm(positions - answer.positions, axis=1)[case.active.free] / case.length
    turned = turn_between(bends_at(case, positions), answer.bends)
    strain = (lengths_at(case, positions) - answer.lengths) / case.active.rest_length
    return Errors(
        position=float(distance.max()),
        position_rms=root_mean_square(distance),
        angle=root_mean_square(turned) / root_mean_square(case.targets),
        length=root_mean_square(strain),
        length_max=float(np.abs(strain).max()),
        gap=energy_at(case, positions) - answer.energy,
    )


def turn_between(bends: Vectors, others: Vectors) -> Vectors:
    """The turns, in [-pi, pi), from other bends to these."""
    return np.remainder(bends - others + np.pi, 2.0 * np.pi) - np.pi


def root_mean_square(values: Vectors) -> float:
    """The root of the mean of squares."""
    return float(np.sqrt(np.mean(values**2)))
