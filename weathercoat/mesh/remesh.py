"""Isotropic, homogeneous and random remeshing.

The loop is that of Botsch and Kobbelt, A remeshing approach to multiresolution modeling, 2004: split long edges,
collapse short ones, flip to Delaunay, smooth in the tangent plane and project on the input. What is added: the first splits are
at random places in random order, so that no grid or strip of the input shows in the directions of the new edges (cracks run
along them); features are chains that their vertices slide on; and the number of faces is met by feedback.

Everything happens in the frame of the shape with coordinates rounded there, so that moving, scaling, turning or
renumbering the input does not change the result by more than its last digits.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace

import numpy as np

from weathercoat.mesh.connectivity import FREE, EditableMesh, compact, make_editable_mesh, reserve
from weathercoat.mesh.creases import Features, find_features
from weathercoat.mesh.edits import candidates_of, collapse_pass, edge_lengths, flip_to_delaunay, split_pass
from weathercoat.mesh.frame import make_frame
from weathercoat.mesh.halfedge import make_twins
from weathercoat.mesh.order import order_surface
from weathercoat.mesh.smoothing import apply_moves, fan_normals, smooth
from weathercoat.mesh.surface import Indices, Place, Surface, Vectors, face_normals

_QUANTUM = (
    1.0471e-10  # to which positions in the frame are rounded; no simple fraction, so that none lies half-way
)
_SPLIT, _COLLAPSE = 4.0 / 3.0, 4.0 / 5.0  # of the target length


@dataclass(frozen=True)
class RemeshParameters:
    """How to remesh.

    faces: number of triangles wanted, met within 2 % where the shape allows it. crease_angle: edges that bend by more
    [degrees] are kept as lines, short ones of a noisy scan excepted. iterations: rounds of the loop, more of them give more even
    triangles. seed: of the random splits. face_limit: more faces than this are refused.
    """

    faces: int = 10_000
    crease_angle: float = 30.0
    iterations: int = 12
    seed: int = 0
    face_limit: int = 5_000_000


class _Input:
    """The input in its frame: what new vertices are projected on."""

    def __init__(self, vertices: Vectors, faces: Indices) -> None:
        import igl

        self.vertices, self.faces = vertices, faces
        normal = face_normals(vertices, faces)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        self.normals = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
        self.component = igl.facet_components(faces.astype(np.int64))[1]
        self._faces = faces.astype(np.int64)
        self._tree = igl.AABB()
        self._tree.init(vertices, self._faces)

    def closest(self, points: Vectors) -> tuple[Indices, Vectors]:
        """The nearest input face (k,) and the nearest point on it (k, 3)."""
        _, face, point = self._tree.squared_distance(self.vertices, self._faces, points)
        return face.astype(np.int32), point


def remesh(surface: Surface, parameters: RemeshParameters) -> Surface:
    """The surface in isotropic, even, randomly oriented triangles, about `parameters.faces` of them.

    The input must be an oriented manifold, with boundaries or without. Its components, their topology, creases, boundaries
    and borders of groups are kept; `place` tells where each vertex lies on the input.
    Raises LimitError where the shape needs more faces than the limit, ValueError where the input is no manifold.
    """
    frame = make_frame(surface)
    local = np.round(frame.localise(surface.vertices) / _QUANTUM) * _QUANTUM
    ordered, old_face = order_surface(replace(surface, uv=None, colors=None), local)
    local = np.round(frame.localise(ordered.vertices) / _QUANTUM) * _QUANTUM
    source = _Input(local, ordered.faces)
    edge_length = float(np.sqrt(4.0 * _area(local, ordered.faces) / (np.sqrt(3.0) * parameters.faces)))
    features = find_features(
        local,
        ordered.faces,
        make_twins(ordered.faces),
        ordered.face_group,
        float(np.radians(parameters.crease_angle)),
        edge_length,
    )
    mesh = make_editable_mesh(
        local, ordered.faces, features.crease, features.vertex_chain, features.vertex_arc
    )
    mesh = _iterate(mesh, features, source, edge_length, parameters)
    result, _ = order_surface(_make_result(mesh, features, source, surface, ordered, old_face), mesh.position)
    return result


def _area(vertices: Vectors, faces: Indices) -> float:
    return float(0.5 * np.linalg.norm(face_normals(vertices, faces), axis=1).sum())


def _stream(seed: int, name: str) -> np.random.Generator:
    """The random numbers of one named purpose."""
    return np.random.Generator(np.random.PCG64([seed, zlib.crc32(name.encode())]))


def _iterate(
    mesh: EditableMesh, features: Features, source: _Input, edge_length: float, parameters: RemeshParameters
) -> EditableMesh:
    random = _stream(parameters.seed, "remesh")
    mesh = _shuffle(mesh, features, source, edge_length, random, parameters.face_limit)
    length = edge_length
    for round_number in range(parameters.iterations):
        mesh = _split(mesh, features, length * _SPLIT, length * _SPLIT, random)
        mesh = _collapse(mesh, features, source, length * _COLLAPSE, length * _SPLIT, random)
        count = int(mesh.count[1])
        length *= np.clip(np.sqrt(count / parameters.faces), 0.9, 1.1)
        flip_to_delaunay(mesh, source.normals, 10)
        for _ in range(2):
            _relax(mesh, features, source, edge_length)
            flip_to_delaunay(mesh, source.normals, 5)
    return mesh


def _shuffle(
    mesh: EditableMesh,
    features: Features,
    source: _Input,
    edge_length: float,
    random: np.random.Generator,
    face_limit: int,
) -> EditableMesh:
    """Split at random until no edge is long, inner edges further, so that nothing is left of the input's pattern."""
    while True:
        before = int(mesh.count[1])
        mesh = _split(mesh, features, 0.7 * edge_length, _SPLIT * edge_length, random)
        if int(mesh.count[1]) == before:
            return mesh
        flip_to_delaunay(mesh, source.normals, 3)


