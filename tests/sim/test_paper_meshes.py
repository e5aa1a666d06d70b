"""The authors' plate, curved plate and bunny over a whole run: from intact to heavily peeled, in flakes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from weathercoat.config.load import load_config
from weathercoat.mesh.halfedge import check_half_edges
from weathercoat.mesh.read import read_surface
from weathercoat.mesh.remesh import RemeshParameters, remesh
from weathercoat.run import prepare_simulation

MESHES = [("aki_Plane.obj", 3000), ("aki_Curve2.obj", 3000), ("aki_bunny2.obj", 10_000)]


@pytest.mark.long
@pytest.mark.parametrize("is_remeshed", [False, True])
@pytest.mark.parametrize(("name", "faces"), MESHES)
def test_a_whole_run_peels_in_flakes(meshes_folder: Path, name: str, faces: int, is_remeshed: bool) -> None:
    """Little is lost at a quarter of the age and much at the end; what fell has many faces, hardly any one.

    The plates' own triangles are as coarse as the shear lag, so their flakes have few faces.
    """
    painted = read_surface(meshes_folder / name)
    surface = remesh(painted, RemeshParameters(faces=faces, seed=1)) if is_remeshed else painted
    simulation = prepare_simulation(surface, load_config("standard").config, painted)
    area = simulation.surface.face_areas() / simulation.surface.area()
    lost = {}
    while simulation.step_count < simulation.steps:
        simulation.step()
        if simulation.step_count % 250 == 0:
            assert check_half_edges(simulation.mesh) == ""
            lost[simulation.step_count] = float(area[~simulation.mesh.alive].sum())
    assert lost[250] < 0.1 and lost[500] < 0.5 and 0.35 < lost[1000] < 0.95
    mean_face = 1.0 / len(area)
    flakes = np.array(simulation.flake_areas) / mean_face
    assert np.median(flakes) >= 4
    assert flakes[flakes < 1.5].sum() < 0.02 * flakes.sum(), "area that fell as single triangles"
    cracks = simulation.mesh.vertex_count - len(simulation.mesh.rest_positions)
    assert cracks > 0.1 * len(simulation.mesh.rest_positions)
    assert simulation.residual().strain_rms < 0.06
