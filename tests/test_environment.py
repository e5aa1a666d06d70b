"""Environments: factors on rates, and what they make of a run."""

from __future__ import annotations

import numpy as np

from weathercoat.config.load import load_config
from weathercoat.film.state import FilmParameters
from weathercoat.mesh.shapes import make_plate
from weathercoat.run import fill, prepare_simulation, remesh_painted
from weathercoat.sim.simulation import Simulation
from weathercoat.stain.rust import StainParameters

CLASSES = ("c1", "c2", "c3", "c4", "c5")


def aged(config: str) -> Simulation:
    loaded = load_config(config, ["remesh.faces=1500", "ageing.steps=60"]).config
    simulation = prepare_simulation(remesh_painted(make_plate(width=1.0, height=0.7), loaded), loaded)
    while simulation.step_count < simulation.steps:
        simulation.step()
    return simulation


def test_an_environment_multiplies_the_rates_of_the_paint() -> None:
    plain, salty = (load_config(name).config for name in ("rusting", "rusting+c5"))
    factors = salty.environment
    film = fill(FilmParameters, salty)
    assert film.adhesion_decay_rate == plain.adhesion.decay_rate * factors.wear
    assert film.adhesion_base == plain.adhesion.base
    stain = fill(StainParameters, salty)
    assert stain.rust_bare_rate == plain.rust.bare_rate * factors.corrosion
    assert stain.rust_runoff_length == plain.rust.runoff_length * factors.rain
    assert stain.dust_rate == plain.dust.rate * factors.dirt


def test_c3_changes_nothing() -> None:
    kinds = (FilmParameters, StainParameters)
    plain, town = (load_config(name).config for name in ("rusting", "rusting+c3"))
    assert [fill(kind, plain) for kind in kinds] == [fill(kind, town) for kind in kinds]


def test_harsher_classes_separate_and_rust_more() -> None:
    last = [aged(f"rusting+{name}").snapshot() for name in CLASSES]
    rust = [float(snapshot.substrate_rust.mean()) for snapshot in last]
    separated = [len(np.unique(s.film_origin[s.separated])) + int(s.bare.sum()) for s in last]
    assert rust == sorted(rust) and rust[0] < 0.2 * rust[-1]
    assert separated == sorted(separated) and separated[0] < separated[-1]
