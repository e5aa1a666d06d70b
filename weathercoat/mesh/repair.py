"""From the polygons of a file to an oriented manifold of triangles, with a note for each repair.

The order: triangles, weld, faces without area, duplicates, twins, orientation, split vertices. Everything
is linear in the faces or sorts them. Nothing is filled, moved or invented: positions of the result are
positions of the file.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.errors import (
    LimitError,
    NoAreaError,
    NoFacesError,
    NonFiniteError,
    Note,
    PrecisionError,
    ScaleError,
)
from weathercoat.mesh import topology
from weathercoat.mesh.buckets import compact_indices, order_rows
from weathercoat.mesh.formats.polygons import Polygons
from weathercoat.mesh.surface import Surface, face_normals
from weathercoat.mesh.topology import dot, normal_of
from weathercoat.mesh.triangulate import triangulate
from weathercoat.mesh.weld import SINGLE, weld

Points = NDArray[np.float64]
Faces = NDArray[np.int32]
Indices = NDArray[np.int64]

# A shape is refused where its coordinates resolve less than a thousandth of its diagonal.
MIN_RESOLUTION = 1e-3
# Between these diagonals, faces of a millionth of the size have areas that float32, in which results are
# written, can hold.
MIN_DIAGONAL, MAX_DIAGONAL = 1e-13, 1e13
# Height of a triangle over its longest edge below which it has no area: the rounding of float32 positions.
MIN_HEIGHT = SINGLE
# Shortest over longest edge below which a flat face is closed rather than flipped.
MAX_NEEDLE_RATIO = 1e-6
# Rounds of closing and flipping; each leaves far fewer flat faces, and what is left after them is dropped.
MAX_ROUNDS = 8
# A model is called soup where more than this share of its faces has no neighbour.
SOUP_SHARE = 0.5
_SAME_COLOR = 1.5 / 255.0
MIN_SOUP_FACES = 10


def repair(
    polygons: Polygons, *, up: tuple[float, float, float], name: str, format: str, max_faces: int
) -> Surface:
    """The surface of `polygons`: welded, oriented, at most two faces at an edge, one fan at a vertex.

    Errors: NoFacesError, NonFiniteError, PrecisionError, ScaleError, NoAreaError, LimitError.
    """
    notes = list(polygons.notes)
    if not len(polygons.sizes):
        raise NoFacesError(
            "all faces have illegal indices"
            if notes and notes[-1].code == "W-BADINDEX"
            else "the model has no faces"
        )
    triangle_count = int(np.maximum(polygons.sizes - 2, 0).sum())
    if triangle_count > max_faces:
        raise LimitError(f"the model has {triangle_count} triangles, the limit is {max_faces}")
    referenced = np.zeros(len(polygons.positions), bool)
    referenced[polygons.corners] = True
    notes += _drop_nonfinite(polygons)
    if not len(polygons.corners):
        raise NoAreaError("no face has a corner")
    is_used = np.zeros(len(polygons.positions), bool)
    is_used[polygons.corners] = True
    check_precision(polygons.positions[is_used], len(polygons.corners), polygons.single_precision)

    triangles, polygon = triangulate(polygons.positions, polygons.corners, polygons.sizes)
    too_small = int((polygons.sizes < 3).sum())
    many = int((polygons.sizes > 3).sum())
    if many:
        notes.append(Note("W-POLYGONS", many, f"polygons were cut into {triangle_count} triangles in all"))
    vertex, kept_vertices, welded = weld(polygons.positions, polygons.corners, polygons.part)
    if welded and polygons.shared:
        notes.append(Note("W-WELDED", welded, "vertices at the position of another were merged with it"))
    if not polygons.shared:
        referenced[:] = True
    unreferenced = int((~referenced).sum())
    if unreferenced:
        notes.append(Note("W-UNREFERENCED", unreferenced, "vertices that no face uses were dropped"))
    vertices = polygons.positions[kept_vertices]
    faces = vertex[triangles]
    given = [values[triangles] for values in (polygons.uv, polygons.normals) if values is not None]
    values = np.concatenate([np.zeros((len(faces), 3, 0)), *given], axis=2)
    if polygons.colors is not None:
        notes += _lost_colors(polygons, vertex, kept_vertices)
    face_group = (
        np.zeros(len(faces), np.int32) if polygons.face_group is None else polygons.face_group[polygon]
    )

    faces, values, source, degenerate = remove_degenerate(vertices, faces, values)
    if degenerate + too_small:
        notes.append(Note("W-DEGENERATE", degenerate + too_small, "faces without area were removed"))
    if not len(faces):
        raise NoAreaError("no face has an area")
    keep = first_of_duplicates(faces)
    if not keep.all():
        notes.append(Note("W-DUPLICATE", int((~keep).sum()), "faces on the vertices of another were dropped"))
        faces, source, values = faces[keep], source[keep], values[keep]

    faces, flipped, parent, more = make_oriented_manifold(vertices, faces)
    notes += more
    values[flipped] = values[flipped][:, [0, 2, 1]]
    uv = None if polygons.uv is None else np.ascontiguousarray(values[:, :, :2])
    normals = None
    if polygons.normals is not None:
        normals = _shading_normals(values[:, :, -3:], flipped, face_normals(vertices[parent], faces))
    used, compact = compact_indices(faces, len(parent))
    origin = kept_vertices[parent[used]]
    return Surface(
        vertices=polygons.positions[origin],
        faces=compact,
        face_group=face_group[source].astype(np.int32),
        groups=polygons.groups,
        uv=uv,
        normals=normals,
        face_part=None if polygons.face_part is None else polygons.face_part[polygon[source]],
        parts=polygons.parts,
        materials=polygons.materials,
        tree=polygons.tree,
        colors=None if polygons.colors is None else polygons.colors[origin],
        up=up,
        notes=tuple(notes),
        name=name,
        format=format,
    )


def _lost_colors(polygons: Polygons, vertex: Faces, kept: Indices) -> list[Note]:
    """Notes on vertices that were merged with another of another colour: the first one's counts."""
    assert polygons.colors is not None
    used = np.unique(polygons.corners)
    away = np.abs(polygons.colors[used] - polygons.colors[kept[vertex[used]]]).max(axis=1) > _SAME_COLOR
    text = "vertices have another colour than the one at their place that was kept"
    return [Note("W-COLORS", int(away.sum()), text)] if away.any() else []


