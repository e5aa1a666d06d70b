"""No stage of a step grows faster than the number of faces."""

from __future__ import annotations

import math
import time

import pytest

from weathercoat.config.load import load_config
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.run import prepare_simulation


@pytest.mark.long
def test_every_stage_grows_linearly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Processor seconds of 100 steps at 3,000 and at 100,000 faces: fitted exponent at most 1.2.

    Linear work measures up to 1.1, since the larger film no longer fits the processor's second cache.
    """
    monkeypatch.setattr(time, "perf_counter", time.process_time)
    config = load_config("standard", ["ageing.steps=100"]).config
    seconds = []
    for faces in (500, 3000, 100_000):  # the first one compiles
        simulation = prepare_simulation(make_random_sheet(faces, 1.0, 1.0, 1), config)
        for _ in range(100):
            simulation.step()
        seconds.append(simulation.seconds)
    for stage, small in seconds[1].items():
        exponent = math.log(seconds[2][stage] / small) / math.log(100_000 / 3000)
        assert exponent <= 1.2, f"{stage}: {exponent:.2f}"
