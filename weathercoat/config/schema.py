"""The config: every parameter of the method, typed, bounded and described.

Lengths are in *sizes* (the square root of the rest area), times in *ages*, forces in units of the drying
tension that an intact film tends to, so one config fits an asset of any scale. A parameter carries its unit
and, where the paper names one, its symbol; docs, commented example and JSON Schema come from here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    WithJsonSchema,
    model_validator,
)
from pydantic.fields import FieldInfo

from weathercoat.config.section import (
    SWITCH,
    SWITCH_SCHEMA,
    Names,
    Real,
    Section,
    Switch,
    Whole,
    Words,
    at_least_one_word,
    parameter,
    parse_switch,
    require_number,
)
from weathercoat.config.steering import Steer
from weathercoat.grades import parse_limits

VERSION = 1
_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
LARGEST_SEED = 2**63 - 1


def _parse_color(value: object) -> tuple[int, ...]:
    if isinstance(value, str) and re.fullmatch(r"#[0-9a-fA-F]{6}", value):
        return tuple(int(value[i : i + 2], 16) for i in (1, 3, 5))
    if isinstance(value, list | tuple) and len(value) == 3:
        channels = tuple(value)
        if all(isinstance(c, int) and not isinstance(c, bool) and 0 <= c <= 255 for c in channels):
            return channels
    raise ValueError('must be "#rrggbb" (in quotes) or three whole numbers from 0 to 255')


def _parse_up(value: object) -> object:
    if isinstance(value, str) and value in get_args(Axis):
        return value
    if isinstance(value, list | tuple) and len(value) == 3:
        numbers = [c for c in value if isinstance(c, int | float) and not isinstance(c, bool)]
        if len(numbers) == 3 and all(abs(c) <= 1e100 for c in numbers) and any(numbers):
            return tuple(float(c) for c in numbers)
    raise ValueError("must be auto, x, y, z, -x, -y, -z or three numbers that are not all 0")


def _require_limit(text: str) -> str:
    parse_limits(text)
    return text


def _parse_remesh(value: object) -> object:
    """A mapping as it is, {} for on, which means the defaults, and false for off."""
    if isinstance(value, bool | str) and value in (True, False, *SWITCH):
        return {} if parse_switch(value) else False
    return value


def _remesh_tag(value: object) -> str:
    return "off" if value is False else "mapping"


MapName = Literal[
    "base_color", "orm", "normal", "height", "bare", "rust", "dirt", "crack", "lift", "separated", "age"
]
_MAP_SCHEMA = {"type": "string", "enum": [*get_args(MapName)]}
_FORMAT_SCHEMA = {"type": "string", "enum": ["ply", "glb"]}

Axis = Literal["auto", "x", "y", "z", "-x", "-y", "-z"]
PositiveOrNone = Annotated[float, Field(gt=0, le=1e9), BeforeValidator(require_number)] | None
Limits = Annotated[
    tuple[Annotated[str, AfterValidator(_require_limit)], ...],
    BeforeValidator(at_least_one_word),
    Words("limit or list of limits"),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}),
]
Color = Annotated[
    tuple[int, int, int],
    BeforeValidator(_parse_color),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "string", "pattern": "^#[0-9a-fA-F]{6}$"},
                {
                    "type": "array",
                    "items": {"type": "integer", "minimum": 0, "maximum": 255},
                    "minItems": 3,
                    "maxItems": 3,
                },
            ]
        }
    ),
]


class Model(Section):
    """How the model is taken in."""

    up: Annotated[Axis | tuple[float, float, float], BeforeValidator(_parse_up)] = parameter(
        "auto", "The direction against gravity in the model's axes; auto follows the convention of its format"
    )
    units: Literal["none", "m", "cm", "mm", "um", "in", "ft"] = parameter(
        "none", "What a unit of the model is, so that sizes are told in millimetres too"
    )


class Scene(Section):
    """How large the model is seen, for `quality: auto`: by a camera, or in pixels per metre."""

    distance: PositiveOrNone = parameter(
        None, "From the camera to the nearest part of the model", unit="model units"
    )
    nearest: PositiveOrNone = parameter(
        None, "Nearest approach of a camera that moves; counts instead of distance", unit="model units"
    )
    field_of_view: Real = parameter(
        40.0, "Angle of view of the camera, from top to bottom", unit="degrees", gt=0, lt=180
    )
    image_height: Whole = parameter(1080, "Height of the image", unit="pixels", ge=1, le=1_000_000)
    pixels_per_metre: PositiveOrNone = parameter(
        None, "Pixels for a metre of the surface, instead of a camera", unit="pixels per metre"
    )
    metres_per_unit: PositiveOrNone = parameter(
        None, "Length of a unit of the model, where it is none of model.units", unit="metres"
    )

    def pixels_per_unit(self, metres: float = 1.0) -> float | None:
        """Pixels for a unit of the model, of so many metres, where it is nearest to the camera; None where
        the scene does not tell.
        """
        if self.pixels_per_metre is not None:
            return self.pixels_per_metre * metres
        away = self.distance if self.nearest is None else self.nearest
        if away is None:
            return None
        return self.image_height / (2.0 * away * math.tan(math.radians(self.field_of_view) / 2.0))


class Paint(Section):
    """Which parts carry paint, by names or globs of material groups or objects; others pass through."""

    only: Names = parameter((), "Groups that carry paint; empty means all")
    excluded: Names = parameter((), "Groups that carry none, taken from the ones above", alias="except")


class Remesh(Section):
    """Remeshing into homogeneous, random triangles; `remesh: off` uses the model's own triangles."""

    faces: Whole = parameter(10_000, "Wanted number of faces", ge=4, le=20_000_000)
    crease_angle: Real = parameter(
        30.0, "Edges that bend by more than this are kept as creases", unit="degrees", gt=0, le=180
    )


