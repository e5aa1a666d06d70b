"""Where things lie, and how pictures are stored."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parents[1]
IMAGES = DOCS / "images"


def save_picture(picture: Image.Image, path: Path) -> None:
    """Write a picture as WebP, which is a tenth of a PNG of such noisy surfaces."""
    path.parent.mkdir(parents=True, exist_ok=True)
    picture.save(path, quality=82, method=6)
    print(f"{path.relative_to(DOCS)}  {path.stat().st_size // 1024} kB", flush=True)
