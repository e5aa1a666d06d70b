"""Grades at the edges of their classes, and limits in words."""

from __future__ import annotations

import math

import pytest

from weathercoat.grades import (
    FLAKING_FROM,
    FLAKING_NOMINAL,
    RUST_FROM,
    RUST_NOMINAL,
    d610_distribution,
    d610_grade,
    flake_size_class,
    flaking_class,
    parse_limits,
    rusting_degree,
)


@pytest.mark.parametrize("nominal", RUST_NOMINAL)
def test_nominal_areas_have_their_degree_of_rusting(nominal: float) -> None:
    assert rusting_degree(nominal) == f"Ri{RUST_NOMINAL.index(nominal) + 1}"


@pytest.mark.parametrize("nominal", FLAKING_NOMINAL)
def test_nominal_areas_have_their_class_of_flaking(nominal: float) -> None:
    assert flaking_class(nominal) == FLAKING_NOMINAL.index(nominal) + 1


def test_whole_paint_has_the_best_grades() -> None:
    assert (rusting_degree(0.0), flaking_class(0.0), d610_grade(0.0), flake_size_class(0.0)) == (
        "Ri0",
        0,
        10,
        0,
    )


def test_classes_meet_half_way_in_the_logarithm() -> None:
    """By hand: the root of the product of neighbours, 8 and 40 for the last; and as far below the first."""
    assert pytest.approx((0.05 / math.sqrt(10), math.sqrt(0.025), math.sqrt(0.5), math.sqrt(8),
                                       math.sqrt(320))) == RUST_FROM  # fmt: skip
    assert FLAKING_FROM[1:] == pytest.approx((math.sqrt(0.03), math.sqrt(0.3), math.sqrt(3), math.sqrt(45)))
    for grade, edge in enumerate(RUST_FROM, start=1):
        assert rusting_degree(edge) == f"Ri{grade}"
        assert rusting_degree(edge * (1 - 1e-12)) == f"Ri{grade - 1}"


@pytest.mark.parametrize(
    ("most", "grade"),
    [(0.01, 10), (0.03, 9), (0.1, 8), (0.3, 7), (1, 6), (3, 5), (10, 4), (16, 3), (33, 2), (50, 1)],
)
def test_grades_of_d610_hold_up_to_their_most(most: float, grade: int) -> None:
    assert d610_grade(most) == grade
    assert d610_grade(most * (1 + 1e-12)) == grade - 1


@pytest.mark.parametrize(("length", "size"), [(1e-9, 1), (1, 1), (3, 2), (10, 3), (30, 4), (30.001, 5)])
def test_sizes_of_flakes(length: float, size: int) -> None:
    assert flake_size_class(length) == size


@pytest.mark.parametrize(
    ("areas", "kind"),
    [
        ([0.01], "S"),
        ([5e-3, 4e-3, 3e-3, 2e-3], "S"),
        ([1e-3] * 30, "G"),
        ([1e-3] * 5, "H"),
        ([1e-4] * 30, "P"),
        ([1e-4] * 60 + [1e-3] * 0, "P"),
        ([1e-3] * 4 + [1e-4] * 60, "H"),
    ],
)
def test_distributions_of_rust(areas: list[float], kind: str) -> None:
    areas = sorted(areas, reverse=True)
    assert d610_distribution(d610_grade(100 * sum(areas)), areas, 1.0) == kind
    assert d610_distribution(5, [9 * area for area in areas], 9.0) == kind


@pytest.mark.parametrize("grade", [0, 10])
def test_the_ends_of_d610_have_no_distribution(grade: int) -> None:
    assert d610_distribution(grade, [0.6], 1.0) == ""


@pytest.mark.parametrize(
    ("text", "figure", "reached", "not_reached", "group"),
    [
        ("rust=Ri3", "rusted", math.sqrt(0.5) + 1e-9, math.sqrt(0.5) - 1e-9, None),
        ("flaking=4", "flaked", math.sqrt(3) + 1e-9, math.sqrt(3) - 1e-9, None),
        ("bare=12%", "flaked", 12.0, 11.999999, None),
        ("bare@the hull=12.5 %", "flaked", 12.5, 12.4999, "the hull"),
        ("rust=D610:5", "rusted", 1.0000001, 1.0, None),
    ],
)
def test_limits(text: str, figure: str, reached: float, not_reached: float, group: str | None) -> None:
    (limit,) = parse_limits(text)
    assert (limit.figure, limit.group, limit.text) == (figure, group, text)
    assert limit.is_reached(reached)
    assert not limit.is_reached(not_reached)


def test_commas_join_limits() -> None:
    assert [limit.figure for limit in parse_limits("rust=Ri1, flaking=2")] == ["rusted", "flaked"]


@pytest.mark.parametrize(
    "text",
    ["", "rust", "rust=3", "rust=Ri0", "rust=Ri6", "rust=D610:10", "flaking=Ri2", "flaking=D610:4", "bare=3",
     "bare=0%", "bare=101%", "bare=-1%", "rot=3%", "rust=Ri3,", "rust@=Ri3"],
)  # fmt: skip
def test_what_is_no_limit(text: str) -> None:
    with pytest.raises(ValueError, match="must be"):
        parse_limits(text)
