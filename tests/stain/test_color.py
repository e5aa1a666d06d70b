"""Colours: paint towards rust, dimmed by dust."""

from __future__ import annotations

import numpy as np

from weathercoat.stain.color import Palette, stain_color

PALETTE = Palette(paint=(0.2, 0.6, 1.0), metal=(0.5, 0.5, 0.5), rust=(132 / 255, 51 / 255, 0.0))


def test_the_formula() -> None:
    """A share 1 - exp(-(rust - 0.1)) of rust, none below a tenth, times exp(-dust)."""
    rust = np.array([0.0, 0.1, 0.6, 1.0])
    dust = np.array([0.0, 0.0, 0.0, 0.7])
    share = np.array([0.0, 0.0, 1 - np.exp(-0.5), 1 - np.exp(-0.9)])[:, None]
    expected = (1 - share) * np.array(PALETTE.paint) + share * np.array(PALETTE.rust)
    expected[3] *= np.exp(-0.7)
    found = stain_color(PALETTE.paint, PALETTE, rust, dust)
    np.testing.assert_allclose(found, expected, rtol=1e-14)
    assert (found[:2] == PALETTE.paint).all()


def test_clean_metal_is_metal_and_nothing_leaves_the_range() -> None:
    values = np.linspace(0, 1, 20)
    found = stain_color(PALETTE.metal, PALETTE, values, values[::-1])
    assert (found >= 0).all() and (found <= 1).all()
    assert (stain_color(PALETTE.metal, PALETTE, np.zeros(1), np.zeros(1)) == PALETTE.metal).all()
