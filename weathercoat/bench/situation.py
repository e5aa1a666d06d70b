"""The situation that the benchmark times: the shipped config at the scale of a mesh, and whether it came
about.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from weathercoat.bench.layout import BREAKS_PER_FACE, SEPARATED_SHARE, lay_out_load
from weathercoat.config.load import Override, load_config
from weathercoat.config.schema import Config
from weathercoat.deform.parameters import DeformParameters
from weathercoat.film.state import FilmParameters
from weathercoat.mesh.surface import Surface
from weathercoat.run import fill
from weathercoat.sim.simulation import Simulation, make_simulation
from weathercoat.stain.rust import StainParameters

CONFIG = Path(__file__).with_name("speed.yaml")
REFERENCE_FACES = 10_000  # of the mesh that the lengths of the config are for
_TOLERANCE = 0.05  # relative, of the separated share and of the breaks
_LARGEST_LOSS = 0.02


@dataclass(frozen=True)
class Load:
    """What a run has come to: shares of the vertices that separated and of the faces that fell, and the
    broken edges.
    """

    separated_share: float
    broken_edges: int
    lost_share: float


def load_speed_config(steps: int = 1000, overrides: Sequence[str] = ()) -> Config:
    """The config of the benchmark, its run divided into `steps` steps; overrides: `key=value`."""
    return load_config(CONFIG, [Override("ageing.steps", steps, "--steps"), *overrides]).config


def make_speed_simulation(surface: Surface, config: Config, threads: int = 1) -> Simulation:
    """A simulation of the benchmark's situation on a manifold, oriented surface, for so many threads.

    Raises ValueError where it is no such surface.
    """
    scale = math.sqrt(REFERENCE_FACES / len(surface.faces))
    film = fill(FilmParameters, config)
    film = replace(
        film,
        adhesion_wavelength=film.adhesion_wavelength * scale,
        fracture_shear_lag=film.fracture_shear_lag * scale,
        fracture_speed=film.fracture_speed * scale,
    )
    deform = fill(DeformParameters, config)
    deform = replace(
        deform,
        curl_radius=deform.curl_radius * scale,
        deformation_sleep_tolerance=deform.deformation_sleep_tolerance * scale,
    )
    return make_simulation(
        surface,
        film=film,
        deform=deform,
        stain=fill(StainParameters, config),
        steps=config.ageing.steps,
        duration=config.ageing.duration,
        seed=config.seed,
        lay_out=lay_out_load,
        threads=threads,
    )


def measure_load(simulation: Simulation, broken_edges: int) -> Load:
    """The load of a simulation in which so many edges have broken."""
    rest_vertices = len(simulation.film.adhesion)
    return Load(
        separated_share=float(simulation.film.separated[:rest_vertices].mean()),
        broken_edges=broken_edges,
        lost_share=float(1.0 - simulation.mesh.alive.mean()),
    )


def find_deviations(load: Load, faces: int) -> list[str]:
    """Where a run to its end was not the situation that the benchmark is about, in words; mostly nowhere."""
    found = []
    wanted_breaks = BREAKS_PER_FACE * faces
    if abs(load.separated_share / SEPARATED_SHARE - 1.0) > _TOLERANCE:
        found.append(f"{load.separated_share:.1%} of the vertices separated instead of {SEPARATED_SHARE:.0%}")
    if abs(load.broken_edges / wanted_breaks - 1.0) > _TOLERANCE:
        found.append(f"{load.broken_edges:,} edges broke instead of {wanted_breaks:,.0f}")
    if load.lost_share > _LARGEST_LOSS:
        found.append(f"{load.lost_share:.1%} of the faces fell, more than {_LARGEST_LOSS:.0%}")
    return found
