"""Small runs for the tests of the whole simulation: parameters that fail quickly, and what must hold after
every step.
"""

from __future__ import annotations

import numpy as np

from tests.zoo import fans_by_vertex
from weathercoat.deform.parameters import DeformParameters
from weathercoat.film.state import FilmParameters
from weathercoat.mesh.halfedge import check_half_edges, make_twins
from weathercoat.mesh.surface import Surface
from weathercoat.sim.simulation import Simulation, make_simulation
from weathercoat.sim.snapshot import Snapshot
from weathercoat.stain.rust import StainParameters

# A brittle film that separates early, on meshes of a few hundred faces: about half of it fails within the
# run.
FILM = {
    "tension_law": "saturating",
    "tension_initial": 0.0,
    "tension_rate": 3.0,
    "adhesion_base": 1.0,
    "adhesion_amplitude": 0.5,
    "adhesion_wavelength": 0.4,
    "adhesion_octaves": 3,
    "adhesion_gain": 0.5,
    "adhesion_decay_rate": 0.4,
    "cohesion_base": 1.5,
    "cohesion_scatter": 0.2,
    "cohesion_decay_rate": 0.5,
    "defects_rule": "share",
    "defects_share": 0.03,
    "defects_strength": 0.001,
    "lift_coefficient": 0.25,
    "lift_convexity": 2.0,
    "lift_sum": "per_valence",
    "lift_tension": "drying",
    "fracture_direction_threshold": 0.45,
    "fracture_direction_factor": 0.2,
    "fracture_relaxation": "shear_lag",
    "fracture_shear_lag": 0.08,
    "fracture_face_factor": 0.5,
    "fracture_rounds": "by_speed",
    "fracture_speed": 20.0,
    "flaking_rule": "islands",
    "flaking_hanging_share": 0.05,
}
CURL = {
    "curl_rule": "curvature",
    "curl_radius": 0.2,
    "curl_rate": 4.0,
    "curl_angle_rate": 0.8,
    "curl_angle_floor": 2.6,
    "deformation_solver": "sweeps",
    "deformation_sweeps": 5,
    "deformation_angle": "dihedral",
    "deformation_angle_stiffness": 1.0,
    "deformation_sleep_tolerance": 0.0,
    "deformation_iterations": 50,
    "deformation_tolerance": 1e-3,
    "deformation_film_thickness": 1e-2,
}
STAIN = {
    "dust_rate": 0.5,
    "rust_threshold": 0.1,
    "rust_source_rate": 3.0,
    "rust_source_cap": 0.9,
    "rust_runoff_speed": 1.0,
    "rust_runoff_length": 0.3,
    "rust_alignment": 0.7,
    "rust_side_share": 0.001,
    "rust_lifted_rate": 1.0,
    "rust_bare_rate": 3.0,
}
LITERAL_FILM = {
    "tension_law": "linear",
    "tension_rate": 2.0,
    "lift_sum": "plain",
    "lift_tension": "face",
    "fracture_relaxation": "faces",
    "fracture_rounds": "one",
    "flaking_rule": "faces",
}
STILL = {"deformation_solver": "none"}  # nothing moves
LITERAL_CURL = {"curl_rule": "angle", "deformation_angle": "split"}


def make_run(
    surface: Surface,
    *,
    steps: int = 40,
    seed: int = 1,
    film: dict[str, object] | None = None,
    curl: dict[str, object] | None = None,
    stain: dict[str, object] | None = None,
) -> Simulation:
    """A simulation with the parameters above but for these."""
    return make_simulation(
        surface,
        film=FilmParameters(**{**FILM, **(film or {})}),  # type: ignore[arg-type]
        deform=DeformParameters(**{**CURL, **(curl or {})}),  # type: ignore[arg-type]
        stain=StainParameters(**{**STAIN, **(stain or {})}),
        steps=steps,
        seed=seed,
    )


def finish(simulation: Simulation) -> Simulation:
    """Step to the end."""
    while simulation.step_count < simulation.steps:
        simulation.step()
    return simulation


def assert_invariants(simulation: Simulation, *, thorough: bool = True) -> None:
    """What holds after every step, whatever the parameters.

    Sums of a few hundred areas of a unit surface round at 1e-14; the substrate is met to 1e-9 of the size.
    """
    mesh, film = simulation.mesh, simulation.film
    assert check_half_edges(mesh) == ""
    live = np.repeat(mesh.alive, 3)
    used = np.unique(mesh.tail[live])
    if thorough:
        assert set(fans_by_vertex(mesh).values()) <= {1}, "a vertex is shared across a crack"
    corner = mesh.faces.reshape(-1)
    assert (mesh.origin[mesh.tail[live]] == corner[live]).all(), "a corner stems from another vertex"
    assert ((mesh.twin == make_twins(simulation.mesh.faces)) | (mesh.twin == -1)).all(), "a twin is new"

    attached = used[~film.separated[used]]
    origin = mesh.origin
    assert (mesh.positions[attached] == mesh.rest_positions[origin[attached]]).all(), (
        "an attached vertex moved"
    )
    assert len(np.unique(origin[attached])) == len(attached), "an attached vertex was split"

    rest = mesh.rest_positions[mesh.faces]
    areas = 0.5 * np.linalg.norm(np.cross(rest[:, 1] - rest[:, 0], rest[:, 2] - rest[:, 0]), axis=1)
    assert abs(areas[mesh.alive].sum() + sum(simulation.flake_areas) - areas.sum()) < 1e-12, "area is lost"

    offset = mesh.positions[used] - mesh.rest_positions[origin[used]]
    height = np.einsum("ij,ij->i", offset, mesh.rest_normals[origin[used]])
    assert height.min(initial=0.0) >= -1e-9, "film below the tangent plane of the metal"

    assert np.isfinite(mesh.positions[used]).all()
    assert np.abs(offset).max(initial=0.0) < 10.0, "film has flown off"
    for values in (film.tension, film.tension_cap, film.cohesion, film.adhesion, simulation.rust.film):
        assert np.isfinite(values).all()
    assert (film.tension >= 0.0).all()
    assert (simulation.rust.film >= 0.0).all() and (simulation.rust.film <= 1.0).all()
    tips = np.flatnonzero(film.is_tip[: mesh.vertex_count])
    np.testing.assert_allclose(np.linalg.norm(film.crack_direction[tips], axis=1), 1.0, rtol=1e-12)


def snapshot_bytes(snapshot: Snapshot) -> bytes:
    """All of a snapshot."""
    arrays = (getattr(snapshot, name) for name in snapshot.__dataclass_fields__ if name != "surface")
    return b"".join(np.asarray(array).tobytes() for array in arrays)


def failed_shares(simulation: Simulation) -> dict[str, float]:
    """Shares of vertices of the metal that the film has let go, of fallen area, and of cracked faces."""
    lifted = np.isfinite(simulation.rust.lifted_age)
    frayed = np.isfinite(simulation.film.fray_age)
    return {
        "separated": float(lifted.mean()),
        "lost": float(sum(simulation.flake_areas)),
        "cracked": float(frayed.mean()),
    }
