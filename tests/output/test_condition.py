"""Classes and masks of condition on a sheet whose amounts are set face by face."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.output.snapshots import make_snapshot
from weathercoat.output import condition
from weathercoat.output.condition import CLASSES, assess, film_classes, metal_classes
from weathercoat.sim.snapshot import Snapshot


def _with(snapshot: Snapshot, **amounts: float) -> Snapshot:
    """The snapshot with the same amount everywhere."""
    return dataclasses.replace(
        snapshot, **{name: np.full(len(getattr(snapshot, name)), value) for name, value in amounts.items()}
    )


def _names(classes: NDArray[np.uint8]) -> set[str]:
    assert classes.dtype == np.uint8
    return {CLASSES[i] for i in classes}


@pytest.fixture
def clean() -> Snapshot:
    return _with(make_snapshot(), film_rust=0.0, dust=0.0, substrate_rust=0.0)


def test_numbers_are_places_in_the_names() -> None:
    for name in CLASSES:
        assert CLASSES[getattr(condition, name.upper())] == name


def test_metal_under_film_shows_through_cracks_only(clean: Snapshot) -> None:
    assert _names(metal_classes(_with(clean, substrate_rust=1.0))) == {"crack"}
    assert not assess(_with(clean, substrate_rust=1.0)).rusted.any()


@pytest.mark.parametrize(("rust", "name"), [(0.0, "bare"), (0.0999, "bare"), (0.1001, "rust"), (1.0, "rust")])
def test_metal_without_film_is_bare_or_rusted_by_its_amount(rust: float, name: str) -> None:
    fallen = _with(make_snapshot(lost=2), substrate_rust=rust)
    classes = metal_classes(fallen)
    assert sorted(CLASSES[i] for i in classes if CLASSES[i] != "crack") == [name, name]
    found = assess(fallen)
    assert found.flaked.sum() == 2
    assert found.rusted.sum() == (2 if name == "rust" else 0)
    assert not (found.flaked & (found.lifted | found.runoff | found.dirty)).any()


@pytest.mark.parametrize(
    ("runoff", "dust", "name"),
    [(0.0, 0.0, "paint"), (0.0999, 0.0999, "paint"), (0.1001, 0.0, "runoff"), (0.0, 0.1001, "dirt"),
     (0.5, 0.5, "runoff")],
)  # fmt: skip
def test_film_is_stained_by_its_amounts(clean: Snapshot, runoff: float, dust: float, name: str) -> None:
    stained = _with(clean, film_rust=runoff, dust=dust)
    assert _names(film_classes(stained)) == {name}
    assert assess(stained).dirty.all() == (dust > 0.1)
    assert assess(stained).runoff.all() == (runoff > 0.1)


@pytest.mark.parametrize(("corners", "name"), [(0, "paint"), (1, "paint"), (2, "lifted"), (3, "lifted")])
def test_film_is_lifted_with_two_corners(clean: Snapshot, corners: int, name: str) -> None:
    loose = np.zeros(len(clean.separated), np.bool_)
    loose[clean.film_faces[0, :corners]] = True
    lifted = dataclasses.replace(clean, separated=loose, film_rust=np.ones(len(loose)))
    assert CLASSES[film_classes(lifted)[0]] == ("runoff" if name == "paint" else name)
    assert assess(lifted).lifted[clean.film_face[0]] == (name == "lifted")


def test_areas_are_those_at_rest(clean: Snapshot) -> None:
    raised = dataclasses.replace(clean, film_vertices=2.0 * clean.film_vertices)
    assert assess(raised).area.sum() == pytest.approx(1.0, rel=1e-12)
