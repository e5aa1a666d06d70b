"""Scene data: names, rules that add up, and transforms taken apart."""

from __future__ import annotations

import numpy as np
import pytest

from weathercoat.scene.graph import Rule, Scene, SceneObject, decompose, place, unique_names


def make_transform(seed: int = 1, *, mirrored: bool = False) -> np.ndarray:
    """A turn, an uneven scale and a translation, (4, 4)."""
    random = np.random.default_rng(seed)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn)) * (-1.0 if mirrored else 1.0)
    transform = np.eye(4)
    transform[:3, :3] = turn * [1.0, 2.0, 0.25]
    transform[:3, 3] = random.normal(size=3)
    return transform


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_transform_is_a_turn_of_a_stretch(mirrored: bool) -> None:
    transform = make_transform(mirrored=mirrored)
    turn, stretch = decompose(transform)
    assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(-1.0 if mirrored else 1.0)
    assert SceneObject("a", "a", transform).is_mirrored() == mirrored
    # lengths are rounded to six digits of the largest, so the product is as near
    assert np.allclose(turn @ stretch, transform[:3, :3], atol=2e-5)
    assert (np.linalg.eigvalsh(stretch) > 0).all()


def test_turned_instances_of_one_size_have_one_stretch() -> None:
    stretches = []
    for seed in range(20):
        turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0].astype(np.float32)
        stretches.append(decompose(turn.astype(np.float64) * 1.7)[1].tobytes())
    assert len(set(stretches)) == 1
    assert decompose(np.eye(4))[1].tobytes() == np.eye(3).tobytes()


def test_points_are_placed_like_by_a_matrix_product() -> None:
    transform, points = make_transform(), np.random.default_rng(2).normal(size=(50, 3))
    homogeneous = np.column_stack([points, np.ones(50)])
    assert np.allclose(place(points, transform), (homogeneous @ transform.T)[:, :3])
    assert np.allclose(place(points, transform[:3, :3]), points @ transform[:3, :3].T)


def test_later_rules_win_and_values_add_up() -> None:
    rules = (
        Rule("*", age=0.5, set={"seed": 1, "rust.rate": 2.0}),
        Rule("shed/*", exposure=0.1, weathered=False),
        Rule("*bolt", config="harsh", set={"seed": 7}, weathered=True),
    )
    scene = Scene("yard", {}, (), rules=rules)
    expected = Rule(
        "shed/bolt", "harsh", {"seed": 7, "rust.rate": 2.0}, age=0.5, weathered=True, exposure=0.1
    )
    assert scene.decision("shed/bolt") == expected
    assert scene.decision("post") == Rule("post", age=0.5, set={"seed": 1, "rust.rate": 2.0})


def test_rules_match_paths_of_nodes_too() -> None:
    drum = SceneObject("drum", "m", np.eye(4), path="shed/rack/drum")
    scene = Scene("yard", {}, (drum,), rules=(Rule("shed/*", age=0.5), Rule("rack*", exposure=1.0)))
    assert scene.decision("drum") == Rule("drum", age=0.5)


def test_names_stay_short_until_they_repeat() -> None:
    paths = [("rack", "bolt"), ("shed", "bolt"), ("shed", "bolt"), ("sign",), ("shed", "bolt-2")]
    assert unique_names(paths) == ["rack/bolt", "shed/bolt", "shed/bolt-2", "sign", "bolt-2"]
    tricky = [("a", "x"), ("a", "x"), ("a/x-2",), ("b", "x")]
    names = unique_names(tricky)
    assert len(set(names)) == len(names)
    assert names[2] == "a/x-2"