def _shading_normals(
    normals: NDArray[np.float64], flipped: NDArray[np.bool_], facing: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Normals (m, 3, 3) of the corners, turned with the faces that were `flipped`; where there is none that
    of the face, which points along `facing` (m, 3).
    """
    turned = np.where(flipped[:, None, None], -normals, normals)
    flat = facing / np.linalg.norm(facing, axis=1, keepdims=True)
    length = np.linalg.norm(turned, axis=2, keepdims=True)
    return np.where(length > 0.5, turned / np.where(length > 0.5, length, 1.0), flat[:, None])


def check_precision(points: Points, corners: int, single_precision: bool) -> None:
    """Refuse points (k, 3) whose coordinates are too coarse for their extent, too large or too small.

    corners: how many corners of faces lie on them.

    Errors: PrecisionError, ScaleError, NoAreaError where all points coincide.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    with np.errstate(over="ignore"):
        diagonal = float(np.linalg.norm(high - low))
    largest = float(np.abs([low, high]).max())
    resolution = largest * SINGLE if single_precision else float(np.spacing(largest))
    if diagonal == 0.0 and (largest == 0.0 or corners == 3):
        raise NoAreaError("all vertices lie at one point")
    if resolution > MIN_RESOLUTION * diagonal:
        raise PrecisionError(
            f"coordinates near {largest:.3g} are stored to {resolution:.2g}, the model spans {diagonal:.3g}"
        )
    if not MIN_DIAGONAL <= diagonal <= MAX_DIAGONAL:
        raise ScaleError(
            f"the model spans {diagonal:.3g}; sizes from {MIN_DIAGONAL:g} to {MAX_DIAGONAL:g} are possible"
        )


def remove_degenerate(
    vertices: Points, faces: Faces, values: NDArray[np.float64]
) -> tuple[Faces, NDArray[np.float64], Indices, int]:
    """Remove the faces without area, and leave no crack where they were.

    A face with a repeated vertex is dropped. A needle, two of whose corners all but coincide, is closed by
    merging them. A cap, one of whose corners lies on the opposite edge, is flipped away with the neighbour
    across that edge, which so takes in the corner; at a boundary it is dropped. Returns faces, the
    values at their corners (m, 3, k), for each
    face the one whose attributes it has, and how many had no area.
    """
    source = np.arange(len(faces))
    degenerate = int((_has_repeats(faces) | is_flat(vertices, faces)).sum())
    if not degenerate:
        return faces, values, source, 0
    values = values.copy()
    for _ in range(MAX_ROUNDS):
        faces, values, source = _select(~_has_repeats(faces), faces, values, source)
        flat = np.flatnonzero(is_flat(vertices, faces))
        if not len(flat):
            break
        needles = flat[_edge_ratio(vertices, faces[flat]) <= MAX_NEEDLE_RATIO]
        if len(needles):
            faces = _merge_shortest(vertices, faces, needles)
        else:
            twin, _ = topology.match_twins(vertices, faces)
            _flip_flat(vertices, faces, twin, values, source, flat)
    faces, values, source = _select(~(_has_repeats(faces) | is_flat(vertices, faces)), faces, values, source)
    return faces, values, source, degenerate


def _select(
    keep: NDArray[np.bool_], faces: Faces, values: NDArray[np.float64], source: Indices
) -> tuple[Faces, NDArray[np.float64], Indices]:
    return faces[keep], values[keep], source[keep]


def _has_repeats(faces: Faces) -> NDArray[np.bool_]:
    a, b, c = faces.T
    return (a == b) | (b == c) | (c == a)


def _edge_lengths(vertices: Points, faces: Faces) -> Points:
    """Length of the edge that follows each corner, (m, 3)."""
    corner = vertices[faces]
    return np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2)  # type: ignore[no-any-return]


