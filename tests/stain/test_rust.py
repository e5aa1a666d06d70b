"""Rust of the metal: closed forms of the ages at which its film lifted and fell."""

from __future__ import annotations

import numpy as np
import pytest

from tests import zoo
from tests.zoo import make_mesh
from weathercoat.mesh.halfedge import drop_face, make_event_log
from weathercoat.stain.rust import (
    StainParameters,
    expose_lifted,
    follow_events,
    make_rust_state,
    metal_rust_at,
)

STAIN = StainParameters(rust_lifted_rate=0.5, rust_bare_rate=3.0)


def test_metal_rusts_by_the_closed_form() -> None:
    """r' = rate (1 - r): 1 - exp(-(rate under lifted film . time lifted + rate when bare . time bare))."""
    mesh = make_mesh(zoo.make_two_pieces())
    rust = make_rust_state(mesh)
    expose_lifted(mesh, rust, np.array([7, 8, 9], np.int32), 0.2)
    log = make_event_log(7)
    drop_face(mesh, log, 6)
    follow_events(mesh, rust, log, 0.6)
    for age, lifted, bare in ((0.1, 0, 0), (0.2, 0, 0), (0.5, 0.3, 0), (0.6, 0.4, 0), (1.6, 0.4, 1.0)):
        expected = np.zeros(10)
        expected[7:] = 1 - np.exp(-0.5 * lifted - 3.0 * bare)
        np.testing.assert_allclose(metal_rust_at(rust, STAIN, age), expected, atol=1e-15)


def test_metal_is_bare_when_the_last_film_over_it_is_gone() -> None:
    """The centre of a disc loses its faces one by one, a rim vertex its two: bare at the age of the last."""
    surface = zoo.make_disc(6)
    mesh, rust, log = make_mesh(surface), make_rust_state(make_mesh(surface)), make_event_log(6)
    mesh.twin[:] = -1
    for f in range(6):
        log.clear()
        drop_face(mesh, log, f)
        follow_events(mesh, rust, log, 0.1 * (f + 1))
        assert np.isinf(rust.bare_age[0]) == (f < 5)
    assert rust.bare_age[0] == pytest.approx(0.6)
    np.testing.assert_allclose(rust.bare_age[1:7], [0.6, 0.2, 0.3, 0.4, 0.5, 0.6])
    assert (rust.film_corners == 0).all()
