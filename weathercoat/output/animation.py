"""Moving pictures: WebP and GIF by Pillow, MP4 by the ffmpeg that is installed.

The wheels that could write MP4 bring x264 with them, which is under the GPL; a program that the user has is
another matter.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from weathercoat.errors import OutputError, UsageError
from weathercoat.output.pictures import Image

STILLS = (".png", ".webp")
MOVING = (".webp", ".gif", ".mp4")
_QUALITY = 90  # of WebP, of 100
_COLORS = 256
_PALETTE_PIXELS = 400_000  # of all frames together that the palette is made of


def write_animation(
    target: BinaryIO, images: Sequence[Image], kind: str, seconds: Sequence[float], *, loop: bool = True
) -> None:
    """Write pictures of one size, each shown for its `seconds`, as `kind`: .webp, .gif or .mp4.

    loop: whether viewers begin again at the end; MP4 does not say. The same pictures make the same bytes of
    WebP and GIF. Raises UsageError for pictures with an alpha channel that the format has no place for and
    where there is no ffmpeg, OutputError where that fails.
    """
    if images[0].shape[2] == 4 and kind != ".webp":
        raise UsageError(f"{kind} knows no transparency", remedy="write .webp, or choose a background")
    if kind == ".mp4":
        _write_mp4(target, images, seconds)
    elif kind == ".gif":
        _write_gif(target, images, seconds, loop)
    else:
        _write_webp(target, images, seconds, loop)


def _milliseconds(seconds: Sequence[float]) -> list[int]:
    return [max(1, round(1000.0 * each)) for each in seconds]


def _write_webp(target: BinaryIO, images: Sequence[Image], seconds: Sequence[float], loop: bool) -> None:
    from PIL import Image as Pillow

    first, *others = (Pillow.fromarray(np.ascontiguousarray(image)) for image in images)
    first.save(
        target,
        format="WEBP",
        save_all=True,
        append_images=others,
        duration=_milliseconds(seconds),
        loop=0 if loop else 1,
        quality=_QUALITY,
        method=4,
    )


def _write_gif(target: BinaryIO, images: Sequence[Image], seconds: Sequence[float], loop: bool) -> None:
    """One palette for all frames and no dither: colours that stand still do not flicker."""
    from PIL import Image as Pillow

    stride = max(1, sum(image[:, :, 0].size for image in images) // _PALETTE_PIXELS)
    pixels = np.concatenate([image.reshape(-1, 3) for image in images])[::stride]
    palette = Pillow.fromarray(pixels[None]).quantize(_COLORS, method=Pillow.Quantize.MEDIANCUT)
    first, *others = (
        Pillow.fromarray(np.ascontiguousarray(image)).quantize(palette=palette, dither=Pillow.Dither.NONE)
        for image in images
    )
    more = {"loop": 0} if loop else {}
    # GIF counts in hundredths of a second
    duration = [10 * max(2, round(100.0 * each)) for each in seconds]
    first.save(
        target, format="GIF", save_all=True, append_images=others, duration=duration, disposal=1, **more
    )


def _write_mp4(target: BinaryIO, images: Sequence[Image], seconds: Sequence[float]) -> None:
    program = shutil.which("ffmpeg")
    if program is None:
        raise UsageError(
            "writing MP4 needs the program ffmpeg, which is not there",
            remedy="install it, or write .webp or .gif",
        )
    height, width = images[0].shape[:2]
    shortest = min(seconds)
    rate = 1.0 / shortest
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "out.mp4"
        command = [
            program, "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}",
            "-r", f"{rate:.6f}", "-i", "-", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p",
            "-movflags", "+faststart", "-fflags", "+bitexact", str(path),
        ]  # fmt: skip
        frames = b"".join(
            image.tobytes() * round(each / shortest) for image, each in zip(images, seconds, strict=True)
        )
        done = subprocess.run(command, input=frames, capture_output=True, check=False)
        if done.returncode != 0:
            message = done.stderr.decode(errors="replace").strip().splitlines()
            raise OutputError(f"ffmpeg failed: {message[-1] if message else done.returncode}")
        target.write(path.read_bytes())
