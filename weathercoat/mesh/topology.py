"""Which faces meet where: twins, one orientation for each component, and the vertices that this leaves.

Half-edge h = 3 f + i runs from corner i of face f to the next. All functions take and return plain arrays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.buckets import compact_indices
from weathercoat.mesh.pairing import pair_half_edges

Ints = NDArray[np.integer]
Indices = NDArray[np.int32]
Faces = NDArray[np.int32]
Points = NDArray[np.float64]


@dataclass
class Orientation:
    """One orientation a component.

    twin: (3 m,) after cutting; component: (m,); flipped: (m,) faces to turn around; cut: edges where a
    component that cannot be oriented was opened; components_cut: how many components that concerns.
    """

    twin: Indices
    component: Indices
    flipped: NDArray[np.bool_]
    cut: int
    components_cut: int


def match_twins(vertices: Points, faces: Faces) -> tuple[Indices, Ints]:
    """The half-edge on the other side of each, (3 m,), -1 at a boundary; one half-edge of each crowded edge.

    Crowded are edges of more than two faces. The faces around one are paired two by two: first those that
    agree in orientation, the straightest first; what is left over ends there, and so do all faces around an
    edge of more than 64.
    """
    twin, beyond, _ = pair_half_edges(np.ascontiguousarray(faces), len(vertices))
    crowded = np.unique(beyond[:, 0])
    if len(crowded):
        number = np.arange(len(crowded))
        edge = np.concatenate([number, number, np.searchsorted(crowded, beyond[:, 0])])
        around = np.concatenate([crowded, twin[crowded], beyond[:, 1]])[np.argsort(edge, kind="stable")]
        count = np.bincount(edge)
        twin[around] = -1
        _pair(vertices, faces, around, np.cumsum(count) - count, count, twin)
    return twin, crowded


def orient(vertices: Points, faces: Faces, twin: Indices) -> Orientation:
    """One orientation for each component: outward where it is closed, else that of the greater area.

    A component that cannot be oriented is cut along the edges where its orientations meet.
    """
    twin = twin.copy()
    component = np.full(len(faces), -1, np.int32)
    turned = np.zeros(len(faces), np.bool_)
    queue = np.empty(len(faces), np.int32)
    components = _spread_orientation(faces, twin, component, turned, queue)
    cut_component = np.zeros(components, bool)
    contradicting = _contradictions(faces, twin, turned)
    cut_component[component[contradicting // 3]] = True
    other = twin[contradicting]
    twin[contradicting] = -1
    twin[other] = -1
    total, kept, volume = np.zeros(components), np.zeros(components), np.zeros(components)
    closed = np.ones(components, np.bool_)
    _measure_components(vertices, faces, twin, component, turned, total, kept, volume, closed)
    solid = closed & (np.abs(volume) > 1e-12 * total**1.5)
    turn_component = np.where(solid, volume < 0, kept < 0)
    return Orientation(
        twin=twin,
        component=component,
        flipped=turned ^ turn_component[component],
        cut=len(contradicting) // 2,
        components_cut=int(cut_component.sum()),
    )


def number_components(faces: Faces, twin: Indices) -> Indices:
    """The component of each face, from 0 in the order of their first faces, (m,)."""
    component = np.full(len(faces), -1, np.int32)
    turned, queue = np.zeros(len(faces), np.bool_), np.empty(len(faces), np.int32)
    _spread_orientation(faces, twin, component, turned, queue)
    return component


def split_vertices(vertex_count: int, faces: Faces, twin: Ints) -> tuple[Faces, NDArray[np.int64]]:
    """Faces in which every vertex has one fan: corners that no common edge joins get vertices of their own.

    Returns the faces (m, 3) and the old vertex of each new vertex; the first fan of a vertex keeps its
    number.
    """
    fan = np.arange(3 * len(faces), dtype=np.int32)
    _join_fans(faces, twin, fan)
    split = np.empty((len(faces), 3), np.int32)
    extra = _number_fans(faces, fan, vertex_count, split)
    return split, np.concatenate([np.arange(vertex_count), faces.ravel()[extra]])


def separate(
    vertex_count: int, faces: Faces, twin: Ints, flipped: NDArray[np.bool_]
) -> tuple[Faces, NDArray[np.int64]]:
    """Split vertices until no directed edge of the faces, turned where `flipped`, occurs twice.

    Cutting an edge is not enough where the fans at both of its ends still hold together around it: such an
    edge is opened for all of its faces, and where even that leaves two faces on one side of it, all but the
    first are set apart. Returns the faces, turned, and the old vertex of each new one. Then every edge has
    at most two faces, which agree, and every vertex one fan.
    """
    twin = twin.copy()
    while True:
        split, parent = split_vertices(vertex_count, faces, twin)
        split[flipped] = split[flipped][:, [0, 2, 1]]
        _, beyond, alike = pair_half_edges(split, len(parent))
        if not len(beyond) and not alike:
            return split, parent
        # Half-edge i of a turned face is half-edge 2 - i of the face as it was.
        tail = split.astype(np.int64)
        head = np.roll(tail, -1, axis=1)
        directed = tail * len(parent) + head
        directed[flipped] = directed[flipped][:, ::-1]
        directed = directed.ravel()
        order = np.argsort(directed, kind="stable")
        again = order[1:][directed[order][1:] == directed[order][:-1]]
        if not len(again):
            return split, parent
        reverse = directed % len(parent) * len(parent) + directed // len(parent)
        clash = np.isin(directed, directed[again]) | np.isin(reverse, directed[again])
        opened = np.flatnonzero(clash & (twin >= 0))
        if not len(opened):
            opened = (3 * (again // 3)[:, None] + np.arange(3)).ravel()
            opened = opened[twin[opened] >= 0]
        twin[twin[opened]] = -1
        twin[opened] = -1


def count_boundary_loops(faces: Faces, twin: Ints) -> int:
    """The number of closed chains of boundary edges, in faces whose vertices have one fan each."""
    boundary = np.flatnonzero(twin < 0)
    tail = faces.ravel()[boundary]
    head = np.roll(faces, -1, axis=1).ravel()[boundary]
    vertices, ends = compact_indices(np.stack([tail, head]), int(faces.max(initial=-1)) + 1)
    label = merged(len(vertices), ends)
    return int((label == np.arange(len(label))).sum())


def merged(vertex_count: int, pairs: Ints) -> Ints:
    """For each vertex the smallest of those that `pairs` (2, k) join it to, (n,)."""
    label = np.arange(vertex_count)
    _unite(label, pairs)
    while (label[label] != label).any():
        label = label[label]
    return label


@kernel
def dot(a, b):  # type: ignore[no-untyped-def]
    """Scalar product of two vectors (3,), without the BLAS that NumPy's own would call."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a, b):  # type: ignore[no-untyped-def]
    """Vector product (3,) of two vectors (3,)."""
    c = np.empty(3)
    c[0] = a[1] * b[2] - a[2] * b[1]
    c[1] = a[2] * b[0] - a[0] * b[2]
    c[2] = a[0] * b[1] - a[1] * b[0]
    return c


