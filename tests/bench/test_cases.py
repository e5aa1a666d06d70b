"""What is run, and which of the paper's figures stands beside it."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable
from typing import Any

import pytest

from weathercoat.bench import roofline
from weathercoat.bench.cases import PAPER, find_paper_timing, make_cases, sample_size
from weathercoat.bench.growth import fit_exponent
from weathercoat.deform.angle import meet_dihedral
from weathercoat.deform.length import meet_length
from weathercoat.deform.substrate import depth_below


def test_short_runs_are_timed_whole_and_long_ones_by_samples() -> None:
    assert sample_size(10_000, 1000) == 0
    assert sample_size(100_000, 1000) == 20
    assert sample_size(1_000_000, 1000) == 5


def test_cases_are_the_meshes_then_the_plates_with_the_peer_where_it_is_due() -> None:
    cases = make_cases([("bunny", 10_000)], [3_000, 10_000, 100_000], 1000, threads=3)
    assert [(case.label, case.with_peer, case.variant_of) for case in cases] == [
        ("bunny", False, ""),
        ("plate 3,000", False, ""),
        ("plate 10,000", True, ""),
        ("plate 10,000, asleep at rest", False, "plate 10,000"),
        ("plate 100,000", True, ""),
        ("plate 100,000, 3 threads", False, "plate 100,000"),
    ]
    assert cases[-1].threads == 3 and cases[-1].sample == cases[-2].sample
    assert not any(case.threads > 1 for case in make_cases([], [100_000], 1000, threads=1))


@pytest.mark.parametrize(
    ("name", "faces", "found"),
    [
        ("aki_Plane", 3012, "flat plate"),
        ("aki_Curve2", 3005, "curved plate"),
        ("aki_bunny2", 10_000, "Stanford bunny"),
        ("plate 3,000", 3000, "flat plate"),
        ("plate 10,000", 10_000, "Stanford bunny"),
        ("bunny", 50_000, None),
    ],
)
def test_the_paper_timed_that_mesh(name: str, faces: int, found: str | None) -> None:
    timing = find_paper_timing(name, faces)
    assert (timing.name if timing else None) == found


def test_the_stages_of_the_paper_add_up() -> None:
    for timing in PAPER:
        stages = timing.stage_seconds()
        assert sum(stages.values()) - stages["total"] == pytest.approx(timing.seconds)


def test_the_exponent_of_a_power_law_is_found() -> None:
    faces = [1e4, 1e5, 1e6]
    assert fit_exponent(faces, [3.0 * m**1.07 for m in faces]) == pytest.approx(1.07)
    assert fit_exponent(faces, [2.0] * 3) == pytest.approx(0.0)
    assert fit_exponent(faces[:1], [1.0]) is None
    assert fit_exponent([1e4, 1e4], [1.0, 2.0]) is None
    assert fit_exponent(faces, [1.0, 0.0, 0.0]) is None


@pytest.mark.parametrize(
    ("function", "counted"),
    [
        (meet_length, roofline.LENGTH_FLOPS),
        (meet_dihedral, roofline.ANGLE_FLOPS),
        (depth_below, roofline.VERTEX_FLOPS),
    ],
)
def test_operations_are_those_of_the_formulas(function: Callable[..., Any], counted: int) -> None:
    source = textwrap.dedent(inspect.getsource(getattr(function, "py_func", function)))
    nodes = list(ast.walk(ast.parse(source)))
    arithmetic = [n for n in nodes if isinstance(n, ast.BinOp) and not isinstance(n.op, ast.BitAnd)]
    calls = [ast.unparse(n.func) for n in nodes if isinstance(n, ast.Call)]
    assert len(arithmetic) + sum(name in ("math.sqrt", "max") for name in calls) == counted


def test_the_floor_is_the_slower_of_arithmetic_and_memory() -> None:
    assert roofline.floor_ms(2e6, 1e6, peak_flops=1e9, bandwidth=1e9) == pytest.approx(2.0)
    assert roofline.floor_ms(2e6, 8e6, peak_flops=1e9, bandwidth=1e9) == pytest.approx(8.0)
