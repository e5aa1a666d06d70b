"""Generated surfaces: simple painted parts to try the tool on, and sheets for tests and benchmarks.

All are y-up, centred on the y axis, in any unit. Closed ones are watertight and oriented outwards; none has a
degenerate face. The annotation of each argument is its help text on the command line.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from weathercoat.errors import LimitError, UsageError
from weathercoat.mesh.surface import Indices, Surface, Vectors, make_surface

MOST_FACES = 20_000_000


def make_plate(
    width: Annotated[float, "extent along x"] = 1.0,
    height: Annotated[float, "extent along y"] = 1.0,
    columns: Annotated[int, "cells along x"] = 1,
    rows: Annotated[int, "cells along y"] = 1,
) -> Surface:
    """An upright sheet without thickness that faces +z, a grid of two triangles a cell."""
    _require_positive(width=width, height=height)
    _require_at_least(1, columns=columns, rows=rows)
    _require_few(2 * columns * rows)
    u, v, faces = _grid(columns, rows)
    return _named("plate", np.stack([(u - 0.5) * width, v * height, np.zeros_like(u)], axis=1), faces)


def make_curved_plate(
    radius: Annotated[float, "radius of the cylinder that it is cut from"] = 0.5,
    angle: Annotated[float, "degrees of the arc, under 360"] = 120.0,
    height: Annotated[float, "extent along y"] = 1.0,
    columns: Annotated[int, "cells along the arc"] = 32,
    rows: Annotated[int, "cells along y"] = 32,
) -> Surface:
    """A sheet bent to a part of a cylinder about the y axis; its convex side faces +z."""
    _require_positive(radius=radius, angle=angle, height=height)
    _require_at_least(1, columns=columns, rows=rows)
    _require_few(2 * columns * rows)
    if angle >= 360 or angle / columns > 90:
        raise UsageError("angle must be under 360 degrees, and under 90 a column")
    u, v, faces = _grid(columns, rows)
    turn = np.radians(angle) * (u - 0.5)
    return _named(
        "curved-plate", np.stack([radius * np.sin(turn), v * height, radius * np.cos(turn)], axis=1), faces
    )


def make_sphere(
    radius: Annotated[float, "radius"] = 0.5,
    subdivisions: Annotated[int, "times that each triangle of the icosahedron is quartered"] = 4,
) -> Surface:
    """A sphere of 20 * 4**subdivisions nearly equal triangles."""
    _require_positive(radius=radius)
    _require_at_least(0, subdivisions=subdivisions)
    _require_few(20 * 4 ** min(subdivisions, 100))
    golden = (1 + math.sqrt(5)) / 2
    corners = [(a, b, 0.0) for a in (-1.0, 1.0) for b in (-golden, golden)]
    vertices = np.array([np.roll(corner, shift) for shift in range(3) for corner in corners])
    vertices /= math.hypot(1, golden)
    distance = np.linalg.norm(vertices[:, None] - vertices[None], axis=2)
    near = np.isclose(distance, distance[distance > 0].min())
    faces = np.array(
        [
            (a, b, c)
            for a in range(12)
            for b in range(a)
            for c in range(b)
            if near[a, b] and near[b, c] and near[a, c]
        ]
    )
    inwards = np.linalg.det(vertices[faces]) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    for _ in range(subdivisions):
        vertices, faces = _quarter(vertices, faces)
        vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    return _named("sphere", radius * vertices, faces)


def make_torus(
    radius: Annotated[float, "from the y axis to the centre of the tube"] = 0.4,
    tube: Annotated[float, "radius of the tube, below radius"] = 0.15,
    segments: Annotated[int, "cells round the axis"] = 96,
    sides: Annotated[int, "cells round the tube"] = 36,
) -> Surface:
    """A ring about the y axis."""
    _require_positive(radius=radius, tube=tube)
    _require_at_least(3, segments=segments, sides=sides)
    _require_few(2 * segments * sides)
    if tube >= radius:
        raise UsageError("tube must be below radius")
    turn = 2 * np.pi * np.arange(sides) / sides
    profile = np.stack([radius + tube * np.cos(turn), tube * np.sin(turn)], axis=1)
    return _named("torus", *_revolve(profile, segments, closed=True))


def make_pipe(
    radius: Annotated[float, "outer radius"] = 0.2,
    wall: Annotated[float, "thickness of the wall, below radius"] = 0.03,
    height: Annotated[float, "length, along y"] = 1.0,
    segments: Annotated[int, "cells round the axis"] = 64,
    rows: Annotated[int, "cells along y"] = 48,
) -> Surface:
    """An upright pipe, open at both ends, with an outer and an inner side."""
    _require_positive(radius=radius, wall=wall, height=height)
    _require_at_least(3, segments=segments)
    _require_at_least(1, rows=rows)
    _require_few(4 * segments * rows)
    if wall >= radius:
        raise UsageError("wall must be below radius")
    up = np.linspace(0, height, rows + 1)
    outer, inner = np.full(rows + 1, radius), np.full(rows + 1, radius - wall)
    profile = np.stack([np.concatenate([outer, inner]), np.concatenate([up, up[::-1]])], axis=1)
    return _named("pipe", *_revolve(profile, segments, closed=True))


def make_barrel(
    radius: Annotated[float, "radius of the wall"] = 0.29,
    height: Annotated[float, "extent along y, at least twice the radius"] = 0.88,
    segments: Annotated[int, "cells round the axis"] = 96,
) -> Surface:
    """A steel drum: rims round recessed ends, and two rolling hoops about the wall."""
    _require_positive(radius=radius, height=height)
    _require_at_least(3, segments=segments)
    _require_few(2 * segments * round(40 + min(height / radius, 1e9) / 0.15))
    if height < 2 * radius:
        raise UsageError("height must be at least twice the radius")
    rim, recess, hoop = 0.04 * radius, 0.08 * radius, 0.1 * radius
    lower = [(0.0, recess), (radius - 2 * rim, recess), (radius - 2 * rim, 0.0), (radius + rim, 0.0)]
    lower += [(radius + rim, 2 * rim), (radius, 3 * rim)]
    third = height / 3
    hoop_turn = np.linspace(-np.pi / 2, np.pi / 2, 9)
    lower += [(radius + 0.6 * hoop * math.cos(t) ** 2, third + hoop * t / (np.pi / 2)) for t in hoop_turn]
    profile = np.array(lower + [(r, height - y) for r, y in reversed(lower)])
    return _named("barrel", *_revolve(_resample(profile, 0.15 * radius), segments, closed=False))


def make_box(
    width: Annotated[float, "extent along x"] = 1.0,
    height: Annotated[float, "extent along y"] = 0.7,
    depth: Annotated[float, "extent along z"] = 0.5,
    cells: Annotated[int, "cells along each edge"] = 8,
) -> Surface:
    """A box whose six sides are grids."""
    _require_positive(width=width, height=height, depth=depth)
    _require_at_least(1, cells=cells)
    _require_few(12 * cells * cells)
    u, v, grid = _grid(cells, cells)
    lattice: list[NDArray[np.int64]] = []
    faces = []
    for axis in range(3):
        for end in (0, 1):
            point = np.empty((len(u), 3))
            point[:, axis] = end
            point[:, (axis + 1) % 3], point[:, (axis + 2) % 3] = u, v
            faces.append((grid if end else grid[:, ::-1]) + len(u) * len(lattice))
            lattice.append(np.rint(point * cells).astype(np.int64))
    shared, index = np.unique(np.concatenate(lattice), axis=0, return_inverse=True)
    vertices = (shared / cells - (0.5, 0.0, 0.5)) * (width, height, depth)
    return _named("box", vertices, index.reshape(-1)[np.concatenate(faces)])


def make_sign(
    width: Annotated[float, "extent along x"] = 1.0,
    height: Annotated[float, "extent along y"] = 0.7,
    thickness: Annotated[float, "extent along z"] = 0.02,
    corner: Annotated[float, "radius of the corners"] = 0.08,
    hole: Annotated[float, "radius of the four holes"] = 0.025,
    edge_length: Annotated[float, "longest edge, about"] = 0.03,
) -> Surface:
    """An upright sign plate with round corners and a hole in each, facing +z."""
    _require_positive(
        width=width, height=height, thickness=thickness, corner=corner, hole=hole, edge_length=edge_length
    )
    _require_few(4 * width * height / edge_length**2)
    if 2 * corner >= min(width, height) or hole > 0.7 * corner:
        raise UsageError("corner must be below half of width and height, and hole at most 0.7 of corner")
    x, y = width / 2 - corner, height / 2 - corner
    centres = [(x, y), (-x, y), (-x, -y), (x, -y)]
    outline = [_arc(c, corner, i * np.pi / 2, np.pi / 2, edge_length) for i, c in enumerate(centres)]
    holes = [_arc(c, hole, 0, -2 * np.pi, edge_length)[:-1] for c in centres]
    points, triangles = _triangulate([np.concatenate(outline), *holes], edge_length)
    vertices, faces = _extrude(points, triangles, thickness, edge_length)
    return _named("sign", vertices + np.array([0.0, height / 2, 0.0]), faces)


def make_bracket(
    width: Annotated[float, "extent along x"] = 0.4,
    height: Annotated[float, "length of the upright leg, bend included"] = 0.6,
    depth: Annotated[float, "length of the lying leg, bend included"] = 0.5,
    thickness: Annotated[float, "thickness of the sheet"] = 0.03,
    bend: Annotated[float, "radius of the bend, to the middle of the sheet"] = 0.06,
    hole: Annotated[float, "radius of the two holes in each leg"] = 0.035,
    edge_length: Annotated[float, "longest edge, about"] = 0.025,
) -> Surface:
    """A bent sheet-metal angle with two holes in each leg."""
    _require_positive(
        width=width,
        height=height,
        depth=depth,
        thickness=thickness,
        bend=bend,
        hole=hole,
        edge_length=edge_length,
    )
    _require_few(4 * width * (height + depth) / min(edge_length, bend) ** 2)
    upright, lying, arc = height - bend, depth - bend, bend * np.pi / 2
    if thickness >= 2 * bend or min(upright, lying) < 4 * hole or width < 8 * hole:
        raise UsageError(
            "bend must be above half of thickness, hole at most width / 8 and a quarter of a straight leg"
        )
    length = upright + arc + lying
    corners = np.array([(-0.5, 0), (0.5, 0), (0.5, 1), (-0.5, 1)]) * (width, length)
    centres = [(x * width / 4, s) for s in (upright / 2, length - lying / 2) for x in (-1, 1)]
    holes = [_arc(c, hole, 0, -2 * np.pi, edge_length)[:-1] for c in centres]
    edge_length = min(edge_length, arc / 4)
    points, triangles = _triangulate([_resample(corners, edge_length, closed=True), *holes], edge_length)
    flat, faces = _extrude(points, triangles, thickness, edge_length)
    x, along, offset = flat.T
    turn = np.clip((along - upright) / bend, 0, np.pi / 2)
    y = bend - (bend + offset) * np.sin(turn) + np.maximum(upright - along, 0)
    z = bend - (bend + offset) * np.cos(turn) + np.maximum(along - upright - arc, 0)
    return _named("bracket", np.stack([x, y, z], axis=1), faces)


def make_gear(
    radius: Annotated[float, "radius at the tips of the teeth"] = 0.5,
    teeth: Annotated[int, "number of teeth"] = 18,
    tooth: Annotated[float, "height of a tooth"] = 0.1,
    bore: Annotated[float, "radius of the hole in the middle"] = 0.12,
    thickness: Annotated[float, "extent along z"] = 0.15,
    edge_length: Annotated[float, "longest edge, about"] = 0.03,
) -> Surface:
    """An upright spur gear with straight flanks, its axis along z."""
    _require_positive(radius=radius, tooth=tooth, bore=bore, thickness=thickness, edge_length=edge_length)
    _require_at_least(5, teeth=teeth)
    _require_few(16 * (radius / edge_length) ** 2 + 100 * teeth)
    root, pitch = radius - tooth, 2 * np.pi / teeth
    if root < 1.2 * bore:
        raise UsageError("bore must leave a ring below the teeth: at most (radius - tooth) / 1.2")
    flank = [(root, -0.28), (radius, -0.16), (radius, 0.16), (root, 0.28)]
    polar = [(r, (i + share) * pitch) for i in range(teeth) for r, share in flank]
    outline = np.array([(r * math.sin(-turn), r * math.cos(turn)) for r, turn in polar])
    edge_length = min(edge_length, root - bore)
    hole = _arc((0, 0), bore, 0, -2 * np.pi, edge_length)[:-1]
    points, triangles = _triangulate([_resample(outline, edge_length, closed=True), hole], edge_length)
    vertices, faces = _extrude(points, triangles, thickness, edge_length)
    return _named("gear", vertices + np.array([0.0, radius, 0.0]), faces)


def make_corrugated_sheet(
    width: Annotated[float, "extent along x, across the waves"] = 1.0,
    height: Annotated[float, "extent along y"] = 1.2,
    pitch: Annotated[float, "from wave to wave"] = 0.125,
    depth: Annotated[float, "from the crest of a wave to its trough"] = 0.035,
    thickness: Annotated[float, "thickness of the sheet"] = 0.008,
    edge_length: Annotated[float, "longest edge, about"] = 0.03,
) -> Surface:
    """An upright corrugated sheet whose waves run up and down, facing +z."""
    _require_positive(
        width=width, height=height, pitch=pitch, depth=depth, thickness=thickness, edge_length=edge_length
    )
    across = min(edge_length, pitch / 10)
    columns, rows = math.ceil(width / across), math.ceil(height / edge_length)
    _require_few(4 * columns * rows)
    turn = 2 * np.pi / pitch
    if thickness / 2 >= 2 / (depth * turn**2):
        raise UsageError("thickness must be below twice the radius of the waves: less depth or more pitch")
    u, v, triangles = _grid(columns, rows)
    flat, faces = _extrude(
        np.stack([(u - 0.5) * width, v * height], axis=1), triangles, thickness, edge_length
    )
    x, y, offset = flat.T
    slope = -0.5 * depth * turn * np.sin(turn * x)
    along = np.hypot(1.0, slope)
    x, z = x - offset * slope / along, 0.5 * depth * np.cos(turn * x) + offset / along
    return _named("corrugated", np.stack([x, y, z], axis=1), faces)


def make_random_sheet(
    faces: Annotated[int, "number of faces, met exactly"] = 10_000,
    width: Annotated[float, "extent along x"] = 1.0,
    height: Annotated[float, "extent along y"] = 1.0,
    seed: Annotated[int, "seed of the random positions"] = 1,
) -> Surface:
    """An upright sheet without thickness that faces +z, of homogeneous random triangles.

    Stratified random points, relaxed to the centroids of the triangles round them (Lloyd) and triangulated by
    Delaunay. With b points on the rim and i inside, Euler's formula gives 2 i + b - 2 faces.
    """
    from scipy.spatial import Delaunay

    _require_positive(width=width, height=height)
    _require_at_least(8, faces=faces)
    _require_at_least(0, seed=seed)
    _require_few(faces)
    random = np.random.default_rng(seed)
    length = math.sqrt(4 * width * height / (math.sqrt(3) * faces))
    across, upwards = max(1, round(width / length)), max(1, round(height / length))
    odd = faces % 2
    if 2 * (across + upwards) + odd > faces:
        raise UsageError("the sheet is too narrow for so few faces")
    rim = np.concatenate(
        [
            _spaced((0, 0), (width, 0), across + odd, random),
            _spaced((width, 0), (width, height), upwards, random),
            _spaced((width, height), (0, height), across, random),
            _spaced((0, height), (0, 0), upwards, random),
        ]
    )
    inside = (faces + 2 - len(rim)) // 2
    columns = max(1, round(math.sqrt(inside * width / height)))
    rows = -(-inside // columns)
    cell = np.sort(random.permutation(columns * rows)[:inside])
    place = np.stack([cell % columns, cell // columns], axis=1) + random.random((inside, 2))
    margin = 0.4 * length
    inner = margin + place / (columns, rows) * (width - 2 * margin, height - 2 * margin)
    points = np.concatenate([rim, inner])
    for _ in range(12):
        triangles = Delaunay(points).simplices
        points[len(rim) :] = _ring_centroids(points, triangles)[len(rim) :]
    triangles = _counter_clockwise(points, Delaunay(points).simplices)
    vertices = np.stack([points[:, 0] - width / 2, points[:, 1], np.zeros(len(points))], axis=1)
    return _named("sheet", vertices, triangles)


SHAPES: dict[str, Callable[..., Surface]] = {
    "plate": make_plate,
    "curved-plate": make_curved_plate,
    "sphere": make_sphere,
    "torus": make_torus,
    "pipe": make_pipe,
    "barrel": make_barrel,
    "box": make_box,
    "sign": make_sign,
    "bracket": make_bracket,
    "gear": make_gear,
    "corrugated": make_corrugated_sheet,
    "sheet": make_random_sheet,
}


def _named(name: str, vertices: Vectors, faces: NDArray[np.integer]) -> Surface:
    return make_surface(vertices, faces.astype(np.int32), groups=(name,), name=name)


def _require_positive(**lengths: float) -> None:
    for name, value in lengths.items():
        if not (math.isfinite(value) and value > 0):
            raise UsageError(f"{name.replace('_', '-')} must be above 0, not {value}")


def _require_at_least(least: int, **counts: int) -> None:
    for name, value in counts.items():
        if value < least:
            raise UsageError(f"{name.replace('_', '-')} must be at least {least}, not {value}")


def _require_few(faces: float) -> None:
    """Refuse what would fill the memory before it is made; `faces` may be an estimate."""
    if not faces <= MOST_FACES:
        raise LimitError(f"this would have over {MOST_FACES:,} faces", remedy="ask for fewer or larger ones")


def _grid(columns: int, rows: int) -> tuple[Vectors, Vectors, Indices]:
    """Coordinates u, v in [0, 1] of a grid's points, (n,) each, and its faces, counter-clockwise in u, v."""
    u, v = (line.ravel() for line in np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1)))
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    right, above, across = corner + 1, corner + columns + 1, corner + columns + 2
    faces = np.stack([corner, right, across, corner, across, above], axis=1).reshape(-1, 3)
    return u, v, faces.astype(np.int32)


