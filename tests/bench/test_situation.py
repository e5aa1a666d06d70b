"""The benchmark's situation comes about: what it states of separation, breaks and losses is met."""

from __future__ import annotations

import numpy as np
import pytest

from weathercoat.bench.layout import BREAKS_PER_FACE, SEPARATED_SHARE, lay_out_load
from weathercoat.bench.situation import (
    Load,
    find_deviations,
    load_speed_config,
    make_speed_simulation,
    measure_load,
)
from weathercoat.film.start import lay_out_film
from weathercoat.film.state import FilmParameters
from weathercoat.mesh.halfedge import make_half_edges
from weathercoat.mesh.shapes import make_random_sheet, make_sphere
from weathercoat.mesh.surface import Surface
from weathercoat.run import fill


def test_load_rises_evenly_to_what_is_stated() -> None:
    """3,000 faces, in fewer steps and sweeps than the benchmark, which do not set the load."""
    surface = make_random_sheet(3000)
    config = load_speed_config(steps=100)
    config = config.model_copy(update={"deformation": config.deformation.model_copy(update={"sweeps": 2})})
    simulation = make_speed_simulation(surface, config)
    assert measure_load(simulation, 0) == Load(0.0, 0, 0.0)
    broken = 0
    for tenth in range(1, 11):
        for _ in range(10):
            simulation.step()
            broken += int(simulation.log.counts[1])
        load = measure_load(simulation, broken)
        assert load.separated_share == pytest.approx(SEPARATED_SHARE * tenth / 10, abs=0.012)
        assert load.broken_edges == pytest.approx(BREAKS_PER_FACE * 3000 * tenth / 10, abs=25)
    assert find_deviations(load, 3000) == []


def test_adhesion_keeps_the_order_of_the_noise() -> None:
    surface = make_random_sheet(500)
    mesh = make_half_edges(surface.vertices, surface.faces)
    parameters = fill(FilmParameters, load_speed_config())
    noise = lay_out_film(mesh, parameters, 1).adhesion
    assert (np.argsort(lay_out_load(mesh, parameters, 1).adhesion) == np.argsort(noise)).all()


@pytest.mark.parametrize("surface", [make_random_sheet(2000), make_sphere(subdivisions=3)])
def test_weak_edges_close_no_loop_and_stay_off_the_rim(surface: Surface) -> None:
    simulation = make_speed_simulation(surface, load_speed_config())
    mesh, cohesion = simulation.mesh, simulation.film.cohesion
    weak = np.flatnonzero((cohesion < 1.0) & (np.arange(len(mesh.twin)) < mesh.twin))
    wanted = BREAKS_PER_FACE * len(surface.faces)
    assert 0.95 * wanted <= len(weak) <= wanted
    assert (cohesion[mesh.twin[weak]] < 1.0).all()
    rim = set(mesh.tail[mesh.twin < 0].tolist())
    root = {v: v for v in range(len(surface.vertices))}

    def find(v: int) -> int:
        while root[v] != v:
            v = root[v]
        return v

    for h in weak.tolist():
        a, b = int(mesh.tail[h]), int(mesh.tail[mesh.twin[h]])
        assert find(a) != find(b)
        assert a not in rim and b not in rim
        root[find(a)] = find(b)


def test_deviations_are_named() -> None:
    assert find_deviations(Load(0.6, 2000, 0.0), 10_000) == []
    found = find_deviations(Load(0.5, 1500, 0.1), 10_000)
    assert [line.split()[0] for line in found] == ["50.0%", "1,500", "10.0%"]
