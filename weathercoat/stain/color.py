"""Colours as a view of the stains: paint towards rust, dimmed by dust."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from weathercoat.mesh.surface import Vectors


@dataclass(frozen=True)
class Palette:
    """Colours in sRGB, 0 to 1 (r, g, b)."""

    paint: tuple[float, float, float] = (0.31, 0.64, 0.72)
    metal: tuple[float, float, float] = (0.62, 0.60, 0.58)
    rust: tuple[float, float, float] = (132 / 255, 51 / 255, 0.0)


def stain_color(
    base: tuple[float, float, float] | Vectors, palette: Palette, rust: Vectors, dust: Vectors
) -> Vectors:
    """Colour of a surface of one base colour, or one for each (n, 3), with rust and dust (n,): towards rust
    by 1 - exp(-(rust - 0.1)), times exp(-dust); (n, 3).
    """
    share = -np.expm1(-np.maximum(rust - 0.1, 0.0))[:, None]
    mixed = (1.0 - share) * np.asarray(base) + share * np.asarray(palette.rust)
    return np.clip(mixed * np.exp(-dust)[:, None], 0.0, 1.0)