def _split(
    mesh: EditableMesh, features: Features, inner: float, along: float, random: np.random.Generator
) -> EditableMesh:
    """Split inner edges longer than `inner` and features longer than `along` at random places in random order."""
    length = edge_lengths(mesh)
    limit = np.where(mesh.crease[: len(length)] >= 0, along, inner)
    chosen = candidates_of(length, length > limit, random)
    ratios = random.uniform(0.3, 0.7, len(chosen))
    mesh = reserve(mesh, len(chosen))
    split_pass(chosen, ratios, inner, along, mesh, features)
    return mesh


def _collapse(
    mesh: EditableMesh,
    features: Features,
    source: _Input,
    limit: float,
    longest: float,
    random: np.random.Generator,
) -> EditableMesh:
    """Collapse edges shorter than `limit` in random order, where no edge becomes longer than `longest`."""
    length = edge_lengths(mesh)
    chosen = candidates_of(length, length < limit, random)
    collapse_pass(chosen, limit, longest, len(chosen), mesh, features, source.normals)
    return compact(mesh)


def _relax(
    mesh: EditableMesh, features: Features, source: _Input, edge_length: float, spring: float = 0.0
) -> None:
    """Smooth once and project on the input."""
    count = int(mesh.count[0])
    normal = fan_normals(mesh)
    goal, arc = np.empty((count, 3)), np.empty(count)
    smooth(mesh, features, normal, edge_length, spring, goal, arc)
    allowed = np.ones(count, np.bool_)
    free = np.flatnonzero(mesh.chain[:count] == FREE)
    if len(free):
        hint = mesh.source[mesh.half_edge[free] // 3]
        face, point = source.closest(goal[free])
        facing = np.einsum("ij,ij->i", source.normals[face], normal[free])
        allowed[free] = (facing > 0.0) & (source.component[face] == source.component[hint])
        goal[free] = point
        mesh.source[mesh.half_edge[free[allowed[free]]] // 3] = face[allowed[free]]
    apply_moves(mesh, features, source.normals, goal, arc, allowed)


def _make_result(
    mesh: EditableMesh,
    features: Features,
    source: _Input,
    surface: Surface,
    ordered: Surface,
    old_face: Indices,
) -> Surface:
    count = int(mesh.count[0])
    face, point = source.closest(mesh.position[:count])
    barycentric = _barycentric(point, source.vertices[source.faces[face]])
    vertices = np.einsum("ij,ijk->ik", barycentric, ordered.vertices[ordered.faces[face]])
    return replace(
        surface,
        vertices=vertices,
        faces=mesh.tail.reshape(-1, 3).copy(),
        face_group=ordered.face_group[mesh.source],
        uv=None,
        colors=None,
        place=Place(old_face[face], barycentric),
    )


def _barycentric(points: Vectors, corners: Vectors) -> Vectors:
    """Weights (k, 3) of the points (k, 3) in the triangles (k, 3, 3), which they lie on."""
    u, v, w = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    uu, uv, vv = (np.einsum("ij,ij->i", x, y) for x, y in ((u, u), (u, v), (v, v)))
    wu, wv = np.einsum("ij,ij->i", w, u), np.einsum("ij,ij->i", w, v)
    area = uu * vv - uv * uv
    safe = np.where(area > 0, area, 1.0)
    second = np.clip(np.where(area > 0, (vv * wu - uv * wv) / safe, 0.0), 0.0, 1.0)
    third = np.clip(np.where(area > 0, (uu * wv - uv * wu) / safe, 0.0), 0.0, 1.0 - second)
    return np.stack([1.0 - second - third, second, third], axis=1)
