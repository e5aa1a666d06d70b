"""Colours of the film in the viewer, from the model's own materials."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.output.textured import write_gate
from weathercoat.mesh.read import read_surface
from weathercoat.mesh.remesh import RemeshParameters, remesh
from weathercoat.mesh.shapes import make_plate
from weathercoat.output.viewer.base import base_colors

PAINT = (0.1, 0.5, 0.2)


def test_a_texture_colours_the_vertices_where_it_lies(tmp_path: Path) -> None:
    """The left half of each picture has its colour, the right half a darker one."""
    surface = remesh(read_surface(write_gate(tmp_path / "gate.glb")), RemeshParameters(faces=4000))
    colors = base_colors(surface, "auto", PAINT)
    assert colors is not None and surface.uv is not None and surface.face_part is not None
    middle = surface.uv.mean(axis=1)[:, 0]
    for material, full in enumerate(((170, 110, 60), (60, 90, 150))):
        own = np.array([part.material for part in surface.parts])[surface.face_part] == material
        for chosen, expected in (
            (own & (middle < 0.42), np.array(full)),
            (own & (middle > 0.58), np.array(full) // 2),
        ):
            if chosen.any():
                found = np.median(colors[surface.faces[chosen]].reshape(-1, 3), axis=0)
                np.testing.assert_allclose(found, expected, atol=3)


def test_there_are_none_where_paint_shows(tmp_path: Path) -> None:
    model = read_surface(write_gate(tmp_path / "gate.glb"))
    assert base_colors(model, "paint", PAINT) is None
    assert base_colors(make_plate(), "auto", PAINT) is None
    assert base_colors(None, "auto", PAINT) is None
