"""Which objects share a result, in what clusters, under what names and seeds."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.scene.yards import at, box, yard
from weathercoat.scene.graph import Rule, SceneObject
from weathercoat.scene.groups import (
    LARGEST_SPREAD,
    LARGEST_TILT,
    Member,
    Variant,
    cluster_degrees,
    group_members,
    placement_of,
)
from weathercoat.scene.weathering import Weathering


def weathering(degree: float) -> Weathering:
    return Weathering(degree, 0.5, 0.2, 0.3, 1.0, 0.0, 1.0, 1.0, 1.0)


def member(item: SceneObject, degree: float = 0.5, distance: float | None = None, **rule: Any) -> Member:
    return Member(item, Rule(item.name, **rule), weathering(degree), placement_of(yard(item), item), distance)


def turned(name: str, degrees: float, *, mirrored: bool = False) -> SceneObject:
    """A box turned about the z axis."""
    angle = np.radians(degrees)
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return SceneObject(name, "cube", matrix @ np.diag([1.0, 1.0, -1.0 if mirrored else 1.0, 1.0]))


def names(variants: Sequence[Variant]) -> dict[str, list[str]]:
    return {variant.name: [m.item.name for m in variant.members] for variant in variants}


def test_instances_share_one_result_with_the_mean_degree() -> None:
    variants = group_members([member(box("a"), 0.3), member(box("b", 5), 0.4), member(box("c", 9), 0.5)])
    assert names(variants) == {"cube": ["a", "b", "c"]}
    assert variants[0].weathering.degree == pytest.approx(0.4)


def test_instances_that_weather_otherwise_have_results_of_their_own() -> None:
    degrees = {"a": 0.6, "b": 0.15, "c": 0.55, "d": 0.3, "e": 0.9}
    variants = group_members([member(box(name, 5 * i), d) for i, (name, d) in enumerate(degrees.items())])
    assert names(variants) == {"cube-v1": ["b", "d"], "cube-v2": ["a", "c"], "cube-v3": ["e"]}
    one = group_members([member(box(name, i), d, variants=1) for i, (name, d) in enumerate(degrees.items())])
    assert names(one) == {"cube": list(degrees)}


@given(st.lists(st.integers(0, 100), min_size=1, max_size=30))
def test_no_result_is_of_degrees_far_apart(percents: list[int]) -> None:
    degrees = [p / 100 for p in percents]
    variants = group_members([member(box(f"o{i}", i), d) for i, d in enumerate(degrees)])
    for variant in variants:
        found = [m.weathering.degree for m in variant.members]
        assert max(found) - min(found) <= LARGEST_SPREAD
    assert len(variants) <= 1 + (max(degrees) - min(degrees)) / LARGEST_SPREAD


def test_a_turn_about_the_vertical_and_an_even_scale_do_not_matter() -> None:
    spun = SceneObject("spun", "cube", np.array([[0, 0, 2.0, 1], [0, 2, 0, 0], [-2, 0, 0, 0], [0, 0, 0, 1]]))
    variants = group_members([member(box("a"), distance=8.0), member(spun, distance=10.0)])
    assert names(variants) == {"cube": ["a", "spun"]}
    assert (variants[0].placement.shape == np.eye(3)).all()
    # of two, the larger one is nearer in units of the mesh
    assert variants[0].nearest == pytest.approx(5.0)


@pytest.mark.parametrize("tilt", [12.0, 90.0, 180.0])
def test_what_leans_otherwise_has_its_own_result(tilt: float) -> None:
    variants = group_members([member(box("a")), member(turned("b", tilt))])
    assert names(variants) == {"cube": ["a"], "cube-b": ["b"]}
    assert variants[1].placement.up == pytest.approx(
        [np.sin(np.radians(tilt)), np.cos(np.radians(tilt)), 0.0]
    )


def test_no_two_of_a_set_lean_by_more_than_the_limit() -> None:
    members = [member(turned(f"o{i}", 2.3 * i)) for i in range(30)]
    for variant in group_members(members):
        for one, other in combinations(variant.members, 2):
            cosine = float(one.placement.up @ other.placement.up)
            assert cosine >= np.cos(np.radians(LARGEST_TILT)) - 1e-12


def test_mirrored_uneven_and_differently_ruled_objects_have_their_own() -> None:
    variants = group_members(
        [
            member(box("a")),
            member(turned("mirrored", 0.0, mirrored=True)),
            member(box("flat", scale=(1.0, 0.5, 1.0))),
            member(box("ruled"), set={"rust.bare_rate": 9}),
            member(box("older"), age=3.0),
        ]
    )
    assert [len(variant.members) for variant in variants] == [1] * 5
    flat = variants[2].placement
    assert np.linalg.det(flat.shape) == pytest.approx(1.0, abs=1e-4)
    assert flat.shape[1, 1] / flat.shape[0, 0] == pytest.approx(0.5, abs=1e-4)
    assert flat.scale == pytest.approx(0.5 ** (1 / 3))


def test_as_many_as_asked_for_by_degree() -> None:
    degrees = [0.1, 0.9, 0.12, 0.5, 0.88]
    variants = group_members([member(box(f"o{i}", i), d, variants=3) for i, d in enumerate(degrees)])
    assert names(variants) == {"cube-v1": ["o0", "o2"], "cube-v2": ["o3"], "cube-v3": ["o1", "o4"]}
    assert [variant.weathering.degree for variant in variants] == pytest.approx([0.11, 0.5, 0.89])


def test_each_has_its_own_name_whatever_others_are_called() -> None:
    variants = group_members(
        [member(box(name), variants="each") for name in ("rack/box", "rack-box", "Rack-Box", "cube")]
        + [member(box("plain"))]
    )
    assert list(names(variants)) == ["rack-box", "rack-box-2", "Rack-Box-3", "cube", "cube-2"]


def test_an_object_that_is_added_changes_no_other_seed() -> None:
    def seeds(*items: SceneObject) -> dict[str, int]:
        members = [member(item, variants="each") for item in items]
        return {variant.name: variant.seed(1) for variant in group_members(members)}

    few, more = seeds(box("a"), box("b")), seeds(box("a"), box("b"), turned("c", 90))
    assert few.items() < more.items()
    assert len(set(more.values())) == 3
    assert all(0 <= seed < 2**53 for seed in more.values())


@given(
    st.lists(st.integers(0, 40).map(lambda n: n / 40), min_size=1, max_size=7),
    st.integers(min_value=1, max_value=4),
)
def test_clusters_are_the_best_of_all(degrees: list[float], count: int) -> None:
    found = cluster_degrees(degrees, count)
    values = np.array(degrees)

    def spread(labels: np.ndarray) -> float:
        return sum(
            float(((values[labels == k] - values[labels == k].mean()) ** 2).sum()) for k in set(labels)
        )

    distinct = np.unique(values)
    k = min(count, len(distinct))
    assert set(found) == set(range(k))
    best = min(
        spread(np.searchsorted(np.array(cuts), values, side="right"))
        for cuts in combinations(distinct[1:], k - 1)
    )
    assert spread(found) <= best + 1e-12
    order = np.argsort(values, kind="stable")
    assert (np.diff(found[order]) >= 0).all()


def test_the_mesh_is_turned_upright_by_its_up() -> None:
    item = SceneObject("a", "cube", at() @ turned("t", 37.0).transform)
    placement = placement_of(yard(item), item)
    assert item.transform[:3, :3] @ placement.up == pytest.approx([0.0, 1.0, 0.0])
