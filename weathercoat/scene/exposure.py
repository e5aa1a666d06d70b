"""Exposure: how much of the sky and of the rain reaches the surface of each object, by rays against the whole
scene.

Each object is sampled by itself, instances too. Every sample pattern is fixed, so the same scene gives the
same numbers, whatever the number of cores; last bits of the rays hang on the tracer.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Surface, Vectors, face_normals
from weathercoat.output.rays import RayQueries, make_rays
from weathercoat.scene.graph import Scene, SceneObject, place

SAMPLES = 384  # of an object's surface
SKY_RAYS = 32  # from each sample
WIND_RAYS = 8
GROUND_POINTS = 16  # round an object
# Share of the rain that falls straight, and the slope of the rest: a wind of 4 m/s, as over open land, over
# 6.5 m/s, the speed at which drops of 2 mm fall (Gunn and Kinzer, The terminal velocity of fall for water
# droplets in stagnant air, 1949).
CALM_SHARE = 0.3
RAIN_SLOPE = 4.0 / 6.5
# Faces whose rays are answered at once. A larger scene is taken in parts, which changes nothing but the time.
FACES_AT_ONCE = 4_000_000
_FAR = 1e30
# Start of a ray above its surface, as shares of the object and of the scene, whose rays have float32 corners.
_LIFT_OF_OBJECT, _LIFT_OF_SCENE = 1e-4, 4e-6
# Roberts, The unreasonable effectiveness of quasirandom sequences, 2018: of one and of two dimensions.
_GOLDEN = 0.6180339887498949
_PLASTIC = (0.7548776662466927, 0.5698402909980532)

Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Exposure:
    """What reaches an object, at s samples that stand for equal areas of its outer side.

    sky (s,): irradiance of an even sky relative to open level ground, 0 to 1. rain (s,): rain that meets the
    surface relative to open level ground, driven evenly from all sides; above 1 on slopes that face it is
    possible. height (s,): above the ground [units of the scene]. ground_rain: share of the rain that reaches
    the ground round the object.
    """

    sky: Vectors
    rain: Vectors
    height: Vectors
    ground_rain: float


@dataclass(frozen=True)
class _Bundle:
    """Rays of one object, from origins (r, 3) along directions (r, 3), and which are blocked so far."""

    origins: NDArray[np.float32]
    directions: NDArray[np.float32]
    is_blocked: Flags

    def cast(self, rays: RayQueries) -> None:
        left = np.flatnonzero(~self.is_blocked)
        if len(left):
            self.is_blocked[left] = rays.blocked(self.origins[left], self.directions[left], _FAR)


@dataclass(frozen=True)
class _Probe:
    """An object's samples, and the numbers of the rays that ask for sky (s, SKY_RAYS), rain (s, 1 +
    WIND_RAYS) and the rain on the ground; -1 where no ray is needed, since nothing can come from there.
    """

    points: Vectors
    sky: NDArray[np.int64]
    rain: NDArray[np.int64]
    ground: NDArray[np.int64]
    catch: Vectors
    bundle: _Bundle


def measure_exposure(
    scene: Scene, names: Iterable[str] | None = None, *, near: float = 0.3, samples: int = SAMPLES
) -> dict[str, Exposure]:
    """Exposure of the objects of these names, of all by default.

    All objects block, whether they are weathered or not; the ground below the horizon gives neither sky nor
    rain. near [units of the scene]: how far from an object the rain on the ground round it counts.

    Memory grows with `FACES_AT_ONCE` or the largest mesh, whichever is more, and by some 400 kB an object.
    """
    wanted = None if names is None else set(names)
    chosen = [item for item in scene.objects if wanted is None or item.name in wanted]
    if not chosen:
        return {}
    up = np.asarray(scene.up, np.float64)
    low, high = _bounds(scene)
    centre, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    ground = ground_level(scene)
    probes = {
        item.name: _probe(scene.meshes[item.mesh], item, up, ground, near, centre, radius, samples)
        for item in chosen
    }
    for part in _parts(scene):
        rays = _rays_of(scene, part, centre)
        for probe in probes.values():
            probe.bundle.cast(rays)
    return {name: _exposure(probe, up, ground) for name, probe in probes.items()}


def ground_level(scene: Scene) -> float:
    """Height of the ground along `scene.up`: as the scene says, else the lowest point of all objects."""
    if scene.ground is not None:
        return scene.ground
    up = np.asarray(scene.up, np.float64)
    return min(
        float(np.einsum("ij,j->i", place(scene.meshes[o.mesh].vertices, o.transform), up).min())
        for o in scene.objects
    )


def sample_surface(surface: Surface, item: SceneObject, count: int) -> tuple[Vectors, Vectors]:
    """Points (count, 3) on an object in the world, each for an equal area, and the outward normals there."""
    vertices = place(surface.vertices, item.transform)
    normal = face_normals(vertices, surface.faces)
    area = np.linalg.norm(normal, axis=1)
    total = np.cumsum(area)
    number = np.arange(count)
    face = np.searchsorted(total, (number + 0.5) / count * total[-1])
    u, v = ((0.5 + number * step) % 1.0 for step in _PLASTIC)
    root = np.sqrt(u)
    corner = vertices[surface.faces[face]]
    weights = np.stack([1.0 - root, root * (1.0 - v), root * v], axis=1)
    points = np.einsum("ij,ijk->ik", weights, corner)
    outward = normal[face] / area[face, None]
    return points, -outward if item.is_mirrored() else outward


def _probe(
    surface: Surface,
    item: SceneObject,
    up: Vectors,
    ground: float,
    near: float,
    centre: Vectors,
    radius: float,
    samples: int,
) -> _Probe:
    points, normals = sample_surface(surface, item, samples)
    lift = _LIFT_OF_OBJECT * float(np.linalg.norm(np.ptp(points, axis=0))) + _LIFT_OF_SCENE * radius
    starts = points + lift * normals - centre
    upwards = _sky_directions(normals)
    is_upward = np.einsum("ijk,k->ij", upwards, up) > 0.0
    falling = _rain_directions(samples, up)
    facing = np.einsum("ijk,ik->ij", falling, normals) / np.einsum("ijk,k->ij", falling, up)
    catch = np.maximum(facing, 0.0) * _RAIN_WEIGHTS
    places = _round(points, up, ground, near) - centre
    around = _rain_directions(len(places), up)
    groups = [
        (starts, upwards, is_upward),
        (starts, falling, catch > 0.0),
        (places, around, np.ones(around.shape[:2], np.bool_)),
    ]
    origins, directions, numbers, first = [], [], [], 0
    for start, towards, is_needed in groups:
        count = int(is_needed.sum())
        number = np.full(is_needed.shape, -1)
        number[is_needed] = np.arange(first, first + count)
        origins.append(np.broadcast_to(start[:, None], towards.shape)[is_needed].astype(np.float32))
        directions.append(towards[is_needed].astype(np.float32))
        numbers.append(number)
        first += count
    bundle = _Bundle(np.concatenate(origins), np.concatenate(directions), np.zeros(first, np.bool_))
    sky, rain, around_it = numbers
    return _Probe(points, sky, rain, around_it, catch, bundle)


_RAIN_WEIGHTS = np.array([CALM_SHARE, *[(1.0 - CALM_SHARE) / WIND_RAYS] * WIND_RAYS])


def _exposure(probe: _Probe, up: Vectors, ground: float) -> Exposure:
    def is_open(number: NDArray[np.int64]) -> Flags:
        return (number >= 0) & ~probe.bundle.is_blocked[number]

    return Exposure(
        sky=is_open(probe.sky).mean(axis=1),
        rain=(is_open(probe.rain) * probe.catch).sum(axis=1),
        height=np.maximum(np.einsum("ij,j->i", probe.points, up) - ground, 0.0),
        ground_rain=float((is_open(probe.ground) * _RAIN_WEIGHTS).sum(axis=1).mean()),
    )


def _sky_directions(normals: Vectors) -> Vectors:
    """Directions (s, SKY_RAYS, 3), distributed as the cosine about each normal (Malley's method)."""
    number = np.arange(SKY_RAYS)
    turn = np.arange(len(normals))[:, None]
    u = ((number + 0.5) / SKY_RAYS + turn * _PLASTIC[0]) % 1.0
    v = (number * _GOLDEN + turn * _PLASTIC[1]) % 1.0
    radius, angle = np.sqrt(u), 2.0 * np.pi * v
    tangent, bitangent = _frames(normals)
    return (
        (radius * np.cos(angle))[:, :, None] * tangent[:, None]
        + (radius * np.sin(angle))[:, :, None] * bitangent[:, None]
        + np.sqrt(1.0 - u)[:, :, None] * normals[:, None]
    )


def _rain_directions(count: int, up: Vectors) -> Vectors:
    """Directions (count, 1 + WIND_RAYS, 3) that rain comes from: straight, and from all sides in turn."""
    tangent, bitangent = _frames(up[None])
    turn = (np.arange(count)[:, None] * _GOLDEN) % 1.0
    angle = 2.0 * np.pi * (np.arange(WIND_RAYS) + turn) / WIND_RAYS
    slanted = up + RAIN_SLOPE * (
        np.cos(angle)[:, :, None] * tangent[0] + np.sin(angle)[:, :, None] * bitangent[0]
    )
    slanted /= np.sqrt(1.0 + RAIN_SLOPE**2)
    return np.concatenate([np.broadcast_to(up, (count, 1, 3)), slanted], axis=1)


def _frames(normals: Vectors) -> tuple[Vectors, Vectors]:
    """Two unit vectors (s, 3) across each unit normal and each other.

    Source: Duff et al., Building an orthonormal basis, revisited, 2017.
    """
    x, y, z = normals.T
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    return (
        np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1),
        np.stack([b, sign + y * y * a, -y], axis=1),
    )


