"""The reference cases: strips that roll up, flaps, a cracked disc, sheets that no shape satisfies, and film
of real runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from weathercoat.bench.reference import ReferenceCase, make_shaped_case, view_film
from weathercoat.config.load import Override, load_config
from weathercoat.deform.deformation import DeformParameters
from weathercoat.mesh.read import read_surface
from weathercoat.mesh.shapes import make_plate, make_random_sheet, make_torus
from weathercoat.mesh.surface import Surface, Vectors, make_surface
from weathercoat.run import fill, prepare_simulation

FLAPS = (4, 6, 8, 12, 24)  # edges from the clamp to the free end
SHEET_FACES, SHEET_LENGTH, SHEET_TURN = 9_940, 1.5, 270.0  # the clamped sheet; its width is 1
_CLAMPED_EDGES = 1.3  # mean edges from the clamped side of an irregular sheet to the first free vertex
_RUN_STEPS, _FREEZE_STEP = 100, 60  # most film is loose then, and most has not fallen
_FILM_STEPS = 200  # in which targets grow where a case stands for film that ages
_MESHES = "WEATHERCOAT_MESHES"


def make_reference_cases(names: Sequence[str] = ()) -> dict[str, Callable[[], ReferenceCase]]:
    """What makes each case, by name and in the order of the charts; all, or those named."""
    makers: dict[str, Callable[[], ReferenceCase]] = {
        "cylinder-90": partial(make_strip, "cylinder-90", 300, 90.0, irregular=False),
        "cylinder-180": partial(
            make_strip, "cylinder-180", 3_000, 180.0, irregular=True, growth_steps=_FILM_STEPS
        ),
        "cylinder-270": partial(make_strip, "cylinder-270", 3_000, 270.0, irregular=False),
        "cylinder-720": partial(make_strip, "cylinder-720", 3_000, 720.0, irregular=True),
        **{f"flap-{edges}": partial(make_flap, edges) for edges in FLAPS},
        "cracked-disc": make_cracked_disc,
        "clamped-sheet": make_clamped_sheet,
        "rolled-clamp": partial(make_clamped_sheet, rolled=True),
        "uniform-curl": make_uniform_sheet,
        "cracked-plate": partial(make_cracked_plate, "cracked-plate", 10_000),
        "closed-shape": make_closed_shape,
        "large-plate": partial(make_cracked_plate, "large-plate", 100_000),
    }
    return {name: makers[name] for name in (names or makers)}


def make_strip(
    name: str, faces: int, turn: float, *, irregular: bool, growth_steps: int = 20
) -> ReferenceCase:
    """A strip of 2 x 1, clamped at one end, that aims at a cylinder of a turn [degrees].

    irregular: of random triangles instead of a grid. growth_steps: of an irregular one.
    """
    if not irregular:
        rows = round(math.sqrt(faces / 4))
        about = f"strip, cylinder of {turn:g} degrees, {4 * rows * rows:,} regular faces"
        return make_folded_strip(name, about, 2 * rows - 1, rows, math.radians(turn) / (2 * rows - 1))
    surface = make_random_sheet(faces, width=2.0)
    clamp = _CLAMPED_EDGES * _mean_edge(surface) / surface.size()
    case = make_shaped_case(
        name,
        f"strip, cylinder of {turn:g} degrees, {faces:,} irregular faces",
        surface,
        clamped=partial(_near_end, clamp),
        shape=partial(roll, turn=math.radians(turn), flat_part=clamp),
    )
    return replace(case, growth_steps=growth_steps)


def make_flap(edges: int) -> ReferenceCase:
    """A flap of so many edges from its clamp to its free end, 8 wide, that aims at half a cylinder."""
    return make_folded_strip(
        f"flap-{edges}",
        f"flap of {edges} edges, half a cylinder, {16 * (edges + 1)} regular faces",
        edges,
        8,
        math.pi / edges,
    )


def make_folded_strip(
    name: str,
    about: str,
    edges: int,
    width: int,
    bend: float,
    *,
    stretch: float = 1.0,
    spoil: Callable[[Vectors], Vectors] = lambda flat: flat,
    substrate: bool = True,
) -> ReferenceCase:
    """A grid of `edges` + 1 times `width` square cells, the first row of them clamped, that aims at the same
    bend [rad] at each row of edges across it.

    stretch: how much longer cells are across than along. spoil: what becomes of the flat positions (n, 3),
    in which cells are 1 along.
    """
    surface = make_plate(float(edges + 1), float(width) * stretch, edges + 1, width)
    surface = replace(surface, vertices=spoil(surface.vertices))
    cell = 1.0 / surface.size()
    return make_shaped_case(
        name,
        about,
        surface,
        clamped=partial(_near_end, 1.001 * cell),
        shape=partial(fold, bend=bend, cell=cell),
        substrate=substrate,
    )


def make_clamped_sheet(faces: int = SHEET_FACES, *, rolled: bool = False) -> ReferenceCase:
    """A sheet of 1.5 x 1 without metal below it that aims at the bends of a cylinder of 270 degrees, and at
    the lengths that it has when it is flat: random triangles have no shape with both. Its clamp is flat, so
    that hinges beside it cannot turn as they should, or rolled as the cylinder is.
    """
    surface = make_random_sheet(faces, width=SHEET_LENGTH)
    case = make_shaped_case(
        "rolled-clamp" if rolled else "clamped-sheet",
        f"{'sheet in a rolled clamp' if rolled else 'clamped sheet'}, cylinder of {SHEET_TURN:g} degrees, "
        f"flat lengths, {faces:,} irregular faces",
        surface,
        clamped=partial(_near_end, _CLAMPED_EDGES * _mean_edge(surface) / surface.size()),
        shape=partial(roll, turn=math.radians(SHEET_TURN)),
        exact=False,
        substrate=False,
        clamp_shaped=rolled,
    )
    return replace(case, judged_by_aims=True)


def make_cracked_disc(rings: int = 16) -> ReferenceCase:
    """A disc with a radial crack, clamped on the side away from it, whose lips roll up to a cone."""
    return make_shaped_case(
        "cracked-disc",
        f"disc with a radial crack whose lips make cones, {_disc_faces(rings):,} irregular faces",
        make_cut_disc(rings),
        clamped=lambda flat: np.abs(_angle_from_crack(flat)) < 0.5 * np.pi,
        shape=partial(make_cones, steepness=math.radians(50.0)),
    )


def make_uniform_sheet(faces: int = 1_000) -> ReferenceCase:
    """A square sheet, clamped at one side, that wants the same curvature in every direction, as drying film
    does; it cannot have it, so the minimum is the answer.
    """
    surface = make_random_sheet(faces)
    clamp = _CLAMPED_EDGES * _mean_edge(surface) / surface.size()
    case = make_shaped_case(
        "uniform-curl",
        f"sheet, uniform curl, {faces:,} irregular faces",
        surface,
        clamped=partial(_near_end, clamp),
        shape=lambda flat: flat,
        exact=False,
    )
    targets = -case.constraints.span[case.active.hinge_edges] / 0.25
    case = replace(case, targets=targets, growth_steps=_FILM_STEPS)
    case.aim(1.0)
    return case


def make_cracked_plate(name: str, faces: int) -> ReferenceCase:
    """A plate of random triangles that has aged by the default config, frozen."""
    return _freeze(name, f"cracked plate of a run, {faces:,} faces", make_random_sheet(faces))


def make_closed_shape() -> ReferenceCase:
    """A closed shape that has aged by the default config, frozen: the paper's bunny if its mesh is there."""
    import os

    path = Path(os.environ.get(_MESHES, "")) / "aki_bunny2.obj"
    if path.is_file():
        surface, what = read_surface(path), "Stanford bunny"
    else:
        surface, what = make_torus(), "torus"
    return _freeze("closed-shape", f"{what} of a run, {len(surface.faces):,} faces", surface)


