"""The maps of stability: over which two things each solver is tried, and what it does there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from io import BytesIO
from typing import Any

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from weathercoat.bench.reference import ReferenceCase, make_shaped_case
from weathercoat.bench.reference_cases import FLAPS, make_folded_strip
from weathercoat.bench.stability_history import classify, follow, follow_run
from weathercoat.config.load import Override, load_config
from weathercoat.config.schema import section_at
from weathercoat.errors import WeathercoatError
from weathercoat.mesh.read import read_stream
from weathercoat.mesh.shapes import make_plate, make_random_sheet
from weathercoat.mesh.surface import Surface, Vectors, make_surface
from weathercoat.run import prepare_simulation
from weathercoat.sim.simulation import Simulation

Values = dict[str, Any]  # keys of the config, dotted: the solver and its form
_GROWTH_STEPS, _REST_STEPS = 30, 60  # in which targets grow, and which follow
_SCALE_STEPS, _SCALE_FACES = 10, 200
_SAME = 1e-3  # sizes
_BOUND_STEPS, _BOUND_REST, _BOUND_CELLS = 3, 5, 6
_CURL_ONLY: Values = {
    "remesh": False,
    "tension.initial": 1.0,
    "adhesion.decay_rate": 10.0,
    "cohesion.base": 1e3,
    "defects.density": 0.0,
    "curl.radius": 0.3,
    "flaking.rule": "faces",
}


@dataclass(frozen=True)
class StabilityMap:
    """A map: names and labels of its columns (x) and rows (y), and the class of a cell for a solver that is
    given as values of the config.
    """

    name: str
    about: str
    x_label: str
    y_label: str
    x: tuple[str, ...]
    y: tuple[str, ...]
    cell: Callable[[Values, int, int], str]


def make_maps() -> Iterator[StabilityMap]:
    """All maps, in the order of the chart."""
    yield make_curl_map()
    yield make_budget_map()
    yield make_fold_map()
    yield make_defect_map()
    yield make_scale_map()
    yield make_bound_map()


def make_curl_map(
    turns: tuple[float, ...] = (0.005, 0.02, 0.1, 0.5, 1.5, 2.5),
    stretches: tuple[float, ...] = (1e-3, 0.01, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4),
) -> StabilityMap:
    """How fast the targets grow, against the shape of the triangles."""

    def cell(values: Values, x: int, y: int) -> str:
        last = max(turns[x], 0.5)
        case = make_folded_strip("curl", "", 4, 4, last, stretch=stretches[y], substrate=False)
        growing = max(round(last / turns[x]), 1)
        shares = grow(growing, max(growing, _REST_STEPS))
        return classify(follow(case, case.parameters_with(values), shares))

    return StabilityMap(
        "curl",
        "Curl in a step, against the shape of the triangles: a flap of 4 edges",
        "growth of each target in a step [rad]; beyond 0.5 all at once",
        "width of a cell / its length along the flap",
        tuple(f"{turn:g}" for turn in turns),
        tuple(f"{stretch:g}" for stretch in stretches),
        cell,
    )


def make_budget_map(
    budgets: tuple[int, ...] = (1, 3, 10, 30, 100, 300), flaps: tuple[int, ...] = FLAPS
) -> StabilityMap:
    """The budget of a step, against the length of the flap."""

    def cell(values: Values, x: int, y: int) -> str:
        case = make_folded_strip("budget", "", flaps[y], 4, math.pi / flaps[y])
        given = {**values, "deformation.sweeps": budgets[x], "deformation.iterations": budgets[x]}
        shares = grow(_GROWTH_STEPS, _REST_STEPS)
        return classify(follow(case, case.parameters_with(given), shares))

    return StabilityMap(
        "budget",
        "Sweeps or iterations in a step, against the length of a flap that makes half a cylinder in 30 steps",
        "sweeps or iterations in a step",
        "edges of the flap",
        tuple(str(budget) for budget in budgets),
        tuple(str(edges) for edges in flaps),
        cell,
    )


def make_fold_map(
    folds: tuple[float, ...] = (0.0, 1e-6, 0.01, 0.1, 0.5 * math.pi, math.pi),
) -> StabilityMap:
    """The dihedral angle that a hinge has, against the one that it aims at, with 0 and a full turn among
    them; folds: outer dihedrals up to a flat one, which stand for those beyond as well.
    """
    bends = [fold - math.pi for fold in folds] + [math.pi - fold for fold in folds[-2::-1]]
    labels = [f"{fold:.3g}" for fold in folds] + [_full_turn_less(fold) for fold in folds[-2::-1]]

    def cell(values: Values, x: int, y: int) -> str:
        case = make_hinge(bends[x])
        start = turn_apex(case.mesh.rest_positions, bends[y])
        return classify(follow(case, case.parameters_with(values), [1.0] * _REST_STEPS, start))

    return StabilityMap(
        "fold",
        "A hinge from one outer dihedral angle to another",
        "wanted [rad]",
        "at the start [rad]",
        tuple(labels),
        tuple(labels),
        cell,
    )


def _full_turn_less(fold: float) -> str:
    return "2π" if fold == 0.0 else ("3π/2" if fold == 0.5 * math.pi else f"2π-{fold:g}")


def make_defect_map(
    ratios: tuple[float, ...] = (10.0, 100.0, 1e4, 1e8, 1e16, math.inf),
) -> StabilityMap:
    """How degenerate an element is, against what of it is."""
    kinds = {"short edge": spoil_edge, "flat face": spoil_height, "point-like face": spoil_face}

    def cell(values: Values, x: int, y: int) -> str:
        spoil = list(kinds.values())[y]
        case = make_folded_strip("defect", "", 4, 4, 0.5, spoil=lambda flat: spoil(flat, 1.0 / ratios[x]))
        shares = grow(_GROWTH_STEPS, _REST_STEPS)
        return classify(follow(case, case.parameters_with(values), shares))

    return StabilityMap(
        "defect",
        "A degenerate element in the midst of a flap of 4 edges",
        "its size is an edge divided by",
        "element",
        tuple("zero" if math.isinf(ratio) else f"{ratio:g}" for ratio in ratios),
        tuple(kinds),
        cell,
    )


def make_scale_map(
    scales: tuple[float, ...] = (1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9),
    offsets: tuple[float, ...] = (0.0, 1.0, 1e3, 1e7, 1e11, 1e15),
) -> StabilityMap:
    """The unit of the model, against how far from its axes' origin it lies, from file to film."""
    ends: dict[str, Vectors] = {}
    sheet = make_random_sheet(_SCALE_FACES)

    def cell(values: Values, x: int, y: int) -> str:
        key = repr(sorted(values.items()))
        if key not in ends:
            ends[key] = _film_of(write_obj(sheet), values)
        try:
            film = _film_of(write_obj(sheet, scales[x], scales[x] * offsets[y]), values)
        except WeathercoatError:
            return "refused"
        if not np.isfinite(film).all():
            return "non-finite"
        if film.shape != ends[key].shape or np.abs(film - ends[key]).max() > _SAME:
            return "differs"
        return "converged"

    return StabilityMap(
        "scale",
        "Unit and place of a model, from file to film: here, converged is the film of the unit 1",
        "unit of length",
        "distance from the origin, in sizes",
        tuple(f"{scale:g}" for scale in scales),
        tuple(f"{offset:g}" for offset in offsets),
        cell,
    )


