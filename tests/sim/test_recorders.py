"""Running to the end: what is recorded when."""

from __future__ import annotations

from tests.sim.runs import make_run, snapshot_bytes
from weathercoat.mesh.shapes import make_random_sheet
from weathercoat.sim.recorders import Recorder, run_simulation
from weathercoat.sim.simulation import Simulation

SHEET = make_random_sheet(faces=80)


def test_recorders_are_called_after_their_steps_the_start_included() -> None:
    seen: list[tuple[str, int]] = []

    def recorder(name: str, steps: set[int]) -> Recorder:
        return Recorder(steps, lambda simulation: seen.append((name, simulation.step_count)))

    simulation = make_run(SHEET, steps=5)
    run_simulation(simulation, [recorder("a", {0, 2, 5}), recorder("b", {2, 9})])
    assert seen == [("a", 0), ("a", 2), ("b", 2), ("a", 5)]
    assert simulation.step_count == 5 and simulation.age == 1.0


def test_progress_counts_every_step() -> None:
    done: list[tuple[int, int]] = []
    run_simulation(make_run(SHEET, steps=3), [], lambda step, steps: done.append((step, steps)))
    assert done == [(1, 3), (2, 3), (3, 3)]


def test_recording_leaves_the_run_alone() -> None:
    """A run that is looked at after every step ends like one that is not."""
    looked_at, left_alone = make_run(SHEET, steps=20), make_run(SHEET, steps=20)

    def look(simulation: Simulation) -> None:
        simulation.snapshot()
        simulation.residual()

    run_simulation(looked_at, [Recorder(range(21), look)])
    run_simulation(left_alone, [])
    assert snapshot_bytes(looked_at.snapshot()) == snapshot_bytes(left_alone.snapshot())