def _quarter(vertices: Vectors, faces: NDArray[np.integer]) -> tuple[Vectors, NDArray[np.integer]]:
    """Every face split in four at the midpoints of its edges."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    unique, index = np.unique(edges, axis=0, return_inverse=True)
    middle = index.reshape(-1, 3) + len(vertices)
    a, b, c = faces.T
    ab, bc, ca = middle.T
    quarters = np.stack([a, ab, ca, b, bc, ab, c, ca, bc, ab, bc, ca], axis=1).reshape(-1, 3)
    return np.concatenate([vertices, vertices[unique].mean(axis=1)]), quarters


def _revolve(profile: Vectors, segments: int, *, closed: bool) -> tuple[Vectors, NDArray[np.integer]]:
    """The profile, (k, 2) of radius and height, turned about the y axis with its right side outwards.

    A closed profile runs counter-clockwise; an open one begins and ends on the axis, from bottom to top.
    """
    turn = 2 * np.pi * np.arange(segments) / segments
    radius, height = profile.T
    ring = np.stack(
        [
            np.outer(radius, np.sin(turn)),
            np.broadcast_to(height[:, None], (len(profile), segments)),
            np.outer(radius, np.cos(turn)),
        ],
        axis=2,
    )
    column = np.arange(segments)
    row = np.arange(len(profile) if closed else len(profile) - 1)[:, None]
    here, ahead = row * segments + column, row * segments + (column + 1) % segments
    above = (row + 1) % len(profile) * segments
    over, over_ahead = above + column, above + (column + 1) % segments
    faces = np.stack([here, ahead, over_ahead, here, over_ahead, over], axis=2).reshape(-1, 3)
    if closed:
        return ring.reshape(-1, 3), faces
    last = (len(profile) - 1) * segments
    pole = np.arange(len(profile) * segments)
    pole[:segments], pole[last:] = 0, last
    faces = pole[faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    used, renumbered = np.unique(faces, return_inverse=True)
    return ring.reshape(-1, 3)[used], renumbered.reshape(-1, 3)


def _arc(centre: Sequence[float], radius: float, start: float, sweep: float, edge_length: float) -> Vectors:
    """Points on an arc, both ends included, (n, 2): at least 24 to a circle, so that it is no crease."""
    steps = max(math.ceil(abs(sweep) * radius / edge_length), math.ceil(12 * abs(sweep) / np.pi))
    turn = start + sweep * np.arange(steps + 1) / steps
    return np.asarray(centre) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)


def _resample(line: Vectors, edge_length: float, *, closed: bool = False) -> Vectors:
    """The polyline with points inserted so that no segment is longer than `edge_length`."""
    ends = np.roll(line, -1, axis=0) if closed else line[1:]
    pieces = []
    for a, b in zip(line, ends, strict=False):
        steps = max(1, math.ceil(math.dist(a, b) / edge_length - 1e-9))
        pieces.append(a + (b - a) * (np.arange(steps) / steps)[:, None])
    return np.concatenate(pieces if closed else [*pieces, line[-1:]])


def _triangulate(outlines: Sequence[Vectors], edge_length: float) -> tuple[Vectors, NDArray[np.integer]]:
    """A triangulation of the region inside the first outline and outside the others (holes).

    Points fill it in a hexagonal pattern, far enough from the outlines for these to be Delaunay edges.
    """
    from scipy.spatial import Delaunay, cKDTree

    outlines = [_resample(outline, edge_length, closed=True) for outline in outlines]
    outline = np.concatenate(outlines)
    low, high = outline.min(axis=0), outline.max(axis=0)
    rise = edge_length * math.sqrt(3) / 2
    columns, rows = (np.ceil((high - low) / (edge_length, rise)) + 1).astype(int)
    i, j = (index.ravel() for index in np.meshgrid(np.arange(columns), np.arange(rows)))
    inner = low + np.stack([(i + 0.5 * (j % 2)) * edge_length, j * rise], axis=1)
    inner = inner[cKDTree(outline).query(inner)[0] > 0.8 * edge_length]
    inner = inner[_is_inside(inner, outlines)]
    points = np.concatenate([outline, inner])
    triangles = _counter_clockwise(points, Delaunay(points).simplices)
    triangles = triangles[_is_inside(points[triangles].mean(axis=1), outlines)]
    if len(_boundary_edges(triangles)) != len(outline):
        raise UsageError("holes and outline come too close for this edge-length")
    return points, triangles


def _is_inside(points: Vectors, outlines: Sequence[Vectors]) -> NDArray[np.bool_]:
    """Whether each point lies inside an odd number of outlines."""
    inside = np.zeros(len(points), bool)
    for outline in outlines:
        for (ax, ay), (bx, by) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            if ay == by:
                continue
            spans = (ay > points[:, 1]) != (by > points[:, 1])
            inside ^= spans & (points[:, 0] < ax + (bx - ax) * (points[:, 1] - ay) / (by - ay))
    return inside


def _counter_clockwise(points: Vectors, triangles: NDArray[np.integer]) -> NDArray[np.integer]:
    """The triangles that have an area, counter-clockwise."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    twice_area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    turned = np.where(twice_area[:, None] < 0, triangles[:, ::-1], triangles)
    return turned[np.abs(twice_area) > 1e-9 * np.abs(twice_area).max()]