def _freeze(name: str, about: str, surface: Surface) -> ReferenceCase:
    """The film of a run of the default config in its midst."""
    config = load_config("standard", [Override("ageing.steps", _RUN_STEPS, "--steps")]).config
    simulation = prepare_simulation(surface, config, surface)
    for _ in range(_FREEZE_STEP):
        simulation.step()
    mesh, used = simulation.mesh, simulation.mesh.vertex_count
    mesh.positions[:used] = mesh.rest_positions[mesh.origin[:used]]  # laid back on the metal
    return view_film(
        mesh,
        simulation.constraints,
        fill(DeformParameters, config),
        simulation.age,
        name=name,
        about=f"{about}, {simulation.mesh.alive.sum():,} left",
    )


def roll(flat: Vectors, *, turn: float, flat_part: float = 0.0) -> Vectors:
    """Positions (n, 3) in the plane z = 0 rolled up to a cylinder of a turn [rad] about the y axis, towards
    +z, from the end at the least x on; the part up to `flat_part` from there stays.
    """
    x = flat[:, 0] - flat[:, 0].min()
    radius = (x.max() - flat_part) / turn
    angle = np.maximum(x - flat_part, 0.0) / radius
    rolled = flat.copy()
    rolled[:, 0] += radius * np.sin(angle) - (x - np.minimum(x, flat_part))
    rolled[:, 2] += radius * (1.0 - np.cos(angle))
    return rolled


