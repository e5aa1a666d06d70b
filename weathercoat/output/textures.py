"""Pictures of the model's materials: as files, for formats that name them, and in formats that glTF holds."""

from __future__ import annotations

import mimetypes
import re
from functools import lru_cache
from io import BytesIO
from pathlib import Path

from weathercoat.mesh.materials import Texture

FOLDER = "textures"
_KEPT = {"PNG": "image/png", "JPEG": "image/jpeg", "WEBP": "image/webp", "AVIF": "image/avif"}
_PNG_MODES = ("1", "L", "LA", "I;16", "P", "RGB", "RGBA")
_ALPHA_MODES = ("PA", "La", "RGBa")


@lru_cache(maxsize=16)  # a run writes the same few pictures again and again
def gltf_picture(image: bytes) -> tuple[bytes, str] | None:
    """A picture as glTF 2.0 and its extensions can hold it, with its MIME type; None where it cannot be
    decoded.

    Told by the content, since names of files mislead. PNG, JPEG, WebP and AVIF keep their bytes; others, such
    as BMP and TGA of OBJ's material libraries, become PNG.
    """
    from PIL import Image

    if image[4:12] == b"ftypavif":  # not all builds of Pillow know it
        return image, _KEPT["AVIF"]
    try:
        with Image.open(BytesIO(image)) as opened:
            if opened.format in _KEPT:
                return image, _KEPT[opened.format]
            mode = opened.mode
            if mode not in _PNG_MODES:
                mode = "RGBA" if mode in _ALPHA_MODES else "RGB"
            pixels = opened if mode == opened.mode else opened.convert(mode)
            stream = BytesIO()
            pixels.save(stream, "PNG")
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        return None
    return stream.getvalue(), _KEPT["PNG"]


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
