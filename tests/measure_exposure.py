"""Measure how exposure converges and what it takes: `python -m tests.measure_exposure SCENE`.

Prints, for several numbers of samples, the CPU seconds for all objects of a scene, and the largest and the
mean difference of their degrees from those with the most samples.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from weathercoat.scene.exposure import measure_exposure
from weathercoat.scene.read import read_scene
from weathercoat.scene.weathering import SPLASH_HEIGHT, weather

COUNTS = (48, 96, 192, 384, 768, 6144)


def main() -> None:
    """Measure a scene."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", type=Path)
    scene = read_scene(parser.parse_args().scene)
    degrees, seconds = {}, {}
    for count in COUNTS:
        began = time.process_time()
        found = measure_exposure(scene, near=SPLASH_HEIGHT, samples=count)
        seconds[count] = time.process_time() - began
        degrees[count] = np.array([weather(exposure, 1.0).degree for exposure in found.values()])
    print(f"{len(scene.objects)} objects; samples, CPU seconds, largest and mean difference of the degree")
    for count in COUNTS:
        away = np.abs(degrees[count] - degrees[COUNTS[-1]])
        print(f"{count:6} {seconds[count]:8.2f} {away.max():8.4f} {away.mean():8.4f}")


if __name__ == "__main__":
    main()