def make_bound_map(keys: tuple[str, ...] = ()) -> StabilityMap:
    """Parameters of curl and deformation at their bounds and beyond; all, or those named."""
    bounded = dict(find_bounds())
    keys = keys or tuple(bounded)
    strip = make_plate(2.0, 0.25, _BOUND_CELLS, 1)  # one row, so that some shape meets all angles
    columns = ("below", "least", "largest", "above")

    def cell(values: Values, x: int, y: int) -> str:
        value = bounded[keys[y]][x]
        rule = {"curl.rule": "angle"} if keys[y].startswith("curl.angle") else {}
        try:
            simulation = make_run(strip, {**values, **rule, keys[y]: value}, _BOUND_STEPS)
        except WeathercoatError:
            return "refused"
        return classify(follow_run(simulation, _BOUND_REST))

    return StabilityMap(
        "bounds",
        "Parameters at their bounds and beyond, of a narrow strip of loose film",
        "value",
        "parameter",
        columns,
        keys,
        cell,
    )


def grow(steps: int, rest: int) -> list[float]:
    """The shares of targets that grow evenly in so many steps and then rest."""
    return [(step + 1) / steps for step in range(steps)] + [1.0] * rest


def find_bounds() -> Iterator[tuple[str, tuple[Any, Any, Any, Any]]]:
    """The bounded parameters of curl and deformation: below the least value, the least, the largest, above.

    Where a bound itself is excluded, the number next to it is the least or the largest.
    """
    for section in ("curl", "deformation"):
        kind = section_at((section,))
        assert kind is not None
        for name, field in kind.model_fields.items():
            low = high = None
            is_whole = isinstance(field.default, int)
            for bound in field.metadata:
                if isinstance(bound, Ge):
                    low = bound.ge, _next(bound.ge, -1, is_whole)
                elif isinstance(bound, Gt):
                    low = _next(bound.gt, 1, is_whole), bound.gt
                elif isinstance(bound, Le):
                    high = bound.le, _next(bound.le, 1, is_whole)
                elif isinstance(bound, Lt):
                    high = _next(bound.lt, -1, is_whole), bound.lt
            if low is not None and high is not None:
                yield f"{section}.{field.alias or name}", (low[1], low[0], high[0], high[1])


