"""Balance of the directions of edges on flat parts.

An even triangulation is a patchwork of grains, in each of which edges have the same three directions. On a
small flat part there are few grains, and chance alone leaves the part with a preferred direction. The order
ψ = Σ exp(6 i θ) / edges over the directions θ of a part's edges measures it; here discs of vertices are
turned in their plane until the sum is small. The smoothing that follows closes the seams.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.connectivity import FREE, EditableMesh
from weathercoat.mesh.creases import Features
from weathercoat.mesh.edits import flip_edges
from weathercoat.mesh.halfedge import next_of, prev_of
from weathercoat.mesh.smoothing import apply_moves
from weathercoat.mesh.surface import Indices, Vectors

_FLAT = 1e-4  # faces belong to one flat part where their normals differ by less [rad]
_LEAST_FACES = 800.0  # smaller parts are not balanced
_RADII = (4.0, 2.5)  # of the discs, in edge lengths; small ones where no large one fits or is left
_BALANCED = 0.01  # order at which a part is left alone
_LEAST_GAIN = 1.2  # of a disc's own sum, by which turning it must lessen that of its part; 2 is the most
_STEP = np.radians(2.5)  # per turn, so that flips can follow


class FlatParts(NamedTuple):
    """label: int32 (m,), the flat part of each input face or -1; axes: (k, 2, 3), unit vectors in it."""

    label: Indices
    axes: Vectors


def find_flat_parts(normals: Vectors, areas: Vectors, twin: Indices, edge_length: float) -> FlatParts:
    """Flat parts, large for that edge length, of an input with unit normals (m, 3) and areas (m,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    h = np.flatnonzero(np.arange(len(twin)) < twin)
    a, b = h // 3, twin[h] // 3
    bend = np.linalg.norm(normals[a] - normals[b], axis=1)
    a, b = a[bend < _FLAT], b[bend < _FLAT]
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(len(areas), len(areas)))
    part = connected_components(graph, directed=False)[1]
    total = np.bincount(part, areas)
    large = np.flatnonzero(total >= _LEAST_FACES * 0.25 * np.sqrt(3.0) * edge_length**2)
    number = np.full(len(total), -1, np.int32)
    number[large] = np.arange(len(large), dtype=np.int32)
    axes = np.empty((len(large), 2, 3))
    for k, label in enumerate(large):
        normal = normals[np.argmax(np.where(part == label, areas, 0.0))]
        seed = np.zeros(3)
        seed[np.argmin(np.abs(normal))] = 1.0
        axes[k, 0] = np.cross(normal, seed) / np.linalg.norm(np.cross(normal, seed))
        axes[k, 1] = np.cross(normal, axes[k, 0])
    return FlatParts(number[part], axes)


def balance_directions(
    mesh: EditableMesh,
    features: Features,
    normals: Vectors,
    parts: FlatParts,
    edge_length: float,
    regularity: float,
    random: np.random.Generator,
) -> None:
    """Turn discs in flat parts that have a preferred direction; `regularity` is that of `flip_edges`."""
    count = int(mesh.count[0])
    turn, centre = np.zeros(count), np.zeros((count, 3))
    part = parts_of_vertices(mesh, parts.label)
    part[mesh.chain[:count] != FREE] = -1
    radii = edge_length * np.array(_RADII)
    for k in range(len(parts.axes)):
        inside = random.permutation(np.flatnonzero(part == k).astype(np.int32))
        choose_turns(inside, k, part, parts.label, parts.axes[k], radii, mesh, turn, centre)
    steps = int(np.ceil(np.abs(turn).max(initial=0.0) / _STEP))
    arc = mesh.arc[:count]
    moved = turn != 0
    axes = parts.axes[part[moved]]
    for _ in range(steps):
        goal = mesh.position[:count].copy()
        offset = goal[moved] - centre[moved]
        x, y = (np.einsum("ij,ij->i", offset, axes[:, i])[:, None] for i in range(2))
        cosine, sine = (f(turn[moved] / steps)[:, None] for f in (np.cos, np.sin))
        goal[moved] += ((cosine - 1) * x - sine * y) * axes[:, 0] + (sine * x + (cosine - 1) * y) * axes[:, 1]
        apply_moves(mesh, features, normals, goal, arc)
        flip_edges(mesh, normals, 3, regularity)


