"""Lights that pictures are taken in: a key light, a sky over a ground, and what gloss mirrors of a studio."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from weathercoat.mesh.surface import Vectors
from weathercoat.output.camera import Camera

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Light:
    """A light, by the camera, so that every picture of a set is lit alike.

    key: towards the key light, along the camera's right, the world's up and against the camera's view;
    key_color: its linear radiance; radius: of its disc [radians], which softens its shadows. horizon,
    zenith and ground: linear radiance of the sky, level and overhead, and of what lies below. box: radiance
    of a soft box round the key light that gloss mirrors, 0 for none. shade: how dark the shadow on the
    ground is, and key_share how much of it the key light makes.
    """

    key: Triple
    key_color: Triple
    radius: float
    horizon: Triple
    zenith: Triple
    ground: Triple
    box: float = 0.0
    shade: float = 0.75
    key_share: float = 0.6

    def direction(self, camera: Camera, up: Vectors) -> Vectors:
        """Towards the key light, a unit vector (3,)."""
        direction = self.key[0] * camera.right + self.key[1] * up - self.key[2] * camera.forward
        return direction / np.linalg.norm(direction)  # type: ignore[no-any-return]

    def sky(self) -> Vectors:
        """The radiance of ground, horizon and zenith, (3, 3)."""
        return np.array([self.ground, self.horizon, self.zenith])


LIGHTS = {
    # from the upper left, low over what faces the camera, so that relief shows
    "studio": Light(
        key=(-0.62, 0.62, 0.45),
        key_color=(2.75, 2.6125, 2.3925),
        radius=0.09,
        horizon=(0.92, 0.95, 1.0),
        zenith=(0.72, 0.83, 1.0),
        ground=(0.30, 0.28, 0.26),
        box=2.6,
    ),
    "daylight": Light(
        key=(0.6, 0.75, 0.4),
        key_color=(4.9, 4.5, 3.9),
        radius=0.015,
        horizon=(0.50, 0.62, 0.80),
        zenith=(0.20, 0.34, 0.68),
        ground=(0.24, 0.22, 0.19),
        shade=0.85,
        key_share=0.75,
    ),
    # twice as bright overhead as at the horizon, nearly as a standard overcast sky
    "overcast": Light(
        key=(-0.2, 1.0, 0.25),
        key_color=(1.0, 1.02, 1.05),
        radius=0.5,
        horizon=(0.90, 0.93, 0.98),
        zenith=(1.6, 1.66, 1.72),
        ground=(0.28, 0.27, 0.26),
        shade=0.6,
        key_share=0.3,
    ),
    "evening": Light(
        key=(-0.9, 0.28, 0.35),
        key_color=(4.0, 2.35, 1.15),
        radius=0.03,
        horizon=(0.72, 0.55, 0.48),
        zenith=(0.30, 0.36, 0.55),
        ground=(0.17, 0.14, 0.14),
        shade=0.75,
        key_share=0.6,
    ),
}

BACKGROUNDS: dict[str, Triple | None] = {
    "grey": (0.845, 0.845, 0.835),
    "white": (1.0, 1.0, 1.0),
    "black": (0.0, 0.0, 0.0),
    "dark": (0.16, 0.165, 0.17),
    "transparent": None,
}