def _next(value: Any, direction: int, is_whole: bool) -> Any:
    """The nearest number above or below; for small ones one that is not denormal."""
    if is_whole:
        return int(value) + direction
    return float(np.nextafter(value, math.inf * direction)) if abs(value) > 1e-6 else value + direction * 1e-9


def make_hinge(bend: float) -> ReferenceCase:
    """Two equilateral faces, the first clamped, whose edge aims at a bend [rad]; in no metal's way."""
    height = math.sqrt(0.75)
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, height, 0.0], [0.5, -height, 0.0]])
    surface = make_surface(corners, np.array([[0, 1, 2], [1, 0, 3]], np.int32))
    case = make_shaped_case(
        "hinge",
        "",
        surface,
        clamped=lambda flat: np.arange(len(flat)) != np.argmin(flat[:, 1]),
        shape=lambda flat: turn_apex(flat, bend),
        substrate=False,
    )
    return replace(case, targets=np.array([bend]))


def turn_apex(flat: Vectors, bend: float) -> Vectors:
    """The positions of a flat hinge along x with its lower face turned to a bend [rad]."""
    lowest = np.argmin(flat[:, 1])
    height = flat[lowest, 1]
    turned = flat.copy()
    turned[lowest, 1:] = height * math.cos(bend), height * math.sin(bend)
    return turned


def spoil_edge(flat: Vectors, ratio: float) -> Vectors:
    """Cells of the size 1 with an inner vertex moved towards the next one across, to `ratio` from it."""
    v = _inner(flat)
    moved = flat.copy()
    moved[v, 1] += 1.0 - ratio
    return moved


def spoil_height(flat: Vectors, ratio: float) -> Vectors:
    """An inner vertex moved towards the midpoint of the edge across from it, to a height of `ratio`."""
    v = _inner(flat)
    moved = flat.copy()
    moved[v, :2] += (1.0 - ratio) * np.array([0.5, 1.0])
    return moved


def spoil_face(flat: Vectors, ratio: float) -> Vectors:
    """The corners of an inner face moved to within `ratio` of one of them."""
    v = _inner(flat)
    moved = flat.copy()
    for step in ((0.0, 1.0), (1.0, 1.0)):
        corner = int(np.argmin(np.linalg.norm(flat[:, :2] - flat[v, :2] - step, axis=1)))
        moved[corner, :2] = flat[v, :2] + ratio * np.array(step)
    return moved


def _inner(flat: Vectors) -> int:
    """A vertex of the grid in the midst."""
    centre = 0.5 * (flat.max(axis=0) + flat.min(axis=0))
    return int(np.argmin(np.linalg.norm(flat - centre - (0.1, 0.1, 0.0), axis=1)))


def write_obj(surface: Surface, scale: float = 1.0, offset: float = 0.0) -> bytes:
    """A surface of unit size as the content of an OBJ file, in another unit and away from the origin."""
    moved = surface.vertices * scale + offset * np.array([1.0, -1.0, 1.0])
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in moved.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (surface.faces + 1).tolist()]
    return "\n".join(lines).encode()


def _film_of(content: bytes, values: Values) -> Vectors:
    """Where the film of a model in OBJ ends, (n, 3) in sizes."""
    simulation = make_run(read_stream(BytesIO(content), format="obj"), values, _SCALE_STEPS)
    for _ in range(_SCALE_STEPS):
        simulation.step()
    return simulation.mesh.positions[: simulation.mesh.vertex_count]


def make_run(surface: Surface, values: Values, steps: int) -> Simulation:
    """A run of a film that comes off at once and curls, but does not crack."""
    given = {**_CURL_ONLY, "ageing.steps": steps, **values}
    config = load_config(
        "standard", [Override(key, value, "stability") for key, value in given.items()]
    ).config
    return prepare_simulation(surface, config, surface)
