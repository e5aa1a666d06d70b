"""Threads: everybody's share is done, what fails is told, and the bits do not change."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import weathercoat.deform.deformation as deformation
from tests.sim.runs import finish, make_run
from weathercoat.deform.team import Team
from weathercoat.mesh.shapes import make_random_sheet


@pytest.mark.parametrize("size", [1, 2, 5])
def test_each_share_is_done_once_by_a_thread_of_its_own(size: int) -> None:
    team = Team(size)
    for _ in range(20):
        done: dict[int, int] = {}
        team.share(lambda number, done=done: done.setdefault(number, threading.get_ident()))  # type: ignore[misc]
        assert sorted(done) == list(range(size))
        assert len(set(done.values())) == size
        assert done[0] == threading.get_ident()


@pytest.mark.parametrize("culprit", [0, 1, 2])
def test_a_share_that_fails_is_told_and_the_team_goes_on(culprit: int) -> None:
    team = Team(3)

    def work(number: int) -> None:
        if number == culprit:
            raise ValueError(f"share {number}")

    with pytest.raises(ValueError, match=f"share {culprit}"):
        team.share(work)
    done: list[int] = []
    team.share(done.append)
    assert sorted(done) == [0, 1, 2]


@pytest.mark.compiled
@pytest.mark.parametrize("form", ["dihedral", "split"])
def test_threads_change_no_bit(monkeypatch: pytest.MonkeyPatch, form: str) -> None:
    """A sheet of three tiles, with the threshold below which one thread works alone taken away."""
    monkeypatch.setattr(deformation, "_WORTH_SHARING", 0)
    sheet = make_random_sheet(6000, 1.0, 0.8, 3)
    results = []
    for threads in (1, 2, 3):
        simulation = make_run(sheet, steps=12, curl={"deformation_angle": form})
        simulation.team = Team(threads)
        finish(simulation)
        used = simulation.mesh.vertex_count
        results.append(simulation.mesh.positions[:used].tobytes())
        assert len(simulation.constraints.seats.filled) >= 3
    assert results[0] == results[1] == results[2]
    rest = simulation.mesh.rest_positions[simulation.mesh.origin[:used]]
    assert not np.array_equal(simulation.mesh.positions[:used], rest)
