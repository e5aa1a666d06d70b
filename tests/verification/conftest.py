"""A finished run with all that a run can write, made once."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.verification.runs import make_run
from weathercoat.mesh.shapes import make_pipe
from weathercoat.mesh.surface import make_surface


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that lost film, in both formats, with a picture and an unpainted part."""
    pipe = make_pipe()
    count, others = len(pipe.vertices), np.array([(3.0, 0.0, 0.0), (4.0, 0.0, 0.0), (3.0, 1.0, 0.0)])
    surface = make_surface(
        np.concatenate([pipe.vertices, others]),
        np.concatenate([pipe.faces, [(count, count + 1, count + 2)]]),
        face_group=np.append(np.zeros(len(pipe.faces)), 1),
        groups=("pipe", "{sheet}"),
    )
    folder = tmp_path_factory.mktemp("runs") / "finished"
    overrides = ("remesh.faces=400", "ageing.steps=60", "snapshots.count=3", "paint.except=['*sheet*']")
    return make_run(folder, surface, "crackle", *overrides)


@pytest.fixture
def run(finished: Path, tmp_path: Path) -> Path:
    """A copy of it, to be broken."""
    return Path(shutil.copytree(finished, tmp_path / "run"))
