"""Constraints of the separated film and the Gauss-Seidel sweeps over them (paper 4, 5).

One sweep is all active lengths, then all active angles, then the substrate, each in a fixed order: half-edges
are taken in strides (see `interleave`), so that neighbours, which wait for each other's results, do not
follow one another.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.deform.angle import project_arccos_angles, project_dihedrals, project_split_angles
from weathercoat.deform.length import project_lengths
from weathercoat.deform.substrate import lift_to_substrate
from weathercoat.mesh.dihedral import half_edge_bend
from weathercoat.mesh.halfedge import EventLog, HalfEdgeMesh, next_of, prev_of
from weathercoat.mesh.surface import Indices, Vectors

_STRIDE = 61  # half-edges between two that follow one another in a sweep
_TILE = 64 * _STRIDE  # half-edges of one stretch of the curve, about 650 vertices
_LARGEST_BEND = 0.9 * math.pi  # a target beyond this would fold a hinge through itself


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


@dataclass
class Constraints:
    """What holds the separated film in shape.

    Half-edges, by the smaller one of a pair: rest_length (3 m,) [sizes]; span (3 m,), the distance between
    the centres of the two faces at rest; angle_start (3 m,), the bend when the angle constraint was made, NaN
    without one; angle_age (3 m,). Vertices: inverse_mass (3 m,), 1 once separated. `order` is the fixed order
    of all half-edges; the packed arrays hold what is active and are made anew after an event.
    """

    rest_length: Vectors
    span: Vectors
    angle_start: Vectors
    angle_age: Vectors
    inverse_mass: Vectors
    order: Indices
    is_stale: bool = True
    length_ends: Indices = field(default_factory=lambda: np.empty((0, 2), np.int32))
    length_targets: Vectors = field(default_factory=lambda: np.empty(0))
    hinges: Indices = field(default_factory=lambda: np.empty((0, 4), np.int32))
    hinge_edges: Indices = field(default_factory=lambda: np.empty(0, np.int32))
    free_vertices: Indices = field(default_factory=lambda: np.empty(0, np.int32))


def interleave(count: int) -> Indices:
    """The numbers below `count`, tile after tile, each in strides: 0, s, 2 s, ..., 1, s + 1, ...

    A tile is small enough for the processor's first cache.
    """
    numbers = np.arange(count, dtype=np.int32)
    inside = numbers % _TILE
    return numbers[np.lexsort((inside // _STRIDE, inside % _STRIDE, numbers // _TILE))]


def make_constraints(mesh: HalfEdgeMesh) -> Constraints:
    """No constraint yet, with all that they will need from the rest surface."""
    corner = mesh.rest_positions[mesh.faces]
    rest_length = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2).reshape(-1)
    centre = np.repeat(corner.mean(axis=1), 3, axis=0)
    paired = mesh.twin >= 0
    span = np.zeros(len(mesh.twin))
    span[paired] = np.linalg.norm(centre[paired] - centre[mesh.twin[paired]], axis=1)
    return Constraints(
        rest_length=rest_length,
        span=span,
        angle_start=np.full(len(mesh.twin), np.nan),
        angle_age=np.zeros(len(mesh.twin)),
        inverse_mass=np.zeros(len(mesh.twin)),
        order=interleave(len(mesh.twin)),
    )


def release(mesh: HalfEdgeMesh, constraints: Constraints, vertices: Indices, age: float) -> None:
    """Let vertices move that have separated: angle constraints on the edges opposite to them, from their
    present bend.

    The lengths of their edges are held from now on; no end of such an edge had moved before, so that is the
    rest length. A constraint that exists already keeps its start.
    """
    constraints.inverse_mass[vertices] = 1.0
    _start_angles(mesh, vertices, age, constraints.angle_start, constraints.angle_age)
    constraints.is_stale = constraints.is_stale or len(vertices) > 0


def follow_events(constraints: Constraints, log: EventLog) -> None:
    """Bring the constraints up to date with a step's log.

    A broken edge loses its angle constraint, and each half-edge keeps a length constraint of its own.
    """
    splits, breaks = log.split_entries(), log.break_entries()
    # parents of copies may be copies of the same step, but all of them have separated
    constraints.inverse_mass[splits[:, 0]] = 1.0
    constraints.angle_start[breaks.min(axis=1, initial=len(constraints.order))] = np.nan
    constraints.is_stale = constraints.is_stale or bool(log.counts.any())


@kernel
def _start_angles(
    mesh: HalfEdgeMesh, vertices: Indices, age: float, angle_start: Vectors, angle_age: Vectors
) -> None:
    for v in vertices:
        first = mesh.half_edge[v]
        leaving = first
        while leaving >= 0:
            h = next_of(leaving)
            g = mesh.twin[h]
            edge = min(h, g)
            if g >= 0 and math.isnan(angle_start[edge]):
                angle_start[edge] = half_edge_bend(h, mesh.positions, mesh.tail, mesh.twin)
                angle_age[edge] = age
            leaving = mesh.twin[prev_of(leaving)]
            if leaving == first:
                break


@kernel
def _pack(
    mesh: HalfEdgeMesh,
    inverse_mass: Vectors,
    rest_length: Vectors,
    angle_start: Vectors,
    order: Indices,
    length_ends: Indices,
    length_targets: Vectors,
    hinges: Indices,
    hinge_edges: Indices,
) -> tuple[int, int]:
    """Collect the active lengths and hinges in the fixed order; returns their numbers."""
    tail, twin, alive = mesh.tail, mesh.twin, mesh.alive
    lengths = 0
    angles = 0
    for h in order:
        g = twin[h]
        if not alive[h // 3] or (0 <= g < h):
            continue
        a, b = tail[h], tail[next_of(h)]
        if inverse_mass[a] + inverse_mass[b] > 0.0:
            length_ends[lengths, 0] = a
            length_ends[lengths, 1] = b
            length_targets[lengths] = rest_length[h]
            lengths += 1
        if g >= 0 and not math.isnan(angle_start[h]):
            hinges[angles, 0] = a
            hinges[angles, 1] = b
            hinges[angles, 2] = tail[prev_of(h)]
            hinges[angles, 3] = tail[prev_of(g)]
            hinge_edges[angles] = h
            angles += 1
    return lengths, angles


def pack(mesh: HalfEdgeMesh, constraints: Constraints) -> None:
    """Make the packed arrays anew, if an event made them stale."""
    if not constraints.is_stale:
        return
    capacity = len(mesh.twin)
    ends, targets = np.empty((capacity, 2), np.int32), np.empty(capacity)
    hinges, hinge_edges = np.empty((capacity, 4), np.int32), np.empty(capacity, np.int32)
    lengths, angles = _pack(
        mesh, constraints.inverse_mass, constraints.rest_length, constraints.angle_start, constraints.order,
        ends, targets, hinges, hinge_edges,
    )  # fmt: skip
    constraints.length_ends, constraints.length_targets = ends[:lengths].copy(), targets[:lengths].copy()
    constraints.hinges, constraints.hinge_edges = hinges[:angles].copy(), hinge_edges[:angles].copy()
    count = mesh.vertex_count
    moving: NDArray[np.bool_] = (constraints.inverse_mass[:count] > 0.0) & (mesh.half_edge[:count] >= 0)
    constraints.free_vertices = np.flatnonzero(moving).astype(np.int32)
    constraints.is_stale = False


def bend_targets(constraints: Constraints, parameters: DeformParameters, age: float) -> Vectors:
    """The wanted bend of each packed hinge at an age [rad], (k,).

    By default the curvature grows at a rate to 1 / radius, so that curls belong to the paint; literally every
    outer dihedral shrinks by an angle per age down to a floor.
    """
    p = parameters
    edges = constraints.hinge_edges
    start = constraints.angle_start[edges]
    elapsed = age - constraints.angle_age[edges]
    if p.curl_rule == "angle":
        wanted = start - p.curl_angle_rate * elapsed
        return np.maximum(wanted, np.minimum(start, p.curl_angle_floor - math.pi))
    wanted = start - constraints.span[edges] / p.curl_radius * -np.expm1(-p.curl_rate * elapsed)
    return np.maximum(wanted, np.minimum(start, -_LARGEST_BEND))


def deform(mesh: HalfEdgeMesh, constraints: Constraints, parameters: DeformParameters, age: float) -> None:
    """Run the sweeps of one step; changes the positions of separated vertices."""
    pack(mesh, constraints)
    if len(constraints.free_vertices) == 0:
        return
    target = bend_targets(constraints, parameters, age)
    if parameters.deformation_angle == "dihedral":
        target = np.tan(0.5 * target)
    for _ in range(parameters.deformation_sweeps):
        project_lengths(
            mesh.positions, constraints.inverse_mass, constraints.length_ends, constraints.length_targets
        )
        _PROJECT_ANGLES[parameters.deformation_angle](
            mesh.positions,
            constraints.inverse_mass,
            constraints.hinges,
            target,
            parameters.deformation_angle_stiffness,
        )
        lift_to_substrate(
            mesh.positions, mesh.origin, mesh.rest_positions, mesh.rest_normals, constraints.free_vertices
        )


_PROJECT_ANGLES = {
    "dihedral": project_dihedrals,
    "split": project_split_angles,
    "arccos": project_arccos_angles,
}


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
    pack(mesh, constraints)
    if len(constraints.hinges) == 0:
        return Residual(0.0, 0.0, 0.0, 0.0)
    ends = mesh.positions[constraints.length_ends]
    length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    has_length = constraints.length_targets > 0.0
    strain = np.abs(length[has_length] / constraints.length_targets[has_length] - 1.0)
    bends = np.empty(len(constraints.hinge_edges))
    _bends_of(mesh, constraints.hinge_edges, bends)
    error = np.abs(bends - bend_targets(constraints, parameters, age))
    return Residual(
        float(np.sqrt(np.mean(strain**2))) if len(strain) else 0.0,
        float(strain.max(initial=0.0)),
        float(np.sqrt(np.mean(error**2))),
        float(error.max()),
    )


@kernel
def _bends_of(mesh: HalfEdgeMesh, half_edges: Indices, out: Vectors) -> None:
    for i in range(len(half_edges)):
        out[i] = half_edge_bend(half_edges[i], mesh.positions, mesh.tail, mesh.twin)
