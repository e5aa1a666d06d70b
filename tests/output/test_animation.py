"""Moving pictures: their frames, durations and colours, and that the same frames give the same bytes."""

from __future__ import annotations

import shutil
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from weathercoat.errors import UsageError
from weathercoat.output.animation import write_animation


def frames(count: int = 5, channels: int = 3) -> list[np.ndarray]:
    """A square that wanders over a slope of greys."""
    made = []
    for index in range(count):
        image = np.repeat(np.linspace(40, 220, 64).astype(np.uint8)[None, :, None], channels, axis=2)
        image = np.repeat(image, 48, axis=0)
        image[10:20, 10 * index : 10 * index + 10, :3] = (200, 30, 30)
        made.append(image)
    return made


def written(kind: str, images: list[np.ndarray], seconds: float = 0.2, loop: bool = True) -> bytes:
    stream = BytesIO()
    write_animation(stream, images, kind, [seconds] * len(images), loop=loop)
    return stream.getvalue()


def shown(content: bytes) -> list[np.ndarray]:
    with Image.open(BytesIO(content)) as movie:
        found = []
        for index in range(movie.n_frames):
            movie.seek(index)
            found.append(np.asarray(movie.convert("RGB")).astype(int))
        return found


@pytest.mark.parametrize("kind", [".webp", ".gif"])
def test_frames_come_back_and_the_same_ones_make_the_same_bytes(kind: str) -> None:
    images = frames()
    content = written(kind, images)
    found = shown(content)
    assert len(found) == len(images)
    for image, seen in zip(images, found, strict=True):
        assert np.abs(seen - image).mean() < 4.0
    assert written(kind, images) == content


def test_durations_and_loops_are_said() -> None:
    with Image.open(BytesIO(written(".gif", frames(), 0.3))) as movie:
        assert movie.info["duration"] == 300 and movie.info["loop"] == 0
    with Image.open(BytesIO(written(".gif", frames(), loop=False))) as movie:
        assert "loop" not in movie.info
    with Image.open(BytesIO(written(".webp", frames(), loop=False))) as movie:
        assert movie.info["loop"] == 1


def test_a_gif_has_one_palette_so_that_what_stands_still_does_not_flicker() -> None:
    found = shown(written(".gif", frames()))
    for seen in found[1:]:
        assert np.array_equal(seen[25:], found[0][25:])


def test_transparency_is_kept_by_webp_and_refused_by_the_others() -> None:
    images = frames(2, channels=4)
    disc = np.hypot(*np.mgrid[-24:24, -32:32]) < 20
    for image in images:
        image[:, :, 3] = 255 * disc
    with Image.open(BytesIO(written(".webp", images))) as movie:
        alpha = np.asarray(movie.convert("RGBA"))[:, :, 3]
    assert np.array_equal(alpha, 255 * disc)
    with pytest.raises(UsageError, match="transparency"):
        written(".gif", images)


def test_mp4_without_ffmpeg_is_refused_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(UsageError, match="ffmpeg"):
        written(".mp4", frames())


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg here")
def test_ffmpeg_writes_mp4() -> None:
    assert written(".mp4", frames())[4:8] == b"ftyp"
