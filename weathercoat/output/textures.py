"""Pictures of the model's materials as files, for formats that name them."""

from __future__ import annotations

import mimetypes
import re
from pathlib import Path

from weathercoat.mesh.materials import Texture

FOLDER = "textures"


class PictureFolder:
    """The folder `textures` in another, to which pictures are added once each."""

    def __init__(self, beside: Path) -> None:
        self._folder = beside / FOLDER
        self._known: list[bytes] = []
        self._names: list[str] = []

    def add(self, texture: Texture) -> str:
        """The path of a picture from the folder beside which it lies; it is written where it is new.

        Raises OSError where that cannot be.
        """
        if texture.image not in self._known:
            suffix = mimetypes.guess_extension(texture.mime) or ".png"
            stem = re.sub(r"[^\w.-]+", "_", texture.name) or "picture"
            name, number = stem + suffix, 2
            while name in self._names:
                name, number = f"{stem}_{number}{suffix}", number + 1
            self._folder.mkdir(exist_ok=True)
            (self._folder / name).write_bytes(texture.image)
            self._known.append(texture.image)
            self._names.append(name)
        return f"{FOLDER}/{self._names[self._known.index(texture.image)]}"
