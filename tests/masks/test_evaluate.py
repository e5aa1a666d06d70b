"""Entries of a config as changes of a simulation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.sim.runs import STILL, finish, make_run
from weathercoat.config.steering import Steer
from weathercoat.errors import ConfigError
from weathercoat.masks.evaluate import make_changes, require_masks
from weathercoat.masks.files import NO_MASKS, MaskSource
from weathercoat.mesh.halfedge import make_twins
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.mesh.surface import Part, Surface
from weathercoat.sim.simulation import Simulation


def make_sheet() -> Surface:
    """A unit sheet in the xy plane with colours, texture coordinates and two groups: red and u are x, v is
    y, and `right` begins at half of x.
    """
    sheet = make_random_sheet(600, seed=2)
    low = sheet.vertices.min(axis=0)
    vertices = sheet.vertices - low
    vertices = vertices / np.where(np.ptp(vertices, axis=0) > 0, np.ptp(vertices, axis=0), 1.0)
    right = vertices[sheet.faces][:, :, 0].mean(axis=1) > 0.5
    colors = np.ones((len(vertices), 4))
    colors[:, 0] = vertices[:, 0]
    return replace(
        sheet,
        vertices=vertices,
        up=(0.0, 1.0, 0.0),
        colors=colors,
        uv=vertices[sheet.faces][:, :, :2],
        face_group=right.astype(np.int32),
        groups=("left", "right"),
        face_part=right.astype(np.int32),
        parts=(Part("door.left"), Part("door.right")),
    )


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    return make_run(make_sheet())


def mask_of(simulation: Simulation, source: MaskSource = NO_MASKS, **by: object) -> np.ndarray:
    entry = Steer.model_validate({"change": "dirt", "multiply": 2, "by": by})
    return make_changes([entry], simulation, source)[0].mask


def test_colours_heights_and_lines(simulation: Simulation) -> None:
    x, y = simulation.surface.vertices[:, 0], simulation.surface.vertices[:, 1]
    np.testing.assert_array_equal(mask_of(simulation, color="r"), x)
    np.testing.assert_array_equal(mask_of(simulation, height={"to": 0.25}), y <= 0.25)
    inverted = mask_of(simulation, height={"to": 0.25}, color="r", invert=True)
    np.testing.assert_allclose(inverted, 1.0 - x * (y <= 0.25))
    size = simulation.frame.size
    near = mask_of(simulation, line={"points": [[0, 0, 0], [0, 1, 0]], "within": 0.1, "soft": 0})
    np.testing.assert_array_equal(near, x / size <= 0.1)


def test_rims_directions_and_groups(simulation: Simulation) -> None:
    x, y = simulation.surface.vertices[:, 0], simulation.surface.vertices[:, 1]
    to_rim = np.minimum(np.minimum(x, 1.0 - x), np.minimum(y, 1.0 - y)) / simulation.frame.size
    found = mask_of(simulation, edges={"within": 0.1, "soft": 0})
    np.testing.assert_array_equal(
        found[np.abs(to_rim - 0.1) > 1e-9], (to_rim <= 0.1)[np.abs(to_rim - 0.1) > 1e-9]
    )
    assert (mask_of(simulation, edges={"rims": False}) == 0.0).all()
    assert (mask_of(simulation, direction={"towards": "z", "within": 1, "soft": 0}) == 1.0).all()
    assert (mask_of(simulation, direction={"towards": "-z"}) == 0.0).all()
    for name in ("ri*", "door.right"):
        group = mask_of(simulation, group=name)
        assert (group[x > 0.6] == 1.0).all() and (group[x < 0.4] == 0.0).all()


def test_a_picture_on_the_texture_coordinates(simulation: Simulation, tmp_path: Path) -> None:
    """Black to white from left to right: bilinear sampling of a ramp gives the ramp, but for half a texel."""
    ramp = np.tile(np.arange(256, dtype=np.uint8), (4, 1))
    Image.fromarray(ramp).save(tmp_path / "ramp.png")
    found = mask_of(simulation, MaskSource("", tmp_path), image={"file": "ramp.png"})
    x = simulation.surface.vertices[:, 0]
    inner = (x > 0.01) & (x < 0.99)
    np.testing.assert_allclose(found[inner], x[inner], atol=3e-3)


def test_a_guide_is_a_band_of_low_cohesion_no_narrower_than_the_edges(simulation: Simulation) -> None:
    entry = Steer.model_validate({"guide": [[0, 0.5, 0], [1, 0.5, 0]], "width": 1e-6})
    (change,) = make_changes([entry], simulation, NO_MASKS)
    assert change.parameter == "cohesion" and change.multiplies and change.keys == ((0.0, 0.05),)
    away = np.abs(simulation.surface.vertices[:, 1] - 0.5) / simulation.frame.size
    np.testing.assert_array_equal(change.mask, away <= simulation.film.mean_edge)


@pytest.mark.parametrize(
    ("by", "line"),
    [
        ({"color": "g"}, "steering[0].by[0].color: model has no vertex colours"),
        ({"image": {"file": "a.png"}}, "steering[0].by[0].image: model has no texture coordinates"),
        (
            {"group": ["left", "roof*"]},
            "steering[0].by[0].group: roof* fits nothing in model, of left, right",
        ),
    ],
)
def test_what_a_mask_needs_is_asked_for_before_any_work(by: object, line: str) -> None:
    bare = replace(make_sheet(), colors=None, uv=None, parts=(), face_part=None, name="model")
    entry = Steer.model_validate({"change": "dirt", "multiply": 2, "by": by})
    with pytest.raises(ConfigError) as caught:
        require_masks([entry], bare, "own.yaml:3")
    assert caught.value.lines() == [f"own.yaml:3: E-CONFIG: {line}"]


def test_cracks_follow_a_guide() -> None:
    """On a film that lets go everywhere and does not fall: crack length along a slanted line, with a guide
    there and without. The film's own cracks begin at defects.
    """
    film = {
        "adhesion_base": 0.1,
        "adhesion_amplitude": 0.0,
        "cohesion_base": 2.5,
        "defects_share": 0.003,
        "flaking_rule": "faces",
    }

    def length_along(guided: bool) -> float:
        sheet = make_random_sheet(3000, seed=4)
        simulation = make_run(sheet, steps=60, film=film, curl=STILL)
        low, high = sheet.vertices.min(axis=0), sheet.vertices.max(axis=0)
        line = [(low + (high - low) * (t, 0.3 + 0.4 * t, 0.0)).tolist() for t in (0.0, 1.0)]
        if guided:
            entry = Steer.model_validate({"guide": line, "width": 0.02})
            simulation.steer(make_changes([entry], simulation, NO_MASKS))
        finish(simulation)
        mesh = simulation.mesh
        here = np.arange(len(mesh.twin))
        whole = mesh.faces.reshape(-1), np.roll(mesh.faces, -1, axis=1).reshape(-1)
        broken = (make_twins(mesh.faces) > here) & (mesh.twin < 0)
        start, end = (simulation.surface.vertices[corner[broken]] for corner in whole)
        middle, way = 0.5 * (start + end), np.array(line[1]) - np.array(line[0])
        unit = way / np.linalg.norm(way)
        away = np.linalg.norm(np.cross(middle - line[0], unit), axis=1) / simulation.frame.size
        along = np.abs((end - start) @ unit) / np.linalg.norm(way)
        return float(along[away < 1.5 * simulation.film.mean_edge].sum())

    with_guide, without = length_along(True), length_along(False)
    assert with_guide > 0.7  # of the line's length
    assert with_guide > 3.0 * without