def fold(flat: Vectors, *, bend: float, cell: float) -> Vectors:
    """Positions (n, 3) in the plane z = 0 folded by an angle [rad] towards +z at every line across that is a
    multiple of `cell` away from the end at the least x, but for that end itself: lengths between them stay.
    """
    x = flat[:, 0] - flat[:, 0].min()
    row = np.floor(x / cell + 1e-6)
    angle = bend * np.arange(int(row.max()) + 1)
    ahead = np.concatenate([np.zeros((1, 2)), cell * np.stack([np.cos(angle), np.sin(angle)], axis=1)])
    corner = np.cumsum(ahead, axis=0)[:-1]
    within, row = x - cell * row, row.astype(int)
    folded = flat.copy()
    folded[:, 0] = flat[:, 0].min() + corner[row, 0] + within * np.cos(angle[row])
    folded[:, 2] = corner[row, 1] + within * np.sin(angle[row])
    return folded


def make_cones(flat: Vectors, *, steepness: float) -> Vectors:
    """A disc about the origin whose quarters beside the crack, along -x, are rolled up to cones.

    Rays from the centre stay straight: their directions run along the equator of a sphere, and from a quarter
    turn before the crack on along circles that touch it, whose planes are inclined by `steepness` [rad].
    """
    radius, angle = np.hypot(flat[:, 0], flat[:, 1]), _angle_from_crack(flat)
    beyond = np.maximum(np.abs(angle) - 0.5 * np.pi, 0.0)
    small = math.cos(steepness)  # the radius of those circles
    along, up = small * np.sin(beyond / small), small * (1.0 - np.cos(beyond / small))
    inwards, upwards = math.cos(steepness), math.sin(steepness)
    side = np.sign(angle)
    rolled = flat.copy()
    turned = beyond > 0.0
    direction = np.stack([-along, side * (1.0 - inwards * up), upwards * up], axis=1)
    rolled[turned] = (radius[:, None] * direction)[turned]
    return rolled


def make_cut_disc(rings: int) -> Surface:
    """A disc of about equilateral triangles, cut along the negative x axis from its rim to its centre."""
    points = [np.zeros((1, 2))]
    offsets = [0]
    for ring in range(1, rings + 1):
        angle = np.linspace(-np.pi, np.pi, 6 * ring + 1)
        offsets.append(offsets[-1] + len(points[-1]))
        points.append(ring / rings * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    faces = []
    for ring in range(1, rings + 1):
        inner, outer = offsets[ring - 1], offsets[ring]
        i = j = 0
        while j < 6 * ring or i < 6 * (ring - 1):
            ahead = (i + 1) * ring <= (j + 1) * (ring - 1) if ring > 1 else False
            if ahead and i < 6 * (ring - 1):
                faces.append((inner + i, outer + j, inner + i + 1))
                i += 1
            else:
                faces.append((inner + i, outer + j, outer + j + 1))
                j += 1
    flat = np.concatenate(points)
    vertices = np.stack([flat[:, 0], flat[:, 1], np.zeros(len(flat))], axis=1)
    return make_surface(vertices, np.array(faces, np.int32), groups=("disc",), name="disc")


def _disc_faces(rings: int) -> int:
    return 6 * rings * rings


def _angle_from_crack(flat: Vectors) -> Vectors:
    """The angle of each of the positions about the origin, from -pi at one lip of the crack to pi."""
    return np.arctan2(flat[:, 1], flat[:, 0])


def _near_end(reach: float, flat: Vectors) -> NDArray[np.bool_]:
    """Which positions lie within a distance of the end at the least x."""
    return flat[:, 0] - flat[:, 0].min() < reach


def _mean_edge(surface: Surface) -> float:
    """The mean length of the edges of the faces."""
    corner = surface.vertices[surface.faces]
    return float(np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2).mean())