class Ageing(Section):
    """The time that a run covers. Rates are per age, so steps set accuracy and cost, not the paint."""

    steps: Whole = parameter(
        1000,
        "Number of steps that the run is divided into; 0 records the intact start alone",
        symbol="N",
        ge=0,
        le=10_000_000,
    )
    duration: Real = parameter(1.0, "Age that the run covers", unit="ages", ge=1e-9, le=1000)
    until: Limits = parameter(
        (), "Severity at which the run stops, such as rust=Ri3 or bare=12%; of several the first reached"
    )


class Tension(Section):
    """The drying tension of the film."""

    law: Literal["saturating", "linear"] = parameter(
        "saturating",
        "Saturating tends to 1, as drying stress does; linear grows without a cap (the paper)",
        symbol="T",
    )
    initial: Real = parameter(0.0, "Tension at the start, at most 1 where it saturates", ge=0, le=1000)
    rate: Real = parameter(
        3.0,
        "Saturating: share of the missing tension gained; linear: tension gained",
        unit="per age",
        ge=0,
        le=1e6,
    )


class Adhesion(Section):
    """What holds the film to the metal: a base with improved Perlin noise on it, falling with age."""

    base: Real = parameter(1.0, "Mean at the start", symbol="A", ge=0, le=1e6)
    amplitude: Real = parameter(0.8, "Amplitude of the noise", ge=0, le=1e6)
    wavelength: Real = parameter(0.3, "Wavelength of the coarsest octave", unit="sizes", ge=1e-4, le=1000)
    octaves: Whole = parameter(4, "Octaves of noise, each of half the wavelength before", ge=1, le=16)
    gain: Real = parameter(0.65, "Amplitude of an octave relative to the one before", ge=0, le=1)
    decay_rate: Real = parameter(
        0.5, "Share of the base that is lost, not below 0", unit="per age", ge=0, le=1e6
    )


class Cohesion(Section):
    """The bond across an edge, within the film."""

    base: Real = parameter(1.5, "Mean at the start", symbol="C", gt=0, le=1e6)
    scatter: Real = parameter(0.2, "Largest relative deviation from edge to edge", ge=0, lt=1)
    decay_rate: Real = parameter(
        0.3,
        "Exponential loss in the half-edges of a face that has a broken edge",
        unit="per age",
        ge=0,
        le=1e6,
    )