def _edge_ratio(vertices: Points, faces: Faces) -> Points:
    """Shortest edge of each face over its longest."""
    length = _edge_lengths(vertices, faces)
    return length.min(axis=1) / length.max(axis=1)  # type: ignore[no-any-return]


def _merge_shortest(vertices: Points, faces: Faces, needles: Indices) -> Faces:
    """Faces in which the ends of the shortest edge of each of `needles` are one vertex, the first of them."""
    side = np.argmin(_edge_lengths(vertices, faces[needles]), axis=1)
    ends = np.stack([faces[needles, side], faces[needles, (side + 1) % 3]]).astype(np.int64)
    return topology.merged(len(vertices), ends)[faces].astype(np.int32)


def is_flat(vertices: Points, faces: Faces) -> NDArray[np.bool_]:
    """Whether the corners of each face lie on a line: height at most `MIN_HEIGHT` of the longest edge."""
    flat = np.empty(len(faces), np.bool_)
    _find_flat(vertices, faces, flat)
    return flat


def first_of_duplicates(faces: Faces) -> NDArray[np.bool_]:
    """Whether each face is the first on its three vertices, whatever their order."""
    rows = np.sort(faces, axis=1)
    order = order_rows(rows, int(faces.max(initial=-1)) + 1)
    rows = rows[order]
    repeats = (rows[1:] == rows[:-1]).all(axis=1)
    keep = np.ones(len(faces), bool)
    keep[order[1:][repeats]] = False
    return keep


