"""Isotropic, homogeneous and random remeshing.

The loop is that of Botsch and Kobbelt, A remeshing approach to multiresolution modeling, 2004: split long
edges, collapse short ones, flip, smooth in the tangent plane and project on the input. What is added: the
first splits are at random places in random order, so that no grid or strip of the input shows in the
directions of the new edges (cracks run along them); flips weigh the Delaunay criterion against regular
valences, and smoothing has springs, which makes edges more even than either alone; discs are turned on flat
parts until no direction of edges is preferred; features are chains that their vertices slide on; and the
number of faces is met by feedback.

Everything happens in the frame of the shape with coordinates rounded there, so that moving, scaling,
turning or renumbering the input does not change the result by more than its last digits.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace

import numpy as np

from weathercoat.errors import LimitError, Note
from weathercoat.mesh.charts import find_seams
from weathercoat.mesh.connectivity import (
    FREE,
    EditableMesh,
    compact,
    drop_faces,
    join_meshes,
    make_editable_mesh,
    order_along_curve,
    reserve,
)
from weathercoat.mesh.creases import Features, find_features, release_chains
from weathercoat.mesh.edits import (
    collapse_pass,
    edge_lengths,
    face_shapes,
    flip_edges,
    mark_edges_about_new,
    smallest_angles,
    split_pass,
)
from weathercoat.mesh.fitting import distances_to, flip_nearer, sample_bends, snap_pass
from weathercoat.mesh.frame import make_frame
from weathercoat.mesh.halfedge import make_twins
from weathercoat.mesh.mending import DEGENERATE, find_bad_faces, mend_pass, release_around
from weathercoat.mesh.order import order_surface
from weathercoat.mesh.orientation import balance_directions, find_flat_parts
from weathercoat.mesh.projection import InputSurface, barycentric_of
from weathercoat.mesh.slices import in_slices
from weathercoat.mesh.smoothing import apply_moves, fan_normals, smooth
from weathercoat.mesh.surface import Indices, Place, Surface, Vectors, face_areas
from weathercoat.mesh.transfer import transfer

_QUANTUM = (
    1.0471e-10  # to which positions in the frame are rounded; no simple fraction, so that none lies half-way
)
_SPLIT, _COLLAPSE = 4.0 / 3.0, 4.0 / 5.0  # of the target length
_SHUFFLE = 0.7  # of the target length; inner edges are first split down to this
_MOST_SHUFFLES = (
    100  # passes of random splits, more than the longest edge that the limit of faces allows can need
)
_SPRING = 0.5  # weight of springs against the mean of the neighbours
_REGULARITY = 0.7  # weight of valences against the Delaunay criterion, see `edits.flip_pass`
_FINAL_ROUNDS = 2  # of the correction of the number of faces
_LONGEST = 1.7  # of the target length, for edges that this correction makes
_PROMISED_ANGLE = np.radians(10.0)
_POOR = 0.35  # triangles worse than this (1 is equilateral) are not worth the short crease beside them
_JOINED = 0.1  # of the target length; corners nearer than this may be joined to be rid of a degenerate face
_MEND_ROUNDS = 10
_FIT_ROUNDS = 5
_FIT_LENGTH = 0.08  # of the target length; meshes for which this is more than the tolerance are not fitted
_FLIP_SHARE = 1.0  # of that tolerance, from which edges are flipped nearer
_FIT_SHARE = 0.01  # of the vertices at most, since each that is held costs evenness
_FIT_TOLERANCE = 1.7e-3  # of the diagonal
_HELD = np.iinfo(np.int32).min  # chain of a free vertex that smoothing shall leave where it is, like a corner
_SHORT_CREASE = 6.0  # target lengths; longer creases are kept in any case


@dataclass(frozen=True)
class RemeshParameters:
    """How to remesh.

    faces: number of triangles wanted, met within 2 % where the shape allows it. crease_angle: edges that
    bend by more [degrees] are kept as lines, short ones of a noisy scan excepted. iterations: rounds of the
    loop; more of them give more even triangles. seed: of the random splits. face_limit: inputs that would
    be split further are refused.
    """

    faces: int = 10_000
    crease_angle: float = 30.0
    iterations: int = 12
    seed: int = 0
    face_limit: int = 500_000


def remesh(surface: Surface, parameters: RemeshParameters) -> Surface:
    """The surface in isotropic, even, randomly oriented triangles, about `parameters.faces` of them.

    The input must be an oriented manifold, with boundaries or without. Its components, their topology,
    creases, boundaries and borders of groups are kept; `place` tells where each vertex lies on the input.
    Raises LimitError where the shape needs more faces than the limit, ValueError where the input is no
    manifold.
    """
    frame = make_frame(surface)
    local = _rounded(frame.localise(surface.vertices))
    ordered, old_face = order_surface(replace(surface, place=None), local)
    local = _rounded(frame.localise(ordered.vertices))
    areas = face_areas(local, ordered.faces)
    edge_length = float(np.sqrt(4.0 * np.sum(areas) / (np.sqrt(3.0) * parameters.faces)))
    _require_limit(local, ordered.faces, areas, edge_length, frame.size, parameters)
    twin = make_twins(ordered.faces)
    bend = float(np.radians(parameters.crease_angle))
    seams = None if ordered.uv is None else find_seams(ordered.uv, twin)
    features = find_features(local, ordered.faces, twin, ordered.face_group, bend, edge_length, seams)
    source = InputSurface(local, ordered.faces, twin, features.crease)
    mesh = _iterate(_start(features, source), features, source, edge_length, parameters)
    mesh, kept = _keep_degenerate_components(mesh, features, source)
    face, barycentric = _find_places(mesh, features, source)
    count = int(mesh.count[1])
    result = replace(
        surface,
        vertices=np.sum(barycentric[:, :, None] * ordered.vertices[ordered.faces[face]], axis=1),
        faces=mesh.tail.reshape(-1, 3).copy(),
        face_group=ordered.face_group[mesh.source],
        place=Place(old_face[face], _turn_back(barycentric, ordered, face, surface, old_face[face])),
    )
    result = transfer(result, ordered, source, mesh.source, Place(face, barycentric), mesh.position)
    angles = smallest_angles(mesh)
    if kept:
        message = "components are so thin for these edges that they were left as they came"
        result = result.with_notes(Note("W-KEPT", kept, message))
    if np.any(angles < _PROMISED_ANGLE):
        poor = int(np.sum(angles < _PROMISED_ANGLE))
        result = result.with_notes(
            Note(
                "W-ANGLES",
                poor,
                "faces have an angle under 10 degrees: creases or rims are closer than edges",
            )
        )
    if abs(count - parameters.faces) > 0.02 * parameters.faces:
        message = (
            f"{parameters.faces} faces wanted, {count} made: the shape does not allow fewer or more even ones"
        )
        result = result.with_notes(Note("W-FACES", count, message))
    return order_surface(result, mesh.position)[0]


def _turn_back(
    barycentric: Vectors, ordered: Surface, face: Indices, surface: Surface, old_face: Indices
) -> Vectors:
    """Weights (n, 3) in the corners of the ordered faces (n,) as those of the input's own faces (n,)."""
    begins = ordered.vertices[ordered.faces[face, 0]][:, None]
    corner = np.argmax(np.all(surface.vertices[surface.faces[old_face]] == begins, axis=2), axis=1)
    return np.take_along_axis(barycentric, (np.arange(3) - corner[:, None]) % 3, axis=1)