def _boundary_edges(triangles: NDArray[np.integer]) -> NDArray[np.integer]:
    """Directed edges that one triangle alone has, (n, 2)."""
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    _, index, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return edges[index[count == 1]]


def _extrude(
    points: Vectors, triangles: NDArray[np.integer], thickness: float, edge_length: float
) -> tuple[Vectors, NDArray[np.integer]]:
    """The flat region given a thickness, half of it to each side along the third axis, its wall in layers."""
    layers = max(1, round(thickness / edge_length))
    height = np.repeat(thickness * (0.5 - np.arange(layers + 1) / layers), len(points))
    vertices = np.column_stack([np.tile(points, (layers + 1, 1)), height])
    edges = _boundary_edges(triangles)
    faces = [triangles, triangles[:, ::-1] + layers * len(points)]
    for layer in range(layers):
        (a, b), (below_a, below_b) = (edges + layer * len(points)).T, (edges + (layer + 1) * len(points)).T
        faces += [np.stack([a, below_a, b], axis=1), np.stack([b, below_a, below_b], axis=1)]
    used, renumbered = np.unique(np.concatenate(faces), return_inverse=True)
    return vertices[used], renumbered.reshape(-1, 3)


def _spaced(
    start: tuple[float, float], end: tuple[float, float], steps: int, random: np.random.Generator
) -> Vectors:
    """Points from `start` (included) to `end` (not), each up to a fifth of a step off an even spacing."""
    share = np.arange(steps) + np.concatenate([[0.0], random.uniform(-0.2, 0.2, steps - 1)])
    a, b = np.array(start, float), np.array(end, float)
    return a + (b - a) * (share / steps)[:, None]


def _ring_centroids(points: Vectors, triangles: NDArray[np.integer]) -> Vectors:
    """For each point, the centroid of the triangles round it."""
    corner = points[triangles]
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    area = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    moment = corner.mean(axis=1) * area[:, None]
    total = sum(np.bincount(triangles[:, i], area, len(points)) for i in range(3))
    sums = [sum(np.bincount(triangles[:, i], moment[:, k], len(points)) for i in range(3)) for k in range(2)]
    return np.stack(sums, axis=1) / np.maximum(total, np.finfo(float).tiny)[:, None]