@kernel
def _pair(vertices, faces, half_edges, begin, count, twin):  # type: ignore[no-untyped-def]
    """Pair the half_edges[begin : begin + count] around each edge; sets entries of `twin`."""
    apex = np.empty((64, 3))
    forward = np.empty(64, np.bool_)
    for e in range(len(begin)):
        n = count[e]
        if n > 64:
            continue
        around = half_edges[begin[e] : begin[e] + n]
        h = around[0]
        tail = faces[h // 3, h % 3]
        a = vertices[tail]
        axis = vertices[faces[h // 3, (h % 3 + 1) % 3]] - a
        for i in range(n):
            h = around[i]
            forward[i] = faces[h // 3, h % 3] == tail
            arm = vertices[faces[h // 3, (h % 3 + 2) % 3]] - a
            arm = arm - axis * (dot(arm, axis) / dot(axis, axis))
            apex[i] = arm / np.sqrt(dot(arm, arm))
        for agreeing in (True, False):
            while True:
                best = 2.0
                left, right = -1, -1
                for i in range(n):
                    for j in range(i):
                        if (
                            twin[around[i]] >= 0
                            or twin[around[j]] >= 0
                            or (forward[i] != forward[j]) != agreeing
                        ):
                            continue
                        one, other = (apex[i], apex[j]) if forward[i] else (apex[j], apex[i])
                        # Of pairs that bend alike, ridges first: they keep two touching solids apart.
                        bend = dot(one, other)
                        if dot(axis, cross(one, other)) > 0:
                            bend += 1e-6
                        if bend < best:
                            best = bend
                            left, right = i, j
                if left < 0:
                    break
                twin[around[left]] = around[right]
                twin[around[right]] = around[left]


@kernel
def _agree(faces, h, t):  # type: ignore[no-untyped-def]
    """Whether two half-edges of one edge run in opposite directions, as those of neighbours should."""
    return faces[h // 3, h % 3] != faces[t // 3, t % 3]


@kernel
def _spread_orientation(faces, twin, component, turned, queue):  # type: ignore[no-untyped-def]
    """Number the components, and mark the faces turned against the first of theirs; breadth first."""
    components = 0
    for seed in range(len(faces)):
        if component[seed] >= 0:
            continue
        component[seed] = components
        queue[0] = seed
        head = 0
        tail = 1
        while head < tail:
            f = queue[head]
            head += 1
            for h in range(3 * f, 3 * f + 3):
                t = twin[h]
                if t >= 0 and component[t // 3] < 0:
                    component[t // 3] = components
                    turned[t // 3] = turned[f] ^ (not _agree(faces, h, t))
                    queue[tail] = t // 3
                    tail += 1
        components += 1
    return components


@kernel
def _contradictions(faces, twin, turned):  # type: ignore[no-untyped-def]
    """The half-edges, both of each edge, across which orientations differ after spreading."""
    found = np.zeros(len(twin), np.bool_)
    for h in range(len(twin)):
        t = twin[h]
        if t >= 0:
            found[h] = (turned[h // 3] ^ turned[t // 3]) == _agree(faces, h, t)
    return np.flatnonzero(found)


@kernel
def _measure_components(vertices, faces, twin, component, turned, total, kept, volume, closed):  # type: ignore[no-untyped-def]
    """Area of each component, that of its unturned faces less the rest, volume, and whether it is closed.

    Volumes are about the middle of each component, so that a far origin costs no digits.
    """
    middle = np.zeros((len(total), 3))
    size = np.zeros(len(total), np.int64)
    for f in range(len(faces)):
        c = component[f]
        size[c] += 1
        for k in range(3):
            middle[c, k] += _mean_of(vertices, faces, f, k)
            if twin[3 * f + k] < 0:
                closed[c] = False
    for c in range(len(total)):
        for k in range(3):
            middle[c, k] /= size[c]
    for f in range(len(faces)):
        c = component[f]
        normal = normal_of(vertices, faces[f, 0], faces[f, 1], faces[f, 2])
        area = 0.5 * np.sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2])
        sign = -1.0 if turned[f] else 1.0
        total[c] += area
        kept[c] += area * sign
        height = 0.0
        for k in range(3):
            height += (_mean_of(vertices, faces, f, k) - middle[c, k]) * normal[k]
        volume[c] += sign * height / 6.0


@kernel
def normal_of(vertices, a, b, c):  # type: ignore[no-untyped-def]
    """Normal of the triangle a, b, c of vertices (n, 3), with twice its area as length: three numbers."""
    ux, uy, uz = (
        vertices[b, 0] - vertices[a, 0],
        vertices[b, 1] - vertices[a, 1],
        vertices[b, 2] - vertices[a, 2],
    )
    vx, vy, vz = (
        vertices[c, 0] - vertices[a, 0],
        vertices[c, 1] - vertices[a, 1],
        vertices[c, 2] - vertices[a, 2],
    )
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@kernel
def _mean_of(vertices, faces, f, k):  # type: ignore[no-untyped-def]
    """Coordinate k of the centre of face f."""
    return (vertices[faces[f, 0], k] + vertices[faces[f, 1], k] + vertices[faces[f, 2], k]) / 3.0


@kernel
def _number_fans(faces, fan, vertex_count, split):  # type: ignore[no-untyped-def]
    """Write the vertices of the corners to `split` (m, 3); returns the first corners of the new vertices.

    The first fan of a vertex keeps its number, the others get new ones in the order of their first corners,
    `fan` (3 m,).
    """
    corner = faces.reshape(-1)
    number = split.reshape(-1)
    extra = np.empty(len(fan), np.int32)
    is_taken = np.zeros(vertex_count, np.bool_)
    added = 0
    for h in range(len(fan)):
        if fan[h] != h:
            number[h] = number[fan[h]]
        elif is_taken[corner[h]]:
            number[h] = vertex_count + added
            extra[added] = h
            added += 1
        else:
            is_taken[corner[h]] = True
            number[h] = corner[h]
    return extra[:added].copy()


@kernel
def _unite(label, pairs):  # type: ignore[no-untyped-def]
    """Union-find: `label` becomes a forest whose roots are the smallest of each set; pairs (2, k)."""
    for k in range(pairs.shape[1]):
        a, b = pairs[0, k], pairs[1, k]
        while label[a] != a:
            label[a] = label[label[a]]
            a = label[a]
        while label[b] != b:
            label[b] = label[label[b]]
            b = label[b]
        label[max(a, b)] = min(a, b)


@kernel
def _join_fans(faces, twin, fan):  # type: ignore[no-untyped-def]
    """Union-find over corners (3 m,): `fan` becomes the smallest corner of the fan around the same vertex."""
    for h in range(len(twin)):
        t = twin[h]
        if t < h:
            continue
        after_h = h - 2 if h % 3 == 2 else h + 1
        after_t = t - 2 if t % 3 == 2 else t + 1
        if faces[h // 3, h % 3] == faces[t // 3, t % 3]:
            pairs = ((h, t), (after_h, after_t))
        else:
            pairs = ((h, after_t), (after_h, t))
        for a, b in pairs:
            while fan[a] != a:
                fan[a] = fan[fan[a]]
                a = fan[a]
            while fan[b] != b:
                fan[b] = fan[fan[b]]
                b = fan[b]
            fan[max(a, b)] = min(a, b)
    for h in range(len(fan)):
        fan[h] = fan[fan[h]]