class Defects(Section):
    """Edges that are weak from the start, where cracks begin."""

    rule: Literal["per_area", "share"] = parameter(
        "per_area", "Number by area, whatever the mesh, or a share of the edges (the paper)"
    )
    density: Real = parameter(400.0, "Defects with the rule per_area", unit="per size squared", ge=0, le=1e8)
    share: Real = parameter(0.01, "Share of the edges with the rule share", ge=0, le=1)
    strength: Real = parameter(0.001, "Cohesion of a defect relative to the others", ge=0, le=1)


class Lift(Section):
    """The force that peels a vertex off the metal (eq. 1)."""

    coefficient: Real = parameter(
        0.3, "Lift per tension: how easily the film separates", symbol="k", ge=0, le=1e6
    )
    convexity: Real = parameter(2.0, "How much more a ridge lifts than a valley", symbol="a", ge=0, le=100)
    sum: Literal["per_valence", "plain"] = parameter(
        "per_valence", "Lift on a vertex: scaled to six half-edges, or their plain sum (the paper)"
    )
    tension: Literal["drying", "face"] = parameter(
        "drying", "Tension that lifts: before relaxation by cracks, or the face's own (the paper)"
    )


class Fracture(Section):
    """How separated film breaks along edges, and how a break relaxes its neighbourhood."""

    direction_threshold: Real = parameter(
        0.45,
        "Least cosine between a crack's direction and an edge that continues it",
        symbol="α",  # noqa: RUF001
        gt=0,
        lt=1,
    )
    direction_factor: Real = parameter(
        0.20, "Factor on the cohesion of an edge that continues a crack", symbol="β", gt=0, lt=1
    )
    relaxation: Literal["shear_lag", "faces"] = parameter(
        "shear_lag", "A break unloads the film around it, or only its two faces (the paper)"
    )
    shear_lag: Real = parameter(
        0.04, "Length over which a free edge unloads the film", unit="sizes", symbol="λ", gt=0, le=1
    )
    face_factor: Real = parameter(
        0.5, "Factor on the tension of both faces with the relaxation faces", ge=0, lt=1
    )
    rounds: Literal["by_speed", "one"] = parameter(
        "by_speed", "Rounds of breaking in a step: as many as the crack speed allows, or one (the paper)"
    )
    speed: Real = parameter(20.0, "Speed at which cracks run", unit="sizes per age", gt=0, le=1e6)


class Flaking(Section):
    """What falls off."""

    rule: Literal["islands", "faces"] = parameter(
        "islands", "Whole pieces that nothing holds any more, or single faces (the paper)"
    )
    hanging_share: Real = parameter(
        0.1,
        "A piece also falls when it hangs by less than this share of the outline of a disc of its area",
        ge=0,
        lt=1,
    )


class Curl(Section):
    """How the target angles of separated film shrink with the age since separation."""

    rule: Literal["curvature", "angle"] = parameter(
        "curvature", "A curvature of the paint, or an angle per edge (the paper)"
    )
    radius: Real = parameter(0.05, "Radius that the film curls to", unit="sizes", ge=1e-5, le=1e5)
    rate: Real = parameter(10.0, "Rate at which the curvature grows", unit="per age", ge=0, le=1e6)
    angle_rate: Real = parameter(
        0.8, "Fall of the target with the rule angle", unit="radians per age", symbol="φ₀", ge=0, le=1e6
    )
    angle_floor: Real = parameter(
        2.6, "Smallest target with the rule angle; π is flat", unit="radians", gt=0, lt=math.pi
    )


class Deformation(Section):
    """How separated film is deformed: by position-based sweeps (section 4), or to a minimum of its energy."""

    solver: Literal["sweeps", "momentum", "descent", "newton", "none"] = parameter(
        "sweeps",
        "Sweeps (the paper), or with momentum, faster on long curls; descent or newton, which converge; "
        "none leaves the film where it separated",
    )
    sweeps: Whole = parameter(
        10, "Passes over all constraints in a step, with sweeps or momentum", ge=0, le=100_000
    )
    angle: Literal["dihedral", "split", "arccos"] = parameter(
        "dihedral", "Angle constraint: signed dihedral, the paper's split form, or plain arccos"
    )
    angle_stiffness: Real = parameter(1.0, "Share of an angle correction that is applied", ge=0, le=1)
    sleep_tolerance: Real = parameter(
        0.0,
        "Film sleeps for a few steps while nothing round it moves by this much in one [sizes]; 0: never",
        ge=0,
        le=1,
    )
    iterations: Whole = parameter(50, "Most iterations in a step, with descent and newton", ge=1, le=100_000)
    tolerance: Real = parameter(
        1e-3,
        "With descent and newton: how far above its minimum a step may leave the energy of a piece, relative "
        "to that of the piece lying flat",
        gt=0,
        lt=1,
    )
    film_thickness: Real = parameter(
        2e-3,
        "With descent and newton: thickness of the film; it bends against stretching as its square to 12",
        unit="sizes",
        ge=1e-6,
        le=0.1,
    )