def _rounded(points: Vectors) -> Vectors:
    return np.round(points / _QUANTUM) * _QUANTUM


def _require_limit(
    vertices: Vectors,
    faces: Indices,
    areas: Vectors,
    edge_length: float,
    size: float,
    parameters: RemeshParameters,
) -> None:
    """Refuse what the first splits would blow up: long thin faces need as many as their length asks for."""
    corners = vertices[faces]
    longest = np.max([np.linalg.norm(corners[:, i] - corners[:, i - 1], axis=1) for i in range(3)], axis=0)

    def needed(length: float) -> float:
        return float(np.sum(areas) / (0.2 * length**2) + np.sum(2.0 * longest / length))

    limit = max(parameters.face_limit, 8 * parameters.faces)
    if needed(edge_length) <= limit:
        return
    fits = edge_length
    while needed(fits) > limit:
        fits *= 1.1
    raise LimitError(
        f"edges of {edge_length * size:.3g} split the long faces of this model into about "
        f"{needed(edge_length):.2g} faces, more than {limit}",
        remedy=f"ask for fewer faces, so that edges are {fits * size:.3g} long or longer",
    )


def _stream(seed: int, name: str) -> np.random.Generator:
    """The random numbers of one named purpose."""
    return np.random.Generator(np.random.PCG64([seed, zlib.crc32(name.encode())]))


