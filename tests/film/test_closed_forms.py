"""What ages by a closed form: in the right direction, within its bounds, and in steps of any length."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from weathercoat.film.state import adhesion_at, tension_at

ages = st.lists(st.floats(0.0, 1000.0), min_size=2, max_size=8).map(sorted)
rates = st.sampled_from([0.0, 1e-3, 3.0, 1e6]) | st.floats(0.0, 1e6)
shares = st.floats(0.0, 1.0)


@given(value=shares, cap=shares, rate=rates, saturating=st.booleans(), when=ages)
def test_tension_goes_to_its_cap_and_never_past_it(
    value: float, cap: float, rate: float, saturating: bool, when: list[float]
) -> None:
    """By steps of any length: up where it lies below, down where it lies above; without a cap only up."""
    since = when[0]
    found = [tension_at(value, since, cap, rate, saturating, age) for age in when]
    slack = 2.3e-16  # a last bit of the two terms
    assert found[0] == pytest.approx(value, abs=slack)
    assert np.isfinite(found).all()
    if saturating:
        assert min(value, cap) - slack <= min(found) and max(found) <= max(value, cap) + slack
        steps = np.diff(found) * (1.0 if cap >= value else -1.0)
        assert (steps >= -slack).all()
    else:
        assert (np.diff(found) >= 0.0).all()


@given(value=shares, cap=shares, rate=st.floats(0.0, 100.0), saturating=st.booleans(), when=ages)
def test_tension_in_steps_is_tension_at_once(
    value: float, cap: float, rate: float, saturating: bool, when: list[float]
) -> None:
    """Stopped and begun again at each age: only roundings add up."""
    stepped = value
    for before, age in pairwise(when):
        stepped = tension_at(stepped, before, cap, rate, saturating, age)
    at_once = tension_at(value, when[0], cap, rate, saturating, when[-1])
    assert stepped == pytest.approx(at_once, rel=1e-12, abs=1e-12)


@given(
    start=st.lists(st.floats(0.0, 1e6), min_size=1, max_size=5),
    base=st.floats(1e-6, 1e6),
    decay=rates,
    when=ages,
)
def test_adhesion_only_falls_and_ends_at_zero(
    start: list[float], base: float, decay: float, when: list[float]
) -> None:
    found = np.array([adhesion_at(np.array(start), base * decay, age) for age in (0.0, *when)])
    assert (found[0] == start).all()
    assert (np.diff(found, axis=0) <= 0.0).all()
    assert (found >= 0.0).all() and np.isfinite(found).all()
