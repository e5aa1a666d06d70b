"""Risk on the texture coordinates of the model."""

from __future__ import annotations

import numpy as np

from weathercoat.mesh.shapes import make_plate
from weathercoat.output.risk import draw_risk_map


def test_a_map_shows_each_vertex_where_its_texture_is() -> None:
    """The texture of a plate is its place, so the picture is the colours as a function of that."""
    plate = make_plate(width=1.0, height=1.0)
    corner = plate.vertices[plate.faces]
    axes = np.argsort(np.ptp(plate.vertices, axis=0))[1:]
    low, span = plate.vertices.min(axis=0)[axes], np.ptp(plate.vertices, axis=0)[axes]
    uv = 0.25 + 0.5 * (corner[..., axes] - low) / span + (3.0, 0.0)  # in another tile
    place = (plate.vertices[:, axes] - low) / span
    picture = draw_risk_map(plate, uv, np.column_stack([place, np.zeros(len(place))]), size=256)
    assert (picture[10, 10] == (250, 250, 249)).all(), "what no face covers is paper"
    for column, row in ((70, 180), (128, 128), (180, 80)):
        u, v = (column + 0.5) / 256, 1.0 - (row + 0.5) / 256
        expected = 255 * 2.0 * (np.array([u, v]) - 0.25)
        np.testing.assert_allclose(picture[row, column, :2], expected, atol=2.0)