class Dust(Section):
    """Dust that settles low, on upward faces and in valleys."""

    rate: Real = parameter(0.5, "Growth where all terms are 1", unit="per age", ge=0, le=1e6)


class Rust(Section):
    """Rust that runs down from cracks, and rust of the metal."""

    threshold: Real = parameter(0.1, "Rust above which it runs on and colours", ge=0, lt=1)
    source_rate: Real = parameter(3.0, "Growth at the lower outline of cracks", unit="per age", ge=0, le=1e6)
    source_cap: Real = parameter(0.9, "Rust that such a source tends to", ge=0, le=1)
    runoff_speed: Real = parameter(1.0, "Speed at which rust runs down", unit="sizes per age", ge=0, le=1e6)
    runoff_length: Real = parameter(0.15, "Length over which a streak fades", unit="sizes", gt=0, le=1000)
    alignment: Real = parameter(0.7, "Least cosine between gravity and an edge that rust follows", ge=0, lt=1)
    side_share: Real = parameter(
        0.001, "Share that goes to neighbours other than the best aligned", ge=0, le=1
    )
    lifted_rate: Real = parameter(1.0, "Rust of the metal under lifted film", unit="per age", ge=0, le=1e6)
    bare_rate: Real = parameter(3.0, "Rust of bare metal", unit="per age", ge=0, le=1e6)


class Environment(Section):
    """What surrounds the object, as factors on the rates that the paint has: 1 is open country or a town."""

    wear: Real = parameter(
        1.0, "Factor on how fast adhesion and cohesion are lost: light, heat and water", ge=0, le=1000
    )
    corrosion: Real = parameter(1.0, "Factor on how fast metal rusts, lifted or bare", ge=0, le=1000)
    rain: Real = parameter(1.0, "Factor on how far rust runs", gt=0, le=1000)
    dirt: Real = parameter(1.0, "Factor on how fast dust settles", ge=0, le=1000)


class Physical(Section):
    """The paint in physical units. What is given sets the keys that follow from it, by `config.physical`,
    unless these are set beside it or after it.
    """

    years: PositiveOrNone = parameter(None, "Time that the run covers", unit="years")
    lifetime: Real = parameter(
        15.0, "Time that one age stands for, in which such a paint wears out", unit="years", gt=0, le=1e9
    )
    stress: PositiveOrNone = parameter(
        None,
        "Drying stress that the intact film tends to",
        unit="MPa",
        symbol="σ",  # noqa: RUF001
    )
    strength: PositiveOrNone = parameter(None, "Tensile strength of the film", unit="MPa")
    adhesion: PositiveOrNone = parameter(None, "Pull-off strength on the metal at the start", unit="MPa")
    thickness: PositiveOrNone = parameter(None, "Thickness of the film", unit="µm", symbol="d")
    modulus: PositiveOrNone = parameter(None, "Young's modulus of the film", unit="GPa", symbol="E")
    poisson: Real = parameter(0.35, "Poisson's ratio of the film", symbol="ν", ge=0, lt=0.5)  # noqa: RUF001
    skin: Real = parameter(
        0.3, "Share of the thickness, on the outside, whose shrinking curls the rest", symbol="s", gt=0, lt=1
    )
    size: PositiveOrNone = parameter(None, "Length of a size: the root of the painted area", unit="m")