@kernel
def parts_of_vertices(mesh: EditableMesh, label: Indices) -> Indices:
    """The flat part that all faces of a vertex lie in, or -1, int32 (n,)."""
    part = np.full(mesh.count[0], -2, np.int32)
    for f in range(mesh.count[1]):
        own = label[mesh.source[f]]
        for h in range(3 * f, 3 * f + 3):
            v = mesh.tail[h]
            part[v] = own if part[v] == -2 or part[v] == own else -1
    return part


@kernel
def sixfold(h: int, axes: Vectors, mesh: EditableMesh) -> complex:
    """exp(6 i θ) of the direction θ of h in the plane of the axes (2, 3)."""
    a, b = mesh.tail[h], mesh.tail[next_of(h)]
    x = y = 0.0
    for axis in range(3):
        step = mesh.position[b, axis] - mesh.position[a, axis]
        x += step * axes[0, axis]
        y += step * axes[1, axis]
    z = complex(x, y) / max(np.hypot(x, y), 1e-300)
    return z**6


@kernel
def choose_turns(
    candidates: Indices,
    k: int,
    part: Indices,
    label: Indices,
    axes: Vectors,
    radii: Vectors,
    mesh: EditableMesh,
    turn: Vectors,
    centre: Vectors,
) -> None:
    """Write to `turn` (n,) the angle by which vertices of part k should turn about their `centre` (n, 3)."""
    total = complex(0.0, 0.0)
    edges = 0
    for h in range(3 * mesh.count[1]):
        if mesh.twin[h] < h and label[mesh.source[h // 3]] == k:
            total += sixfold(h, axes, mesh)
            edges += 1
    taken = np.zeros(mesh.count[0], np.bool_)
    disc = np.empty(len(candidates), np.int32)
    inside = np.zeros(mesh.count[0], np.bool_)
    for trial in range(len(radii) * len(candidates)):
        if abs(total) < _BALANCED * edges:
            break
        i = trial % len(candidates)
        size = gather_disc(candidates[i], k, radii[trial // len(candidates)], part, taken, mesh, disc, inside)
        own = complex(0.0, 0.0)
        for j in range(size):
            first = mesh.half_edge[disc[j]]
            h = first
            while True:
                u = mesh.tail[next_of(h)]
                if inside[u] and u > disc[j]:
                    own += sixfold(h, axes, mesh)
                h = mesh.twin[prev_of(h)]
                if h == first:
                    break
        for j in range(size):
            inside[disc[j]] = False
        rest = total - own
        after = abs(abs(rest) - abs(own))
        if size == 0 or abs(total) - after < _LEAST_GAIN * abs(own):
            continue
        phase = np.angle(-rest / own)
        total = rest + own * complex(np.cos(phase), np.sin(phase))
        for j in range(size):
            v = disc[j]
            taken[v] = True
            turn[v] = phase / 6.0
            centre[v] = mesh.position[candidates[i]]


@kernel
def gather_disc(
    start: int,
    k: int,
    radius: float,
    part: Indices,
    taken: NDArray[np.bool_],
    mesh: EditableMesh,
    disc: Indices,
    inside: NDArray[np.bool_],
) -> int:
    """Write the vertices within `radius` of `start` to `disc`; 0 where not all are free ones of part k."""
    p = mesh.position
    disc[0] = start
    inside[start] = True
    size, done, whole = 1, 0, not taken[start]
    while done < size and whole:
        v = disc[done]
        done += 1
        first = mesh.half_edge[v]
        h = first
        while True:
            u = mesh.tail[next_of(h)]
            if not inside[u]:
                d = (p[u, 0] - p[start, 0]) ** 2 + (p[u, 1] - p[start, 1]) ** 2 + (p[u, 2] - p[start, 2]) ** 2
                if d < radius * radius:
                    if part[u] != k or taken[u]:
                        whole = False
                        break
                    disc[size] = u
                    inside[u] = True
                    size += 1
            h = mesh.twin[prev_of(h)]
            if h == first:
                break
    if whole:
        return size
    for j in range(size):
        inside[disc[j]] = False
    return 0
