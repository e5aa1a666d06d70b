"""The picture of an aged scene, made by the shipped commands."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

from making.places import IMAGES, save_picture

_WIDTH = 1600


def draw_yard() -> None:
    """The yard before and after, by the commands of exposure.md."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        _call("sample", "yard", "-o", folder / "yard.glb")
        how = ("-c", "rusting", "--age", "1.5", "--variants", "3", "--set", "scene.image_height=600")
        _call("scene", folder / "yard.yaml", *how, "-o", folder / "rusted", "--quiet")
        sheet = Image.open(folder / "rusted" / "preview.png").convert("RGB")
        sheet.thumbnail((_WIDTH, _WIDTH), Image.Resampling.LANCZOS)
        save_picture(sheet, IMAGES / "yard.webp")


def _call(*words: object) -> None:
    subprocess.run([sys.executable, "-m", "weathercoat", *map(str, words)], check=True)
