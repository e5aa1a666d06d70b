"""Writing labelled pictures: a folder for each pass, and labels.json, which describes all of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weathercoat import __version__
from weathercoat.mesh.surface import Surface, Vectors, face_normals
from weathercoat.output.condition import LIFTED
from weathercoat.output.display import Normalisation
from weathercoat.output.labels.cameras import Scenery, View, sample_views
from weathercoat.output.labels.passes import (
    BACKGROUND,
    NAMES,
    PALETTE,
    UNPAINTED,
    FaceLabels,
    Passes,
    draw_passes,
    label_faces,
)
from weathercoat.output.pictures import (
    Axis,
    PictureParameters,
    display_snapshot,
    framed_points,
    ground_of,
    render_mesh,
    write_png,
)
from weathercoat.output.rays import make_rays
from weathercoat.output.report import write_json
from weathercoat.sim.snapshot import Snapshot

LABELS = "labels.json"
LABELS_VERSION = 1
PASSES = ("beauty", "class", "depth", "normal", "instance")
_FACES = "faces"
_DEEPEST = 65_535  # the largest value of a 16-bit picture
_CATEGORIES = ("flake", "patch")


@dataclass(frozen=True)
class LabelRequest:
    """What is to be written: the `passes`, from `views`, or from `count` sampled ones of width x height
    pixels by the `seed`.
    """

    passes: tuple[str, ...]
    views: Sequence[View] = ()
    count: int = 0
    seed: int = 0
    width: int = 640
    height: int = 480


@dataclass(frozen=True)
class LabelledRun:
    """The run that labels are of: `about` goes into labels.json as it is (name, fingerprint, config, seed);
    severity: by step, what its report says of it.
    """

    about: Mapping[str, Any]
    up: Axis
    untouched: Surface | None = None
    severity: Mapping[int, Any] | None = None


def write_labels(
    folder: Path,
    snapshots: Sequence[Snapshot],
    run: LabelledRun,
    parameters: PictureParameters,
    request: LabelRequest,
    progress: Callable[[int, int], None] | None = None,
) -> int:
    """Write the labelled pictures of snapshots into an empty folder; returns how many pictures of each pass.

    All snapshots are seen by the same cameras; sampled close-ups look at damage of the last. The same
    arguments give the same bytes. Raises OSError, LimitError, and CorruptError for a texture.
    """
    for name in (*request.passes, _FACES):
        (folder / name).mkdir()
    views = list(request.views) or _sampled(snapshots[-1], snapshots, run, parameters, request)
    images: list[dict[str, Any]] = []
    states: list[dict[str, Any]] = []
    total = len(views) * len(snapshots)
    for snapshot in snapshots:
        labels = label_faces(snapshot)
        states.append(_write_faces(folder, snapshot, labels, run))
        normalise = Normalisation.of(snapshot)
        mesh = display_snapshot(snapshot, parameters, untouched=run.untouched)
        rays = make_rays(mesh.vertices, mesh.faces)
        ground = ground_of(snapshot, parameters, run.up)
        for view in views:
            number = len(images)
            camera = view.displayed(normalise)
            passes = draw_passes(mesh, rays, labels, camera, normalise, view.width, view.height)
            entry = _describe(number, snapshot, view, passes, labels, int(labels.flake.max(initial=0)))
            for name in request.passes:
                path = f"{name}/{number:06}.png"
                entry["files"][name] = path
                if name == "beauty":
                    sized = replace(parameters, width=view.width, height=view.height)
                    write_png(folder / path, render_mesh(mesh, camera, sized, up=run.up, ground=ground))
                else:
                    _write_pass(folder / path, name, passes, entry["depth_unit"])
            images.append(entry)
            if progress is not None:
                progress(len(images), total)
    write_json(folder / LABELS, _document(run, request, images, states))
    return len(images)


def _sampled(
    damaged: Snapshot,
    snapshots: Sequence[Snapshot],
    run: LabelledRun,
    parameters: PictureParameters,
    request: LabelRequest,
) -> list[View]:
    normalise = Normalisation.of(damaged)
    mesh = display_snapshot(damaged, parameters, untouched=run.untouched)
    labels = label_faces(damaged)
    # where metal meets what is left of the film there is most to see
    at_film = ~damaged.bare[damaged.substrate_faces].all(axis=1)
    places, normals = [], []
    for vertices, faces, chosen in (
        (damaged.substrate_vertices, damaged.substrate_faces, (labels.patch > 0) & at_film),
        (damaged.film_vertices, damaged.film_faces, labels.film == LIFTED + 1),
    ):
        normal = face_normals(vertices, faces[chosen])
        length = np.linalg.norm(normal, axis=1)
        places.append(vertices[faces[chosen]].mean(axis=1)[length > 0.0])
        normals.append(normal[length > 0.0] / length[length > 0.0, None])
    points, _ = framed_points(damaged, untouched=run.untouched, films=snapshots)
    scenery = Scenery(
        points,
        np.asarray(run.up, np.float64),
        normalise.size,
        np.concatenate(places),
        np.concatenate(normals),
        make_rays(mesh.vertices, mesh.faces),
        normalise,
    )
    return sample_views(scenery, request.count, request.width, request.height, request.seed)


def _write_faces(folder: Path, snapshot: Snapshot, labels: FaceLabels, run: LabelledRun) -> dict[str, Any]:
    """Write the classes of the faces of a snapshot; returns what labels.json says of it."""
    files = {}
    for name, values in (
        ("film_class", labels.film),
        ("film_flake", labels.flake),
        ("metal_class", labels.metal),
        ("metal_patch", labels.patch),
    ):
        path = f"{_FACES}/{snapshot.step:08}-{name}.npy"
        np.save(folder / path, values, allow_pickle=False)
        files[name] = path
    state = {
        "step": int(snapshot.step),
        "age": float(snapshot.age),
        "faces": files,
        "area_shares": labels.shares,
        "flakes": int(labels.flake.max(initial=0)),
        "patches": int((np.unique(labels.patch) > 0).sum()),
    }
    severity = (run.severity or {}).get(snapshot.step)
    return state if severity is None else {**state, "severity": severity}


def _describe(
    number: int, snapshot: Snapshot, view: View, passes: Passes, labels: FaceLabels, flakes: int
) -> dict[str, Any]:
    """What labels.json says of a picture."""
    counts = np.bincount(passes.category.ravel(), minlength=len(NAMES))
    painted = int(counts.sum() - counts[BACKGROUND] - counts[UNPAINTED])
    deepest = float(passes.depth.max())
    return {
        "id": number,
        "step": int(snapshot.step),
        "age": float(snapshot.age),
        "width": view.width,
        "height": view.height,
        "camera": view.entry(),
        "files": {},
        "depth_unit": deepest / _DEEPEST if deepest > 0.0 else 1.0,
        "pixels": {name: int(count) for name, count in zip(NAMES, counts, strict=True)},
        "shares": {
            name: int(counts[index]) / painted if painted else 0.0
            for index, name in enumerate(NAMES)
            if index not in (BACKGROUND, UNPAINTED)
        },
        "annotations": annotate(passes.instance, passes.category, flakes),
    }


def annotate(instance: NDArray[np.uint16], category: NDArray[np.uint8], flakes: int) -> list[dict[str, Any]]:
    """The flakes (numbers up to `flakes`) and patches that a picture shows, in the order of their numbers.

    bbox: x, y, width and height in pixels, as COCO has it; area: in pixels; classes: pixels of it by class.
    """
    row, column = np.nonzero(instance)
    found, which = np.unique(instance[row, column], return_inverse=True)
    count = len(found)
    low_x, low_y = np.full(count, instance.shape[1]), np.full(count, instance.shape[0])
    high_x, high_y = np.zeros(count, np.int64), np.zeros(count, np.int64)
    np.minimum.at(low_x, which, column)
    np.minimum.at(low_y, which, row)
    np.maximum.at(high_x, which, column)
    np.maximum.at(high_y, which, row)
    classes = np.bincount(which * len(NAMES) + category[row, column], minlength=count * len(NAMES)).reshape(
        count, len(NAMES)
    )
    return [
        {
            "instance": int(found[i]),
            "category": _CATEGORIES[int(found[i] > flakes)],
            "bbox": [
                int(low_x[i]),
                int(low_y[i]),
                int(high_x[i] - low_x[i] + 1),
                int(high_y[i] - low_y[i] + 1),
            ],
            "area": int(classes[i].sum()),
            "classes": {name: int(n) for name, n in zip(NAMES, classes[i], strict=True) if n},
        }
        for i in range(count)
    ]


def _write_pass(path: Path, name: str, passes: Passes, depth_unit: float) -> None:
    from PIL import Image

    if name == "class":
        picture = Image.fromarray(passes.category)
        picture.putpalette([value for color in PALETTE for value in color])
        picture.save(path, format="PNG")
        return
    values: Vectors | NDArray[np.generic]
    if name == "depth":
        values = np.rint(passes.depth / depth_unit).astype(np.uint16)
    elif name == "normal":
        values = np.rint(127.5 * (passes.normal + 1.0)).astype(np.uint8)
    else:
        values = passes.instance
    Image.fromarray(values).save(path, format="PNG")


def _document(
    run: LabelledRun, request: LabelRequest, images: list[dict[str, Any]], states: list[dict[str, Any]]
) -> dict[str, Any]:
    return {
        "labels_version": LABELS_VERSION,
        "weathercoat": __version__,
        "run": dict(run.about),
        "up": list(run.up),
        "passes": list(request.passes),
        "views_seed": None if request.views else request.seed,
        "classes": [
            {"id": index, "name": name, "color": list(color)}
            for index, (name, color) in enumerate(zip(NAMES, PALETTE, strict=True))
        ],
        "categories": list(_CATEGORIES),
        "snapshots": states,
        "images": images,
    }
