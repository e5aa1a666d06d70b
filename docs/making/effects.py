"""Pictures of what each parameter does: a small part aged with it low and high, or with each choice."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from PIL import Image

import weathercoat
from making.places import IMAGES, save_picture
from weathercoat.config.load import load_config
from weathercoat.mesh.shapes import make_bracket, make_plate
from weathercoat.mesh.surface import Surface
from weathercoat.output.pictures import render_snapshot
from weathercoat.recording import picture_parameters

FOLDER = IMAGES / "parameters"
FACES, STEPS, SHARE = 3000, 250, 0.6
WIDTH, HEIGHT = 280, 210


@dataclass(frozen=True)
class Effect:
    """The values of a key to show, and what else is set so that its effect shows."""

    values: tuple[object, ...]
    also: tuple[str, ...] = ()
    part: str = "plate"
    share: float = SHARE  # of the run that has passed in the picture


_SHARES = ("defects.rule=share",)
_FACES = ("fracture.relaxation=faces", "flaking.rule=faces")
_ANGLE = ("curl.rule=angle", "curl.angle_rate=3", "curl.angle_floor=1.8")
_STREAKS = ("appearance.paint='#d2cdbc'", "rust.source_rate=6", "rust.runoff_speed=3", "rust.lifted_rate=0")

EFFECTS: dict[str, Effect] = {
    "seed": Effect((1, 2)),
    "remesh.faces": Effect((600, 12000)),
    "remesh.crease_angle": Effect((30, 120), part="bracket"),
    "ageing.steps": Effect((50, 1000)),
    "ageing.duration": Effect((0.6, 1.5)),
    "tension.law": Effect(("saturating", "linear"), ("tension.rate=1.5",), share=0.8),
    "tension.initial": Effect((0, 0.9), share=0.4),
    "tension.rate": Effect((1, 10)),
    "adhesion.base": Effect((0.8, 1.4)),
    "adhesion.amplitude": Effect((0.1, 1.5)),
    "adhesion.wavelength": Effect((0.08, 0.8)),
    "adhesion.octaves": Effect((1, 6)),
    "adhesion.gain": Effect((0.2, 0.9)),
    "adhesion.decay_rate": Effect((0.25, 0.9)),
    "cohesion.base": Effect((0.5, 3.5)),
    "cohesion.scatter": Effect((0, 0.7)),
    "cohesion.decay_rate": Effect((0, 8), _FACES),
    "defects.rule": Effect(("per_area", "share")),
    "defects.density": Effect((30, 3000)),
    "defects.share": Effect((0.002, 0.1), _SHARES),
    "defects.strength": Effect((0.001, 0.9)),
    "lift.coefficient": Effect((0.22, 0.4)),
    "lift.convexity": Effect((0, 5), part="bracket"),
    "lift.sum": Effect(("per_valence", "plain")),
    "lift.tension": Effect(("drying", "face")),
    "fracture.direction_threshold": Effect((0.1, 0.95)),
    "fracture.direction_factor": Effect((0.05, 0.9)),
    "fracture.relaxation": Effect(("shear_lag", "faces")),
    "fracture.shear_lag": Effect((0.02, 0.12)),
    "fracture.face_factor": Effect((0.1, 0.95), _FACES),
    "fracture.rounds": Effect(("by_speed", "one")),
    "fracture.speed": Effect((0.3, 40), share=0.5),
    "flaking.rule": Effect(("islands", "faces"), share=0.8),
    "flaking.hanging_share": Effect((0, 0.4), share=0.8),
    "curl.rule": Effect(("curvature", "angle")),
    "curl.radius": Effect((0.025, 0.4)),
    "curl.rate": Effect((1, 40)),
    "curl.angle_rate": Effect((0.3, 6), ("curl.rule=angle", "curl.angle_floor=1.8")),
    "curl.angle_floor": Effect((1.8, 3.0), _ANGLE[:2]),
    "deformation.sweeps": Effect((1, 100)),
    "deformation.solver": Effect(("sweeps", "momentum", "newton")),
    "deformation.film_thickness": Effect((5e-4, 1e-2), ("deformation.solver=newton",)),
    "deformation.angle": Effect(("dihedral", "split", "arccos")),
    "deformation.angle_stiffness": Effect((0.02, 1)),
    "dust.rate": Effect((0, 3), part="bracket"),
    "rust.threshold": Effect((0.02, 0.6), _STREAKS),
    "rust.source_rate": Effect((0.5, 20), _STREAKS),
    "rust.source_cap": Effect((0.2, 1), _STREAKS),
    "rust.runoff_speed": Effect((0.1, 6), _STREAKS),
    "rust.runoff_length": Effect((0.03, 1), _STREAKS),
    "rust.alignment": Effect((0.2, 0.95), _STREAKS),
    "rust.side_share": Effect((0, 0.5), _STREAKS),
    "environment.wear": Effect((0.3, 1.7)),
    "environment.corrosion": Effect((0.02, 3.7)),
    "environment.rain": Effect((0.05, 3), _STREAKS),
    "environment.dirt": Effect((0.3, 4), part="bracket"),
    "rust.lifted_rate": Effect((0, 8), ("rust.bare_rate=0",)),
    "rust.bare_rate": Effect((0, 15), ("rust.lifted_rate=0",)),
    "appearance.thickness": Effect((0.0005, 0.012)),
}

# Why a parameter has no picture of its own.
WITHOUT_PICTURE: dict[str, str] = {
    "version": "names the schema; no effect on a picture",
    "preset": "stands for the values of a shipped config; see the [gallery](gallery.md)",
    "quality": "sets several keys at once; see [fidelity](fidelity.md)",
    "scene.distance": "for `quality: auto`; see [fidelity](fidelity.md)",
    "scene.nearest": "for `quality: auto`",
    "scene.field_of_view": "for `quality: auto`",
    "scene.image_height": "for `quality: auto`",
    "scene.pixels_per_metre": "for `quality: auto`",
    "scene.metres_per_unit": "tells sizes in millimetres, and for `quality: auto`",
    "model.units": "tells sizes in millimetres; see [severity](severity.md)",
    "ageing.until": "stops the run early; see [severity](severity.md)",
    "model.up": "turns where rust runs and dust lies, with the model",
    "paint.only": "parts that it leaves out are drawn as they came",
    "paint.except": "parts that it leaves out are drawn as they came",
    "appearance.look": "whether the model's own textures show",
    "appearance.paint": "a colour",
    "appearance.back": "a colour",
    "appearance.metal": "a colour",
    "appearance.rust": "a colour",
    "appearance.dust": "a colour",
    "appearance.young_rust": "a colour",
    "appearance.old_rust": "a colour",
    "appearance.stain": "a colour",
    "steering": "see [steering](steering.md)",
    "physical.years": "sets other keys; see [physical units](physical.md)",
    "physical.lifetime": "for `physical.years`",
    "physical.stress": "sets other keys",
    "physical.strength": "sets other keys",
    "physical.adhesion": "sets other keys",
    "physical.thickness": "sets other keys",
    "physical.modulus": "sets other keys",
    "physical.poisson": "for the keys that others set",
    "physical.skin": "for the keys that others set",
    "physical.size": "sets other keys",
    "deformation.iterations": "how long a solver may look for balance; see [accuracy](accuracy.md)",
    "deformation.tolerance": "how near a solver comes to balance; see [accuracy](accuracy.md)",
    "deformation.sleep_tolerance": "saves time where film is at rest; see [performance](performance.md)",
    "snapshots.count": "when, not what, is recorded",
    "snapshots.steps": "when, not what, is recorded",
    "checkpoint.minutes": "when the state is kept; see [runs that go on](shell.md)",
    "checkpoint.steps": "when the state is kept",
    "checkpoint.keep": "whether the last state stays",
    "output.formats": "which files are written",
    "output.viewer": "whether a page is written; see [viewer](viewer.md)",
    "output.preview": "whether a picture is drawn",
    "maps.when": "of baked maps; see [maps](maps.md)",
    "maps.names": "of baked maps; see [maps](maps.md)",
    "maps.width": "of baked maps; see [maps](maps.md)",
    "maps.height": "of baked maps; see [maps](maps.md)",
    "maps.format": "of baked maps; see [maps](maps.md)",
    "maps.bits": "of baked maps; see [maps](maps.md)",
    "maps.padding": "of baked maps; see [maps](maps.md)",
    "maps.pack": "of baked maps; see [maps](maps.md)",
    "maps.atlas": "of baked maps; see [maps](maps.md)",
    "output.picture_width": "the size of pictures",
    "output.picture_height": "the size of pictures",
}


def picture_name(key: str) -> str:
    """File name of the strip of a key, in `FOLDER`."""
    return f"{key.replace('.', '_')}.webp"


def draw_effects(keys: Iterable[str] | None = None) -> None:
    """Draw the strip of each key: one picture for each of its values, in their order."""
    for key in keys or EFFECTS:
        pictures = [_draw(EFFECTS[key], key, value) for value in EFFECTS[key].values]
        save_picture(Image.fromarray(np.concatenate(pictures, axis=1)), FOLDER / picture_name(key))


def _draw(effect: Effect, key: str, value: object) -> np.ndarray:
    overrides = [f"ageing.steps={STEPS}", f"remesh.faces={FACES}", *effect.also, f"{key}={value}"]
    config = load_config("standard", overrides).config
    surface = _part(effect.part, config.remesh.faces, config.remesh.crease_angle)
    simulation = weathercoat.simulate(surface, "standard", overrides, until=effect.share)
    view = {"azimuth": 18.0, "elevation": 12.0} if effect.part == "plate" else {}
    parameters = replace(
        picture_parameters(config), width=WIDTH, height=HEIGHT, margin=0.05, samples=3, **view
    )
    return render_snapshot(simulation.snapshot(), parameters)


@cache
def _part(name: str, faces: int, crease_angle: float) -> Surface:
    part = make_bracket() if name == "bracket" else make_plate(width=1.0, height=0.75)
    return weathercoat.remesh(part, faces=faces, crease_angle=crease_angle)