def make_oriented_manifold(
    vertices: Points, faces: Faces
) -> tuple[Faces, NDArray[np.bool_], Indices, list[Note]]:
    """Orient each component, and split edges of more than two faces and vertices of more than one fan.

    Returns the faces, which of them were turned around (their second and third corner are exchanged), the
    old vertex of each vertex, and notes on all of this and on boundaries, components and soup.
    """
    twin, crowded = topology.match_twins(vertices, faces)
    first = topology.orient(vertices, faces, twin)
    split, parent = topology.separate(len(vertices), faces, first.twin, first.flipped)
    if first.flipped.any() or len(parent) > len(vertices):
        # Cuts that turned out to separate nothing are closed again in the final twins, which may close a
        # component.
        final_twin, _ = topology.match_twins(vertices[parent], split)
        final = topology.orient(vertices[parent], split, final_twin)
    else:
        final_twin, final = twin, first
    boundary = int((final_twin < 0).sum())
    loops = topology.count_boundary_loops(split, final_twin)
    split[final.flipped] = split[final.flipped][:, [0, 2, 1]]
    flipped = first.flipped ^ final.flipped
    component_size = np.bincount(final.component)
    inverted = np.bincount(final.component, flipped) == component_size
    faces_inverted = int(component_size[inverted].sum())
    faces_flipped = int(flipped.sum()) - faces_inverted

    at_cut = np.zeros(len(vertices), bool)
    opened = np.flatnonzero((twin >= 0) & (first.twin < 0))
    for h in (crowded, opened):
        at_cut[faces[h // 3, h % 3]] = True
        at_cut[faces[h // 3, (h % 3 + 1) % 3]] = True
    pinched = np.unique(parent[len(vertices) :])
    pinched = pinched[~at_cut[pinched]]

    alone = int((final_twin.reshape(-1, 3) < 0).all(axis=1).sum())
    is_soup = len(faces) >= MIN_SOUP_FACES and alone > SOUP_SHARE * len(faces)
    cut = f"components have no two sides and were cut along {first.cut} edges"
    found = (
        ("W-NONMANIFOLD", len(crowded), "edges of more than two faces were split"),
        ("W-NONMANIFOLD-VERTEX", len(pinched), "vertices where fans of faces only touch were split"),
        ("W-NONORIENTABLE", first.components_cut, cut),
        ("W-FLIPPED", faces_flipped, "faces were turned to agree with their neighbours"),
        ("W-INVERTED", faces_inverted, "faces of components that were inside out were turned"),
        ("W-BOUNDARY", boundary, f"boundary edges in {loops} loops"),
        ("W-COMPONENTS", len(component_size) if len(component_size) > 1 else 0, "separate components"),
        ("W-SOUP", alone if is_soup else 0, "faces have no neighbour: the model is a triangle soup"),
    )
    return split, flipped, parent, [Note(code, count, text) for code, count, text in found if count]


def _drop_nonfinite(polygons: Polygons) -> list[Note]:
    """Drop the faces that use a position which is not finite."""
    broken = np.logical_not(np.isfinite(polygons.positions).all(axis=1))
    at_broken = broken[polygons.corners]
    if not at_broken.any():
        return []
    vertices = len(np.unique(polygons.corners[at_broken]))
    keep = np.ones(len(polygons.sizes), bool)
    keep[np.repeat(np.arange(len(polygons.sizes)), polygons.sizes)[at_broken]] = False
    dropped = int((~keep).sum())
    if not keep.any():
        raise NonFiniteError(f"all {dropped} faces have a position that is not finite")
    polygons.keep_faces(keep)
    return [Note("W-NONFINITE", vertices, f"vertices are not finite; {dropped} faces were dropped with them")]


@kernel
def _flip_flat(vertices, faces, twin, values, source, flat):  # type: ignore[no-untyped-def]
    """Flip the faces `flat` with their neighbours, in place; those that cannot be get vertex 0 three times.

    Flat faces that this makes are flipped in turn, but needles are left.
    """
    queue = list(flat)
    budget = 8 * len(flat)
    position = 0
    while position < len(queue):
        f = queue[position]
        position += 1
        longest = -1.0
        shortest = np.inf
        i = 0
        for k in range(3):
            edge = vertices[faces[f, (k + 1) % 3]] - vertices[faces[f, k]]
            shortest = min(shortest, dot(edge, edge))
            if dot(edge, edge) > longest:
                longest = dot(edge, edge)
                i = k
        if shortest <= MAX_NEEDLE_RATIO**2 * longest:
            continue
        t = twin[3 * f + i]
        p, b = faces[f, i], faces[f, (i + 2) % 3]
        if t < 0 or t // 3 == f or faces[t // 3, (t % 3 + 2) % 3] == b or position > budget:
            _detach(faces, twin, f)
            continue
        g, j = t // 3, t % 3
        # Seen from g its edge runs r to s and its apex is d; b lies between r and s.
        r, s, d = faces[g, j], faces[g, (j + 1) % 3], faces[g, (j + 2) % 3]
        along = vertices[s] - vertices[r]
        share = dot(vertices[b] - vertices[r], along) / longest
        value_r, value_s, value_d = (
            values[g, j].copy(),
            values[g, (j + 1) % 3].copy(),
            values[g, (j + 2) % 3].copy(),
        )
        value_b = value_r + share * (value_s - value_r)
        side_q = twin[3 * f + (i + 1) % 3]
        side_p = twin[3 * f + (i + 2) % 3]
        side_r, side_s = (side_p, side_q) if r == p else (side_q, side_p)
        beyond_s = twin[3 * g + (j + 1) % 3]
        beyond_r = twin[3 * g + (j + 2) % 3]
        # g becomes (r, b, d), f becomes (b, s, d).
        faces[g, 0], faces[g, 1], faces[g, 2] = r, b, d
        faces[f, 0], faces[f, 1], faces[f, 2] = b, s, d
        values[g, 0], values[g, 1], values[g, 2] = value_r, value_b, value_d
        values[f, 0], values[f, 1], values[f, 2] = value_b, value_s, value_d
        source[f] = source[g]
        _connect(twin, 3 * g, side_r)
        _connect(twin, 3 * g + 2, beyond_r)
        _connect(twin, 3 * f, side_s)
        _connect(twin, 3 * f + 1, beyond_s)
        _connect(twin, 3 * g + 1, 3 * f + 2)
        for face in (f, g):
            if _is_flat(vertices, faces, face):
                queue.append(face)


@kernel
def _connect(twin, h, t):  # type: ignore[no-untyped-def]
    twin[h] = t
    if t >= 0:
        twin[t] = h


@kernel
def _detach(faces, twin, f):  # type: ignore[no-untyped-def]
    """Take a face out: its neighbours end there."""
    for h in range(3 * f, 3 * f + 3):
        if twin[h] >= 0:
            twin[twin[h]] = -1
        twin[h] = -1
    faces[f, 0] = faces[f, 1] = faces[f, 2] = 0


@kernel
def _find_flat(vertices, faces, flat):  # type: ignore[no-untyped-def]
    for f in range(len(faces)):
        flat[f] = _is_flat(vertices, faces, f)


@kernel
def _is_flat(vertices, faces, f):  # type: ignore[no-untyped-def]
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    x, y, z = normal_of(vertices, a, b, c)
    longest = max(_square(vertices, a, b), _square(vertices, b, c), _square(vertices, c, a))
    return np.sqrt(x * x + y * y + z * z) <= MIN_HEIGHT * longest


@kernel
def _square(vertices, a, b):  # type: ignore[no-untyped-def]
    """Squared distance of two vertices."""
    x, y, z = (
        vertices[b, 0] - vertices[a, 0],
        vertices[b, 1] - vertices[a, 1],
        vertices[b, 2] - vertices[a, 2],
    )
    return x * x + y * y + z * z