def _round(points: Vectors, up: Vectors, ground: float, near: float) -> Vectors:
    """Points (GROUND_POINTS, 3) on the ground, `near` outside the outline of points (s, 3) from above."""
    tangent, bitangent = _frames(up[None])
    level = points - np.einsum("ij,j->i", points, up)[:, None] * up
    centre = 0.5 * (level.min(axis=0) + level.max(axis=0))
    centre = centre - np.einsum("i,i->", centre, up) * up
    angle = 2.0 * np.pi * np.arange(GROUND_POINTS) / GROUND_POINTS
    side = np.cos(angle)[:, None] * tangent[0] + np.sin(angle)[:, None] * bitangent[0]
    reach = np.einsum("ij,kj->ik", side, level - centre).max(axis=1)
    above = ground + 0.05 * near  # not within what lies on the ground
    return centre + (reach + near)[:, None] * side + above * up  # type: ignore[no-any-return]


def _bounds(scene: Scene) -> tuple[Vectors, Vectors]:
    """Low and high corner (3,) of all objects in the world."""
    corners = []
    for item in scene.objects:
        vertices = place(scene.meshes[item.mesh].vertices, item.transform)
        corners += [vertices.min(axis=0), vertices.max(axis=0)]
    return np.min(corners, axis=0), np.max(corners, axis=0)


def _parts(scene: Scene) -> Iterator[Sequence[SceneObject]]:
    """The objects in parts of up to `FACES_AT_ONCE` faces; one with more is a part of its own."""
    part: list[SceneObject] = []
    faces = 0
    for item in scene.objects:
        count = len(scene.meshes[item.mesh].faces)
        if part and faces + count > FACES_AT_ONCE:
            yield part
            part, faces = [], 0
        part.append(item)
        faces += count
    if part:
        yield part


def _rays_of(scene: Scene, part: Sequence[SceneObject], centre: Vectors) -> RayQueries:
    vertices, faces, first = [], [], 0
    for item in part:
        surface = scene.meshes[item.mesh]
        vertices.append((place(surface.vertices, item.transform) - centre).astype(np.float32))
        faces.append(surface.faces + np.int32(first))
        first += len(surface.vertices)
    return make_rays(np.concatenate(vertices), np.concatenate(faces))