class Appearance(Section):
    """Colours (sRGB) and the drawn thickness of the film."""

    look: Literal["auto", "model", "paint"] = parameter(
        "auto",
        "What the outer side of the film shows: the model's own materials where they have a picture, or "
        "wherever there are any, or the paint below",
    )
    paint: Color = parameter((58, 120, 134), "Outer side of the film")
    back: Color = parameter((188, 178, 160), "Inner side of the film, the primer")
    metal: Color = parameter((122, 124, 126), "Metal without rust")
    rust: Color = parameter((132, 51, 0), "Rust")
    young_rust: Color = parameter((163, 99, 51), "Rust at the rim of its patches, in pictures")
    old_rust: Color = parameter((51, 26, 15), "Rust in the core of its patches, in pictures")
    stain: Color = parameter((128, 64, 23), "Rust that has run over the film, in pictures")
    dust: Color = parameter((172, 156, 130), "Dust")
    thickness: Real = parameter(
        0.003, "Thickness of the film in meshes and pictures", unit="sizes", ge=0, le=0.1
    )


class Snapshots(Section):
    """When film and metal are recorded: a number of times, or explicit steps."""

    count: Annotated[int, Field(ge=1, le=100_000), BeforeValidator(require_number)] | None = parameter(
        5, "Number of snapshots, evenly spaced over the run and ending with it; not together with steps"
    )
    steps: tuple[Annotated[int, Field(ge=0), BeforeValidator(require_number)], ...] = parameter(
        (), "The steps to record instead, in rising order; 0 is the start"
    )

    @model_validator(mode="before")
    @classmethod
    def _count_or_steps(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        if not data.get("steps"):
            return {key: value for key, value in data.items() if key != "count" or value is not None}
        if data.get("count") is not None:
            raise ValueError("give count or steps, not both")
        return {**data, "count": None}

    @model_validator(mode="after")
    def _rising(self) -> Snapshots:
        if any(later <= earlier for earlier, later in zip(self.steps, self.steps[1:], strict=False)):
            raise ValueError("steps must rise")
        return self

    def due(self, steps: int) -> tuple[int, ...]:
        """The steps to record in a run of `steps` steps, rising; fewer than `count` in a shorter run."""
        if self.count is None:
            return self.steps
        return tuple(sorted({-(-steps * (i + 1) // self.count) for i in range(self.count)}))


class Checkpoint(Section):
    """When the state is kept, from which an interrupted run goes on, and a finished one further."""

    minutes: Real = parameter(
        1.0, "Time between two checkpoints; 0: none by time", unit="minutes", ge=0, le=1e6
    )
    steps: Whole = parameter(0, "Steps between two checkpoints; 0: none by steps", ge=0, le=10_000_000)
    keep: bool = parameter(True, "Whether the last state stays with the results, for `run --resume`")


class Output(Section):
    """What a run writes."""

    formats: Annotated[
        tuple[Literal["ply", "glb"], ...],
        BeforeValidator(at_least_one_word),
        Field(min_length=1),
        WithJsonSchema(
            {"anyOf": [_FORMAT_SCHEMA, {"type": "array", "items": _FORMAT_SCHEMA, "minItems": 1}]}
        ),
    ] = parameter(("ply", "glb"), "Formats of the snapshots' meshes")
    preview: Switch = parameter(True, "Whether a contact sheet of all snapshots is drawn")
    viewer: Switch = parameter(False, "Whether a page that shows the run in a browser is written")
    picture_width: Whole = parameter(640, "Width of a picture", unit="pixels", ge=16, le=16_384)
    picture_height: Whole = parameter(480, "Height of a picture", unit="pixels", ge=16, le=16_384)


class Maps(Section):
    """Maps on the model's own texture coordinates, in the folder `maps` of the run; see docs/maps.md."""

    when: Literal["never", "last", "snapshots"] = parameter(
        "never", "Which states are baked: none, that of the last snapshot, or those of all"
    )
    names: Annotated[
        tuple[MapName, ...],
        BeforeValidator(at_least_one_word),
        WithJsonSchema({"anyOf": [_MAP_SCHEMA, {"type": "array", "items": _MAP_SCHEMA}]}),
    ] = parameter(get_args(MapName), "Which maps are written")
    width: Whole = parameter(2048, "Width of a map", unit="texels", ge=1, le=16_384)
    height: Whole = parameter(2048, "Height of a map", unit="texels", ge=1, le=16_384)
    format: Literal["png", "exr"] = parameter("png", "Format of the maps; EXR has half floats")
    bits: Literal[8, 16] = parameter(8, "Bits of a channel, in PNG")
    padding: Whole = parameter(16, "How far charts go on beyond their edges", unit="texels", ge=0, le=1024)
    pack: Names = parameter((), "Further maps of several channels, such as R=rust,G=dirt,B=bare,A=crack")
    atlas: Switch = parameter(False, "Lay out texture coordinates anew, and write the model with them")


RemeshOrOff = Annotated[
    Annotated[Remesh, Tag("mapping")] | Annotated[Literal[False], Tag("off"), WithJsonSchema(SWITCH_SCHEMA)],
    Discriminator(_remesh_tag),
    BeforeValidator(_parse_remesh),
]


class Config(Section):
    """What is not in a section.

    `remesh` is false where the model's own triangles are used.
    """

    version: Literal[1] = parameter(VERSION, "Version of this schema")
    preset: Names = parameter(
        (), "Shipped configs whose values come before those of the file, the last one winning"
    )
    seed: Whole = parameter(1, "Seed of every random number", ge=0, le=LARGEST_SEED)
    quality: Literal["draft", "standard", "fine", "reference", "auto"] | None = parameter(
        None,
        "Sets faces, steps and solver where they are not set beside it or after it: a point on the measured "
        "front of cost against error, or auto, the cheapest one that the scene allows",
    )
    model: Model = Model()
    scene: Scene = Scene()
    paint: Paint = Paint()
    remesh: RemeshOrOff = Remesh()
    ageing: Ageing = Ageing()
    tension: Tension = Tension()
    adhesion: Adhesion = Adhesion()
    cohesion: Cohesion = Cohesion()
    defects: Defects = Defects()
    lift: Lift = Lift()
    fracture: Fracture = Fracture()
    flaking: Flaking = Flaking()
    curl: Curl = Curl()
    deformation: Deformation = Deformation()
    dust: Dust = Dust()
    rust: Rust = Rust()
    environment: Environment = Environment()
    physical: Physical = Physical()
    appearance: Appearance = Appearance()
    snapshots: Snapshots = Snapshots()
    checkpoint: Checkpoint = Checkpoint()
    output: Output = Output()
    maps: Maps = Maps()
    steering: tuple[Steer, ...] = parameter(
        (), "Parameters changed place by place and over time, one after the other; see docs/steering.md"
    )

    def conflicts(self) -> list[tuple[str, str]]:
        """Values that are valid each but do not go together: (key, what is wrong)."""
        from weathercoat.config.physical import unused_values

        found = []
        if self.tension.law == "saturating" and self.tension.initial > 1:
            found.append(("tension.initial", "must be at most 1, the cap of the saturating law"))
        if self.snapshots.steps and self.snapshots.steps[-1] > self.ageing.steps:
            last, end = self.snapshots.steps[-1], self.ageing.steps
            found.append(("snapshots.steps", f"step {last} is after the end, ageing.steps is {end}"))
        scene = self.scene
        if scene.pixels_per_metre is not None and (scene.distance or scene.nearest):
            found.append(("scene.pixels_per_metre", "give it or the distance of a camera, not both"))
        found += unused_values(self.physical)
        if self.output.viewer and "ply" not in self.output.formats:
            found.append(("output.viewer", "the page is made of snapshots in PLY; add ply to output.formats"))
        if self.maps.when != "never" and "ply" not in self.output.formats:
            found.append(("maps.when", "maps are made of snapshots in PLY; add ply to output.formats"))
        if self.quality == "auto" and self.pixels_per_unit() is None:
            found.append(("quality", "auto needs scene.distance, scene.nearest or scene.pixels_per_metre"))
        return found

    def metres_per_unit(self) -> float | None:
        """Length of a unit of the model in metres: scene.metres_per_unit, else model.units; None where
        neither tells.
        """
        return self.scene.metres_per_unit or _METRES.get(self.model.units)

    def pixels_per_unit(self) -> float | None:
        """Pixels for a unit of the model, which is a metre unless something else is said; None where the
        scene does not tell.
        """
        return self.scene.pixels_per_unit(self.metres_per_unit() or 1.0)

    def as_dict(self) -> dict[str, Any]:
        """The resolved values under the file's keys, as plain lists, numbers and text."""
        return self.model_dump(mode="json", by_alias=True)


@dataclass(frozen=True)
class Parameter:
    """One key of the config: `key` is dotted; `kind` says what it accepts, bounds included."""

    key: str
    default: Any
    description: str
    kind: str
    unit: str
    symbol: str


def section_of(field: FieldInfo) -> type[Section] | None:
    """The section that a field holds, or None where it is a parameter."""
    if get_origin(field.annotation) is tuple:
        return None
    for kind in (field.annotation, *get_args(field.annotation)):
        while get_origin(kind) is Annotated:
            kind = get_args(kind)[0]
        if isinstance(kind, type) and issubclass(kind, Section):
            return kind
    return None


def entry_of(field: FieldInfo) -> type[Section] | None:
    """The section of which a field holds a list, or None."""
    if get_origin(field.annotation) is tuple:
        kind = get_args(field.annotation)[0]
        if isinstance(kind, type) and issubclass(kind, Section):
            return kind
    return None


@cache
def section_at(path: tuple[str, ...]) -> type[Section] | None:
    """The section at a path of keys, all of the config for none; None for a parameter or unknown key. An
    entry of a list is `[0]`.
    """
    section: type[Section] | None = Config
    entry: type[Section] | None = None
    for name in path:
        if name.startswith("["):
            section, entry = entry, None
            continue
        fields = () if section is None else section.model_fields.items()
        field = next((field for key, field in fields if (field.alias or key) == name), None)
        section, entry = (None, None) if field is None else (section_of(field), entry_of(field))
    return section


def parameters(section: type[Section] = Config, prefix: str = "") -> Iterator[Parameter]:
    """Every parameter below `section`, in the order of the schema."""
    for name, field in section.model_fields.items():
        key = prefix + (field.alias or name)
        inner = section_of(field)
        if inner is not None:
            yield from parameters(inner, key + ".")
            continue
        extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        yield Parameter(
            key=key,
            default="required" if field.is_required() else field.default,
            description=field.description or "",
            kind=_words_in(field.metadata)
            or _describe_kind(field.annotation) + _describe_bounds(field.metadata),
            unit=str(extra.get("unit", "")),
            symbol=str(extra.get("symbol", "")),
        )


def _words_in(metadata: Iterable[Any]) -> str:
    return next((words.text for words in metadata if isinstance(words, Words)), "")


def _describe_kind(kind: Any) -> str:
    """What a parameter of the type `kind` accepts, in words."""
    origin, inner = get_origin(kind), [part for part in get_args(kind) if part is not type(None)]
    if isinstance(kind, type) and issubclass(kind, Section):
        return "mapping"
    if origin is Annotated:
        return _words_in(inner[1:]) or _describe_kind(inner[0]) + _describe_bounds(inner[1:])
    if kind == get_args(Color)[0]:
        return '"#rrggbb" or [r, g, b]'
    if origin is Literal:
        return ", ".join(map(str, inner))
    if origin is tuple:
        many = "list of " if Ellipsis in inner else "three "
        return many + _describe_kind(inner[0]).replace("number", "numbers").replace("name", "names").replace(
            "mapping", "mappings"
        )
    if inner:
        return " or ".join(map(_describe_kind, inner))
    return {bool: "true, false", int: "whole number", float: "number", str: "name"}[kind]


def _describe_bounds(metadata: Iterable[Any]) -> str:
    words = ""
    kinds = ((Gt, "gt", "above"), (Ge, "ge", "from"), (Lt, "lt", "below"), (Le, "le", "to"))
    for bound in metadata:
        if isinstance(bound, FieldInfo):
            words += _describe_bounds(bound.metadata)
        for kind, name, word in kinds:
            if isinstance(bound, kind):
                value = getattr(bound, name)
                words += f" {word} " + (f"{int(value):,}" if value == int(value) else f"{value:.4g}")
    return words
