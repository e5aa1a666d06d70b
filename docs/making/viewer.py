"""The picture of viewer.md: the page of a run, as a browser shows it."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from PIL import Image

from making.places import DOCS, IMAGES, save_picture
from weathercoat.cli.handler import call


def draw_viewer() -> None:
    """Age a sign, write its page, open it in a headless Chromium and save what it shows."""
    sys.path.insert(0, str(DOCS.parent))
    from tests.browser import Browser

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        model, run, page = folder / "sign.obj", folder / "sign", folder / "sign.html"
        call(["sample", "sign", "-o", str(model)])
        call(["run", "standard", str(model), "-o", str(run), "--set", "snapshots.count=10"])
        call(["view", str(run), "-o", str(page)])
        with Browser(folder / "profile", width=1440, height=900) as browser:
            browser.open(page, "step=700")
            save_picture(Image.fromarray(browser.picture()), IMAGES / "viewer.webp")
            browser.ask("after=1000&before=300&light=daylight")
            save_picture(Image.fromarray(browser.picture()), IMAGES / "viewer-slider.webp")
