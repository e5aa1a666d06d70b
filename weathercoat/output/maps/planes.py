"""The planes of what texels show, float32 (N_PLANES, texels).

Colour is linear. HEIGHT is over the paint as new, in sizes; GROOVE how deep a texel lies in the groove of a
closed crack or at the rounded edge of film, 0 to 1; SLOPE the gradient of what it shows over the input.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Planes = NDArray[np.float32]

(
    RED, GREEN, BLUE, ROUGHNESS, METALNESS, OCCLUSION,
    BARE, RUST, DIRT, CRACKED, LIFT, SEPARATED, AGE, HEIGHT, GROOVE,
    SLOPE_X, SLOPE_Y, SLOPE_Z, NORMAL_X, NORMAL_Y, NORMAL_Z,
) = range(21)  # fmt: skip
N_PLANES = 21
