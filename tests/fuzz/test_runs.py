"""A few runs by random configs at their bounds, and that the checks see what is wrong."""

from __future__ import annotations

import pytest

from tests.fuzz import runs
from weathercoat.sim.simulation import Simulation

COUNT = 15


def test_runs_by_configs_at_their_bounds() -> None:
    outcomes, violations = runs.run(COUNT, seed=2)
    assert [(number, verdict.what, case) for number, case, verdict in violations] == []
    assert outcomes.total() == COUNT


@pytest.mark.long
def test_many_runs_by_configs_at_their_bounds() -> None:
    _, violations = runs.run(100, seed=3)
    assert [(number, verdict.what, case) for number, case, verdict in violations] == []


def test_runs_differ_and_repeat() -> None:
    cases = [runs.make_case(1, number) for number in range(300)]
    assert cases == [runs.make_case(1, number) for number in range(300)]
    assert {case.mesh for case in cases} == set(runs.MESHES)
    assert {case.values["deformation.solver"] for case in cases} == set(runs.SOLVERS)


@pytest.mark.parametrize(
    ("what", "index", "value", "message"),
    [
        ("positions", (0, 0), float("nan"), "positions not finite"),
        ("twin", 0, 2, "twin"),
        ("half_edge", 0, -1, "half-edge of its own"),
    ],
)
def test_what_is_broken_in_a_step_is_found(
    monkeypatch: pytest.MonkeyPatch, what: str, index: object, value: float, message: str
) -> None:
    step = Simulation.step

    def broken_step(simulation: Simulation, count: int = 1) -> None:
        step(simulation, count)
        if simulation.step_count == 2:
            getattr(simulation.mesh, what)[index] = value

    monkeypatch.setattr(Simulation, "step", broken_step)
    values = {"ageing.steps": 2, "remesh": False, "output.preview": False, "adhesion.base": 1000.0}
    verdict = runs.judge(runs.Case("sheet", 1, 1.0, 0.0, "standard", values))
    assert verdict.kind == "violation" and message in verdict.what
