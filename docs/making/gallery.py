"""The gallery, the comparison with the literal rules and the first picture, made by the shipped commands."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from PIL import Image

from making.places import IMAGES, save_picture
from weathercoat.config.presets import preset_names
from weathercoat.output.pictures import contact_sheet

FOLDER = IMAGES / "gallery"
PARTS = ("plate", "sign", "barrel", "gear", "sphere")
# Shipped configs by what they are, with the parts to show them on. Environments are shown on one paint.
LOOKS = ("standard", "crackle", "curling", "rusting", "literal")
PAINTS = (
    "new_car",
    "chalked_alkyd",
    "marine_epoxy",
    "peeling_acrylic",
    "galvanised",
    "cast_iron",
    "aluminium_filiform",
    "powder_coat",
)
ENVIRONMENTS = ("c1", "c2", "c3", "c4", "c5")
PARTS_OF_PAINTS = ("sign", "barrel")
EXPOSED = ("chalked_alkyd", "sign")
SETTINGS = (
    "snapshots.steps=[0, 200, 400, 600, 800, 1000]",
    "output.formats=ply",
    "output.picture_width=400",
    "output.picture_height=300",
)
COMPARED = ("literal", "standard")


def picture_name(config: str, part: str) -> str:
    """File name of the picture of a config on a part, in `FOLDER`."""
    return f"{config}_{part}.webp"


def shown(config: str) -> list[tuple[str, str]]:
    """What a config is shown by: the configs to run, `A+B` for an environment, each with the part."""
    if config in ENVIRONMENTS:
        paint, part = EXPOSED
        return [(f"{paint}+{config}", part)]
    return [(config, part) for part in (PARTS_OF_PAINTS if config in PAINTS else PARTS)]


def draw_gallery(configs: Iterable[str] | None = None) -> None:
    """Age parts by every shipped config, from intact to the end."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for part in PARTS:
            _call("sample", part, "-o", folder / f"{part}.obj")
        for config, part in (row for name in configs or preset_names() for row in shown(name)):
            run = folder / f"{part}-{config}"
            _call("run", config, folder / f"{part}.obj", "-o", run, *_assignments(SETTINGS), "--quiet")
            save_picture(Image.open(run / "preview.png"), FOLDER / picture_name(config, part))


def draw_comparison() -> None:
    """The literal rules beside the default at five ages, on the same plate."""
    steps = (200, 400, 600, 800, 1000)
    images: dict[tuple[int, str], np.ndarray] = {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        _call("sample", "plate", "--height", "0.75", "-o", folder / "plate.obj")
        for config in COMPARED:
            run = folder / config
            settings = ("output.formats=ply", "output.preview=false")
            _call("run", config, folder / "plate.obj", "-o", run, *_assignments(settings), "--quiet")
            for step in steps:
                picture = folder / f"{config}_{step}.png"
                view = ("--azimuth", "15", "--elevation", "10", "--width", "440", "--height", "330")
                _call("render", run, "--step", str(step), "-o", picture, *view)
                images[step, config] = np.asarray(Image.open(picture))
    order = [(step, config) for step in steps for config in COMPARED]
    labels = [f"{config}, age {step / 1000:g}" for step, config in order]
    sheet = contact_sheet([images[place] for place in order], labels, len(COMPARED))
    save_picture(Image.fromarray(sheet), IMAGES / "literal_and_standard.webp")


def draw_first() -> None:
    """What the first run of the README gives."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        _call("sample", "sign", "-o", folder / "sign.obj")
        steps = _assignments(["snapshots.steps=[0, 200, 400, 600, 800, 1000]"])
        _call("run", "standard", folder / "sign.obj", "-o", folder / "sign", *steps)
        sheet = Image.open(folder / "sign" / "preview.png").convert("RGB")
        sheet.thumbnail((1440, 1440), Image.Resampling.LANCZOS)
        save_picture(sheet, IMAGES / "sign.webp")


def _assignments(settings: Iterable[str]) -> list[str]:
    return [part for setting in settings for part in ("--set", setting)]


def _call(*arguments: object) -> None:
    subprocess.run(
        [sys.executable, "-m", "weathercoat", *map(str, arguments)], check=True, stdout=subprocess.DEVNULL
    )
