"""What the config says of the deformation, and how targets follow from it at an age."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


class Aim(NamedTuple):
    """The parameters of `deform.targets`, at an age, as kernels take them."""

    by_curvature: bool
    radius: float
    rate: float
    floor: float
    age: float


@dataclass(frozen=True)
class DeformParameters:
    """How separated film curls. Lengths in sizes, rates per unit of age, angles in radians.

    The names are those of the config's sections: `curl_radius` is `curl.radius`. The string fields choose
    between forms.
    """

    curl_rule: str = "curvature"  # or "angle"
    curl_radius: float = 0.05
    curl_rate: float = 10.0
    curl_angle_rate: float = 0.8
    curl_angle_floor: float = 2.6
    deformation_solver: str = "sweeps"  # or "momentum", "descent", "newton", "none"
    deformation_sweeps: int = 10
    deformation_angle: str = "dihedral"  # or "split", "arccos"
    deformation_angle_stiffness: float = 1.0
    deformation_sleep_tolerance: float = 0.0
    deformation_iterations: int = 50
    deformation_tolerance: float = 1e-3
    deformation_film_thickness: float = 2e-3

    def aim_at(self, age: float) -> Aim:
        """The targets of an age."""
        by_curvature = self.curl_rule == "curvature"
        rate = self.curl_rate if by_curvature else self.curl_angle_rate
        return Aim(by_curvature, self.curl_radius, rate, self.curl_angle_floor, age)