def _iterate(
    mesh: EditableMesh,
    features: Features,
    source: InputSurface,
    edge_length: float,
    parameters: RemeshParameters,
) -> EditableMesh:
    random = _stream(parameters.seed, "remesh")
    mesh = _shuffle(mesh, features, source, edge_length, random)
    mesh = order_along_curve(compact(mesh))
    length = edge_length
    parts = find_flat_parts(
        source.normals, face_areas(source.vertices, source.faces), source.twin, edge_length
    )
    for number in range(parameters.iterations):
        mesh = _split(mesh, features, length * _SPLIT, length * _SPLIT, random)
        mesh = _collapse(mesh, features, source, length, random)
        mesh = _remove_poor_faces(mesh, features, source, length)
        mesh = _mend(mesh, features, source, edge_length, 2)
        mesh = order_along_curve(mesh)  # splits append vertices far from their neighbours
        length *= float(np.clip(np.sqrt(mesh.count[1] / parameters.faces), 0.9, 1.1))
        flip_edges(mesh, source.normals, 10, _REGULARITY)
        for _ in range(2):
            _relax(mesh, features, source, edge_length)
            flip_edges(mesh, source.normals, 5, _REGULARITY)
        if number in (parameters.iterations // 3, parameters.iterations // 2):
            _release_poor_creases(mesh, features, edge_length)
        if number >= parameters.iterations // 2:
            balance_directions(mesh, features, source.normals, parts, edge_length, _REGULARITY, random)
    return _meet_count(mesh, features, source, length, edge_length, parameters.faces)


def _start(features: Features, source: InputSurface) -> EditableMesh:
    """The input with its features, to be edited."""
    return make_editable_mesh(
        source.vertices, source.faces, features.crease, features.vertex_chain, features.vertex_arc
    )


def _keep_degenerate_components(
    mesh: EditableMesh, features: Features, source: InputSurface
) -> tuple[EditableMesh, int]:
    """Components in which degenerate faces are left become what they were, if they had none; how many."""
    component = source.component[mesh.source]
    worst, worst_before = (np.ones(source.component.max() + 1) for _ in range(2))
    np.minimum.at(worst, component, face_shapes(mesh))
    if worst.min() >= DEGENERATE:
        return mesh, 0
    untouched = _start(features, source)
    np.minimum.at(worst_before, source.component, face_shapes(untouched))
    kept = (worst < DEGENERATE) & (worst_before >= DEGENERATE)
    if not kept.any():
        return mesh, 0
    mesh = join_meshes(drop_faces(mesh, kept[component]), drop_faces(untouched, ~kept[source.component]))
    return mesh, int(kept.sum())


def _shuffle(
    mesh: EditableMesh,
    features: Features,
    source: InputSurface,
    edge_length: float,
    random: np.random.Generator,
) -> EditableMesh:
    """Split at random until no edge is long, inner edges further: nothing is left of the input's pattern."""
    is_due = np.ones(3 * int(mesh.count[1]), np.bool_)
    for _ in range(_MOST_SHUFFLES):
        before = int(mesh.count[0])
        mesh = _split(mesh, features, _SHUFFLE * edge_length, _SPLIT * edge_length, random)
        if int(mesh.count[0]) == before:
            break
        is_due = np.concatenate([is_due, np.zeros(3 * int(mesh.count[1]) - len(is_due), np.bool_)])
        mark_edges_about_new(before, mesh, is_due)
        flip_edges(mesh, source.normals, 3, 0.0, is_due)
    return mesh


def _split(
    mesh: EditableMesh, features: Features, inner: float, along: float, random: np.random.Generator
) -> EditableMesh:
    """Split inner edges longer than `inner`, features longer than `along`, at random, in random order."""
    length = edge_lengths(mesh)
    limit = np.where(mesh.crease[: len(length)] >= 0, along, inner)
    chosen = random.permutation(np.flatnonzero(length > limit).astype(np.int32))
    ratios = random.uniform(0.3, 0.7, len(chosen))
    mesh = reserve(mesh, len(chosen))
    _split_all(chosen, ratios, inner, along, mesh, features)
    return mesh


def _collapse(
    mesh: EditableMesh, features: Features, source: InputSurface, length: float, random: np.random.Generator
) -> EditableMesh:
    """Collapse edges far shorter than `length` in random order, where no edge becomes far longer."""
    lengths = edge_lengths(mesh)
    chosen = random.permutation(
        np.flatnonzero((lengths >= 0) & (lengths < _COLLAPSE * length)).astype(np.int32)
    )
    _collapse_all(chosen, _COLLAPSE * length, _SPLIT * length, mesh, features, source.normals)
    return compact(mesh)


def _split_all(
    chosen: Indices, ratios: Vectors, inner: float, along: float, mesh: EditableMesh, features: Features
) -> None:
    for part in in_slices(len(chosen)):
        split_pass(chosen[part], ratios[part], inner, along, mesh, features)


def _collapse_all(
    chosen: Indices, limit: float, longest: float, mesh: EditableMesh, features: Features, normals: Vectors
) -> None:
    for part in in_slices(len(chosen)):
        collapse_pass(chosen[part], limit, longest, mesh, features, normals)


def _meet_count(
    mesh: EditableMesh,
    features: Features,
    source: InputSurface,
    length: float,
    edge_length: float,
    faces: int,
) -> EditableMesh:
    """Collapse the shortest edges or split the longest ones until about the wanted number of faces is met."""
    for _ in range(_FINAL_ROUNDS):
        mesh = _remove_poor_faces(mesh, features, source, length)
        surplus = (int(mesh.count[1]) - faces) // 2
        lengths = edge_lengths(mesh)
        inner = np.flatnonzero((lengths >= 0) & (mesh.crease[: len(lengths)] < 0)).astype(np.int32)
        by_length = inner[np.argsort(lengths[inner], kind="stable")]
        if surplus > 0:
            chosen = by_length[:surplus]
            _collapse_all(chosen, np.inf, _LONGEST * length, mesh, features, source.normals)
            mesh = compact(mesh)
        elif surplus < 0:
            chosen = by_length[surplus:]
            mesh = reserve(mesh, len(chosen))
            _split_all(chosen, np.full(len(chosen), 0.5), 0.0, 0.0, mesh, features)
        for _ in range(2):
            flip_edges(mesh, source.normals, 5, _REGULARITY)
            _relax(mesh, features, source, edge_length)
    mesh = _mend(compact(mesh), features, source, edge_length, _MEND_ROUNDS)
    _fit(mesh, features, source, edge_length)
    return mesh


def _remove_poor_faces(
    mesh: EditableMesh, features: Features, source: InputSurface, length: float
) -> EditableMesh:
    """Collapse the shortest edge of poor triangles, whatever its length."""
    poor = np.flatnonzero(face_shapes(mesh) < _POOR)
    lengths = edge_lengths(mesh)
    half_edges = 3 * poor[:, None] + np.arange(3)
    half_edges = np.maximum(half_edges, mesh.twin[half_edges])
    shortest = half_edges[np.arange(len(poor)), np.argmin(lengths[half_edges], axis=1)]
    chosen = np.unique(shortest).astype(np.int32)
    _collapse_all(chosen, np.inf, _LONGEST * length, mesh, features, source.normals)
    return compact(mesh)


def _fit(mesh: EditableMesh, features: Features, source: InputSurface, edge_length: float) -> None:
    """Bring vertices to tips and ridges that the mesh misses, and smooth about them."""
    used = source.vertices[np.unique(source.faces)]
    diagonal = float(np.linalg.norm(used.max(axis=0) - used.min(axis=0)))
    if _FIT_LENGTH * edge_length > _FIT_TOLERANCE * diagonal:
        return  # so coarse a mesh misses most bends, and following them would only make it uneven
    tolerance = _FIT_TOLERANCE * diagonal
    points, below = sample_bends(source, edge_length)
    near = np.zeros(len(points), np.int32)
    held = np.zeros(len(mesh.half_edge), np.bool_)
    for number in range(_FIT_ROUNDS):
        distance, near = distances_to(mesh, points, near)
        if number == 0:
            watched = distance > 0.5 * tolerance
            points, distance = points[watched], distance[watched]
            below, near = below[watched], near[watched]
        far = np.flatnonzero(distance > tolerance)
        room = int(_FIT_SHARE * len(held)) - int(held.sum())
        far = far[np.argsort(-distance[far], kind="stable")][: max(room, 0)]
        if len(far) == 0:
            break
        snap_pass(points[far], below[far], near[far], held, mesh, source.normals)
        flip_nearer(mesh, source, _FLIP_SHARE * tolerance)
        if number < _FIT_ROUNDS - 2:
            chain = mesh.chain.copy()
            mesh.chain[held & (chain == FREE)] = _HELD
            _relax(mesh, features, source, edge_length)
            mesh.chain[:] = chain
    flip_nearer(mesh, source, _FLIP_SHARE * tolerance)


def _mend(
    mesh: EditableMesh, features: Features, source: InputSurface, edge_length: float, rounds: int
) -> EditableMesh:
    """Remove degenerate and folded faces; after two rounds creases that hold them are given up."""
    for number in range(rounds):
        bad = np.flatnonzero(find_bad_faces(mesh, fan_normals(mesh))).astype(np.int32)
        if len(bad) == 0:
            break
        if number >= 2 and len(features.first):
            release_around(mesh, features, bad)
        mend_pass(bad, (_JOINED if number < 5 else 5 * _JOINED) * edge_length, mesh)
        mesh = compact(mesh)
    return mesh


def _relax(mesh: EditableMesh, features: Features, source: InputSurface, edge_length: float) -> None:
    """Smooth once and project on the input."""
    count = int(mesh.count[0])
    normal = fan_normals(mesh)
    goal, arc = np.zeros((count, 3)), np.zeros(count)
    smooth(mesh, features, normal, edge_length, _SPRING, goal, arc)
    free = np.flatnonzero(mesh.chain[:count] == FREE)
    if len(free):
        start = mesh.half_edge[free] // 3
        face, goal[free] = source.project(goal[free], normal[free], mesh.source[start])
        mesh.source[start] = face
    apply_moves(mesh, features, source.normals, goal, arc)


def _release_poor_creases(mesh: EditableMesh, features: Features, edge_length: float) -> None:
    """Give up short creases that force poor triangles: lines nearer than the new edges are no features."""
    if len(features.first) == 0:
        return
    poor = face_shapes(mesh) < _POOR
    beside = mesh.chain[mesh.tail[: 3 * int(mesh.count[1])]].reshape(-1, 3)[poor].reshape(-1)
    along = mesh.crease[: 3 * int(mesh.count[1])].reshape(-1, 3)[poor].reshape(-1)
    chains = np.zeros(len(features.first), np.bool_)
    chains[beside[beside >= 0]] = True
    chains[along[along >= 0]] = True
    length = features.arc[features.offset[1:] - 1]
    chains &= ~features.kept & (length < _SHORT_CREASE * edge_length)
    if chains.any():
        release_chains(mesh, chains)


def _find_places(mesh: EditableMesh, features: Features, source: InputSurface) -> tuple[Indices, Vectors]:
    """The input's face (n,) under each vertex, and the weights of its corners (n, 3)."""
    normal = fan_normals(mesh)
    hint = mesh.source[mesh.half_edge // 3]
    face, point = source.project(mesh.position, normal, hint)
    held = mesh.chain != FREE
    face[held], point[held] = source.closest(mesh.position[held], hint[held])
    return face, barycentric_of(point, source.vertices[source.faces[face]])
