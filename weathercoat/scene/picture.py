"""Pictures of a whole scene, before and after, as its camera sees it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from weathercoat.mesh.surface import Vectors
from weathercoat.output.camera import Camera, make_camera
from weathercoat.output.display import (
    DisplayMesh,
    Normalisation,
    join_meshes,
    make_bare_mesh,
    make_display_mesh,
    make_painted_mesh,
)
from weathercoat.output.folder import whole_file
from weathercoat.output.pictures import Image, PictureParameters, contact_sheet, render_mesh, write_png
from weathercoat.output.shading import to_linear
from weathercoat.recording import picture_parameters
from weathercoat.scene.exposure import ground_level
from weathercoat.scene.graph import AgedMesh, CameraPath, SceneObject, place
from weathercoat.scene.plan import ScenePlan, VariantPlan

HEIGHT, MOST_WIDTH = 600, 1200  # pixels of each picture
MOST_FACES = 12_000_000  # of all instances together, some 4 GB
_UNPAINTED = (0.42, 0.41, 0.39)
_FACES_PER_FACE = 4  # of the film: its front, back and rim, and the metal
_REACH = 1.5  # in sizes of the median object
_MARGIN = 0.08
_AZIMUTH, _ELEVATION = 32.0, 24.0


@dataclass(frozen=True)
class _Units:
    """World to display units: (x - centre) / size, with the size of the median object."""

    centre: Vectors
    size: float

    def __call__(self, points: Vectors) -> Vectors:
        return np.ascontiguousarray((points - self.centre) / self.size)


def write_preview(
    path: Path,
    plan: ScenePlan,
    aged: Mapping[str, str],
    films: Mapping[str, AgedMesh],
    log: Callable[[str], None],
) -> None:
    """Draw the scene before and after side by side as a PNG, from the first place of its camera, or from one
    that frames it.

    aged, films: as for `write_scene`. A scene with more than `MOST_FACES` faces to draw is passed over, which
    `log` is told. Raises OutputError.
    """
    drawn = _FACES_PER_FACE * sum(_faces_of(plan, item) for item in plan.scene.objects)
    if drawn > MOST_FACES:
        log(f"no picture: some {drawn:,} faces are more than the {MOST_FACES:,} that are drawn")
        return
    images = [draw_scene(plan, {}, {}), draw_scene(plan, aged, films)]
    with whole_file(path, overwrite=True) as stream:
        write_png(stream, contact_sheet(images, ["before", "after"]))


def draw_scene(plan: ScenePlan, aged: Mapping[str, str], films: Mapping[str, AgedMesh]) -> Image:
    """A picture of the scene, uint8 (height, width, 3): objects of `aged` show their variants among `films`,
    the others fresh paint, or none where they are not weathered.
    """
    units = _units(plan)
    mesh = join_meshes(list(_parts(plan, aged, films, units)))
    parameters = _parameters(plan)
    scene = plan.scene
    up = np.asarray(scene.up, np.float64)
    camera = _camera(scene.camera, up, units, mesh, parameters)
    level = (ground_level(scene) - float(np.einsum("i,i->", units.centre, up))) / units.size
    radius = 1.3 * float(np.linalg.norm(mesh.vertices, axis=1).max())
    lift = parameters.metal_thickness
    return render_mesh(mesh, camera, parameters, up=scene.up, ground=(level - lift, radius))


def _parts(
    plan: ScenePlan, aged: Mapping[str, str], films: Mapping[str, AgedMesh], units: _Units
) -> Iterator[DisplayMesh]:
    """The display mesh of each object, variant by variant."""
    for shown in plan.variants:
        film = None
        made: dict[bool, tuple[DisplayMesh, Normalisation]] = {}
        for member in shown.variant.members:
            is_aged = member.item.name in aged
            if is_aged not in made:
                film = films[shown.variant.name] if is_aged else None
                made[is_aged] = _variant_mesh(shown, film)
            mesh, normalise = made[is_aged]
            yield _placed(mesh, normalise, shown, member.item, units)
    for item in plan.scene.objects:
        if item.name not in plan.shown:
            surface = plan.scene.meshes[item.mesh]
            faces = surface.faces[:, [0, 2, 1]] if item.is_mirrored() else surface.faces
            yield make_bare_mesh(units(place(surface.vertices, item.transform)), faces)


def _variant_mesh(shown: VariantPlan, film: AgedMesh | None) -> tuple[DisplayMesh, Normalisation]:
    """The display mesh of a variant in units of its own size, so that its paint looks as in its own pictures;
    with fresh paint where there is no film yet.
    """
    parameters = picture_parameters(shown.loaded.config)
    paint = to_linear(parameters.paint)
    if film is not None:
        normalise = Normalisation.of(film.snapshot)
        mesh = make_display_mesh(
            film.snapshot,
            normalise,
            film_thickness=parameters.film_thickness,
            metal_thickness=parameters.metal_thickness,
            paint=paint,
            untouched=film.untouched,
        )
        return mesh, normalise
    surface = shown.painted
    normalise = Normalisation.of_mesh(surface.vertices, surface.faces)
    parts = [make_painted_mesh(normalise(surface.vertices), surface.faces, paint)]
    if shown.untouched is not None:
        parts.append(make_bare_mesh(normalise(shown.untouched.vertices), shown.untouched.faces))
    return join_meshes(parts), normalise


def _placed(
    mesh: DisplayMesh, normalise: Normalisation, shown: VariantPlan, item: SceneObject, units: _Units
) -> DisplayMesh:
    """The display mesh of an object at its place in the scene; its pattern stays that of its own size."""
    back = np.linalg.inv(shown.variant.placement.shape)
    linear = np.einsum("ij,jk->ik", item.transform[:3, :3], back)
    matrix = np.eye(4)
    matrix[:3, :3] = linear
    matrix[:3, 3] = item.transform[:3, 3]
    vertices = units(place(mesh.vertices * normalise.size + normalise.centre, matrix))
    turned = place(mesh.corner_normals.reshape(-1, 3).astype(np.float64), np.linalg.inv(linear).T)
    length = np.linalg.norm(turned, axis=1, keepdims=True)
    normals = np.divide(turned, length, out=np.zeros_like(turned), where=length > 0).reshape(-1, 3, 3)
    order = [0, 2, 1] if item.is_mirrored() else [0, 1, 2]
    return replace(
        mesh,
        vertices=vertices,
        faces=np.ascontiguousarray(mesh.faces[:, order]),
        corner_normals=np.ascontiguousarray(normals[:, order], np.float32),
    )


def _units(plan: ScenePlan) -> _Units:
    scene = plan.scene
    bounds, extents = [], []
    for item in scene.objects:
        vertices = place(scene.meshes[item.mesh].vertices, item.transform)
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        bounds += [low, high]
        extents.append(float(np.linalg.norm(high - low)))
    return _Units(0.5 * (np.min(bounds, axis=0) + np.max(bounds, axis=0)), float(np.median(extents)))


def _parameters(plan: ScenePlan) -> PictureParameters:
    """How the scene is drawn; the colours of primer, metal and rust are those of its first variant."""
    base = picture_parameters(plan.variants[0].loaded.config) if plan.variants else PictureParameters()
    aspect = 16.0 / 9.0 if plan.scene.camera is None else plan.scene.camera.aspect
    width = min(round(HEIGHT * aspect), MOST_WIDTH)
    return replace(base, width=width, height=round(width / aspect), reach=_REACH, unpainted=_UNPAINTED)


def _camera(
    path: CameraPath | None, up: Vectors, units: _Units, mesh: DisplayMesh, parameters: PictureParameters
) -> Camera:
    if path is None:
        return make_camera(
            mesh.vertices,
            np.zeros((0, 3)),
            (float(up[0]), float(up[1]), float(up[2])),
            aspect=parameters.width / parameters.height,
            azimuth=_AZIMUTH,
            elevation=_ELEVATION,
            margin=_MARGIN,
        )
    forward = path.directions[0]
    # looking straight up or down, any direction will do for the upper edge of the picture
    level = up if abs(np.einsum("i,i->", forward, up)) < 0.999 else np.roll(up, 1)
    right = np.cross(forward, level)
    right /= np.linalg.norm(right)
    tangent = float(np.tan(np.radians(path.field_of_view) / 2.0))
    position = units(path.positions[:1])[0]
    return Camera(position, right, np.cross(right, forward), forward, tangent * path.aspect, tangent)


def _faces_of(plan: ScenePlan, item: SceneObject) -> int:
    shown = plan.shown.get(item.name)
    own = len(plan.scene.meshes[item.mesh].faces)
    if shown is None:
        return own
    remesh = shown.loaded.config.remesh
    return max(own, remesh.faces) if remesh else own
