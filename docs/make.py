"""Makes the generated pages and every picture of the documentation anew: all of them, or some by name.

    python docs/make.py                     all of it
    python docs/make.py pages               configuration.md, errors.md, gallery.md, performance.md, python.md
    python docs/make.py effects             the effect of each parameter, images/parameters
    python docs/make.py effects --key curl.radius
    python docs/make.py comparison          the default beside the paper's literal rules
    python docs/make.py gallery             every shipped config on five parts, images/gallery
    python docs/make.py first               the picture of the README
    python docs/make.py yard                the picture of exposure.md
    python docs/make.py viewer              the pictures of viewer.md; needs Chromium
    python docs/make.py steering            the pictures of steering.md, images/steering
    python docs/make.py speed --results FOLDER
                                            performance.md with what `weathercoat bench speed -o FOLDER` wrote
    python docs/make.py accuracy --results FOLDER
    python docs/make.py stability --results FOLDER
    python docs/make.py independence --results FOLDER
                                            accuracy.md, stability.md and independence.md, likewise
    python docs/make.py noise --results FOLDER
                                            regression.md, and the spread that `compare` reads
    python docs/make.py fidelity --results FOLDER
    python docs/make.py scenes --results FOLDER
                                            fidelity.md, and the front that `quality` reads

The pictures come from the tool as it is shipped and from generated parts, so anyone can make them again.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from making import (
    accuracy,
    convergence,
    effects,
    fidelity,
    gallery,
    independence,
    noise,
    pages,
    scenes,
    speed,
    stability,
    steering,
    viewer,
)

PARTS = ("pages", "effects", "comparison", "gallery", "first", "yard", "steering", "viewer")
RESULTS = {
    "speed": speed.take_results,
    "accuracy": accuracy.take_results,
    "convergence": convergence.take_results,
    "stability": stability.take_results,
    "independence": independence.take_results,
    "noise": noise.take_results,
    "fidelity": fidelity.take_fidelity,
    "scenes": fidelity.take_scenes,
}


def main() -> None:
    """Make what is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS) + "; all by default")
    parser.add_argument("--key", action="append", help="effects: only this parameter; may be given again")
    parser.add_argument("--config", action="append", help="gallery: only this config; may be given again")
    parser.add_argument("--results", type=Path, metavar="FOLDER", help=f"{', '.join(RESULTS)}: what to take")
    wanted = parser.parse_args()
    parts = wanted.parts or PARTS
    for part in parts:
        if part not in (*PARTS, *RESULTS):
            parser.error(f"no part {part!r}; there are {', '.join((*PARTS, *RESULTS))}")
    if any(part in RESULTS for part in parts) != (wanted.results is not None):
        parser.error(f"{', '.join(RESULTS)} take --results FOLDER")
    if "pages" in parts:
        pages.write_pages()
    if "effects" in parts:
        effects.draw_effects(wanted.key)
    if "comparison" in parts:
        gallery.draw_comparison()
    if "steering" in parts:
        steering.draw_steering()
    if "gallery" in parts:
        gallery.draw_gallery(wanted.config)
    if "first" in parts:
        gallery.draw_first()
    if "yard" in parts:
        scenes.draw_yard()
    if "viewer" in parts:
        viewer.draw_viewer()
    for part in parts:
        if part in RESULTS:
            RESULTS[part](wanted.results)


if __name__ == "__main__":
    main()
