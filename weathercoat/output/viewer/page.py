"""The page itself: `page.html` with the style, the script, the chunks and what is said about them in its
places.

Nothing in it is fetched: the policy in its head forbids that, so it works from a disk without a network.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from string import Template
from typing import Any, BinaryIO

from weathercoat import __version__
from weathercoat.mesh.surface import Surface, Vectors
from weathercoat.output.pictures import PictureParameters, frame_camera
from weathercoat.output.shading import to_linear
from weathercoat.output.viewer.base import base_colors
from weathercoat.output.viewer.content import Content, pack_run
from weathercoat.sim.snapshot import Snapshot

_HERE = Path(__file__).parent
_STAIN_DEPTH = (0.35, 1.1, 2.2)  # a stain takes away blue first
_ELSEWHERE = ("step", "age", "severity")  # figures of a snapshot that the page has in places of their own


@dataclass(frozen=True)
class Start:
    """What a page shows first: a step, or two with a divider between them; None for the last step."""

    step: int | None = None
    before: int | None = None


def write_page(
    stream: BinaryIO,
    snapshots: Sequence[Snapshot],
    figures: Sequence[Mapping[str, Any]],
    parameters: PictureParameters,
    *,
    name: str,
    up: tuple[float, float, float] = (0.0, 1.0, 0.0),
    untouched: Surface | None = None,
    risk: Mapping[int, Vectors] | None = None,
    start: Start = Start(),
) -> None:
    """Write the page that shows the snapshots of one run, in order of time, one at least.

    figures: those of each snapshot, as run.json has them. parameters: colours and thickness of the film, and
    from where it is seen at first. name: of the model. up, untouched: as of `render_snapshot`; risk: as of
    `pack_run`, which says what is raised. OSError where the page cannot be written.
    """
    base = base_colors(snapshots[0].surface, parameters.look, parameters.paint)
    content = pack_run(snapshots, untouched=untouched, risk=risk, base=base)
    camera = frame_camera(snapshots[0], parameters, up=up, untouched=untouched)
    about = {
        **content.about,
        **_look(parameters),
        "name": name,
        "up": [float(x) for x in up],
        "view": [float(f"{-x:.9g}") for x in camera.forward],
        "layouts": [chunk.layout for chunk in content.chunks],
        "snapshots": [_moment(snapshot, row) for snapshot, row in zip(snapshots, figures, strict=True)],
        "start": {
            key: step for key, step in (("step", start.step), ("before", start.before)) if step is not None
        },
    }
    stream.write(_filled(name, about, content).encode())


def _filled(name: str, about: Mapping[str, Any], content: Content) -> str:
    chunks = (
        f'<script type="application/octet-stream" class="chunk">{chunk.text}</script>'
        for chunk in content.chunks
    )
    # a "<" in JSON could end the element that holds it
    text = json.dumps(about, sort_keys=True, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return Template(_read("page.html")).substitute(
        title=escape(name),
        generator=f"weathercoat {__version__}",
        style=_read("viewer.css"),
        about=text,
        chunks="\n".join(chunks),
        script=_read("viewer.js").replace("</script", "<\\/script"),
    )


def _read(name: str) -> str:
    return (_HERE / name).read_text(encoding="utf-8")


def _moment(snapshot: Snapshot, row: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "step": int(snapshot.step),
        "age": float(snapshot.age),
        "figures": {key: value for key, value in row.items() if key not in _ELSEWHERE},
        "severity": row.get("severity", {}),
    }


def _look(parameters: PictureParameters) -> dict[str, Any]:
    """Linear colours in the order of the shader's palette, and thicknesses in sizes."""

    def linear(color: tuple[float, float, float]) -> list[float]:
        return [float(f"{value:.6g}") for value in to_linear(color)]

    return {
        "paint": linear(parameters.paint),
        "palette": [
            linear(parameters.primer),
            linear(parameters.metal),
            linear(parameters.rust_rim),
            linear(parameters.rust_body),
            linear(parameters.rust_core),
            linear(parameters.stain),
            list(_STAIN_DEPTH),
            linear(parameters.dust),
            linear(parameters.unpainted),
        ],
        "thickness": {"film": max(parameters.film_thickness, 8e-4), "metal": parameters.metal_thickness},
    }
