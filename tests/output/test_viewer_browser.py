"""The viewer's page in a real browser, from the disk and without a network."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.browser import Browser, find_browser
from tests.output.snapshots import make_snapshot
from weathercoat.output.pictures import PictureParameters
from weathercoat.output.viewer.page import write_page

pytestmark = [
    pytest.mark.skipif(
        find_browser() is None, reason="needs Chromium: install it, or name it in WEATHERCOAT_CHROMIUM"
    ),
    pytest.mark.long,
]
BARE = "ui=0&light=overcast&background=light"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page of three moments of a sheet, of which ever more has gone."""
    cells, path = 16, tmp_path_factory.mktemp("page") / "view.html"
    shown = [
        make_snapshot(cells=cells, step=0, age=0.0),
        make_snapshot(cells=cells, split_column=8, lost=60, step=50, age=0.5),
        make_snapshot(cells=cells, split_column=8, lost=400, step=100, age=1.0),
    ]
    rows = [{"step": each.step, "age": each.age, "lost_share": 0.01 * each.step} for each in shown]
    with path.open("wb") as stream:
        write_page(stream, shown, rows, PictureParameters(), name="sheet")
    return path


@pytest.fixture(scope="module")
def _opened(page: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile"), width=480, height=360) as browser:
        browser.open(page, BARE)
        yield browser


@pytest.fixture
def browser(_opened: Browser) -> Browser:
    """The page as it begins, in a browser that said nothing so far."""
    _opened.ask(BARE)
    _opened.messages.clear()
    return _opened


def is_near(picture: np.ndarray, color: tuple[int, int, int], within: float) -> np.ndarray:
    """Where a picture (h, w, 3) has about the hue of a colour, (h, w), whatever its brightness."""
    flat = picture.astype(float)
    direction = np.array(color) / np.linalg.norm(color)
    along = flat @ direction
    return (np.linalg.norm(flat - along[..., None] * direction, axis=2) < within * along) & (along > 40)


def test_it_opens_from_the_disk_without_a_request_or_an_error(browser: Browser, page: Path) -> None:
    assert browser.requests == [page.as_uri()]
    assert browser.messages == []
    assert browser.run("document.getElementById('notice').hidden")
    assert browser.run("document.title") == "sheet"


def test_it_shows_paint_before_a_light_background(browser: Browser) -> None:
    browser.ask(f"{BARE}&step=0")
    picture = browser.picture()
    paint = tuple(int(255 * each) for each in PictureParameters().paint)
    assert is_near(picture, paint, 0.25).mean() > 0.05
    corner = picture[4:20, 4:20].reshape(-1, 3)
    assert corner.min() > 190 and np.ptp(corner, axis=1).max() < 16


def test_time_changes_the_picture_and_the_figures(browser: Browser) -> None:
    browser.ask("step=0")
    before, text = browser.picture(), browser.run("document.getElementById('age').textContent")
    lost = "document.querySelector('#figures output').textContent"
    assert browser.run(lost) == "0.0\u202f%"
    browser.run(
        "const s = document.getElementById('step'); s.value = 2; s.dispatchEvent(new Event('input')); null"
    )
    browser.wait("document.documentElement.dataset.shown === '100'")
    assert browser.run("document.getElementById('age').textContent") != text
    assert browser.run(lost) == "100.0\u202f%"
    assert browser.run("location.hash") == "#step=100"
    browser.wait("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")
    assert (np.abs(browser.picture().astype(int) - before).max(axis=2) > 24).mean() > 0.03


def test_the_keys_move_through_time_and_overlays(browser: Browser) -> None:
    browser.ask("step=100")
    browser.key("ArrowLeft")
    browser.wait("document.documentElement.dataset.shown === '50'")
    browser.key("2")
    assert browser.run("document.querySelector('#legend b').textContent") == "Dirt"
    browser.key("0")
    assert browser.run("document.getElementById('legend').hidden")


@pytest.mark.parametrize("overlay", ["rust", "dirt", "adhesion", "strain"])
def test_an_overlay_shows_its_scale_and_colours_the_model(browser: Browser, overlay: str) -> None:
    browser.ask("step=50&background=light")
    plain = browser.picture()
    browser.ask(f"step=50&background=light&overlay={overlay}")
    assert browser.run("document.querySelector('#legend b').textContent").lower() == overlay
    changed = np.abs(browser.picture().astype(int) - plain).max(axis=2) > 24
    assert changed.mean() > 0.1


def test_the_pointer_tells_the_value_under_it(browser: Browser) -> None:
    browser.ask("ui=0&step=0&overlay=adhesion")
    browser.mouse("mouseMoved", 240, 190)
    browser.wait("!document.getElementById('probe').hidden")
    name, value, part = browser.run("document.getElementById('probe').textContent").split()
    assert (name, part) == ("Adhesion", "film")
    assert 0.0 < float(value) < 5.0


def test_film_and_metal_come_and_go(browser: Browser) -> None:
    pictures = []
    for asked in ("", "&film=0", "&film=0&metal=0"):
        browser.ask(f"{BARE}&step=0{asked}")
        pictures.append(browser.picture().astype(int))
    film, metal, nothing = pictures
    assert (np.abs(film - metal).max(axis=2) > 24).mean() > 0.15
    assert (np.abs(metal - nothing).max(axis=2) > 24).mean() > 0.15
    assert (np.abs(nothing - nothing[180, 5]).max(axis=2) < 60).all()


def test_the_divider_shows_both_moments_and_moves_by_keys(browser: Browser) -> None:
    alone = []
    for step in (0, 100):
        browser.ask(f"{BARE}&step={step}")
        alone.append(browser.picture().astype(int))
    browser.ask(f"{BARE}&before=0&after=100&divider=0.5")
    both = browser.picture().astype(int)
    for side, picture in ((slice(0, 215), alone[0]), (slice(265, 480), alone[1])):
        assert (np.abs(both - picture)[110:300, side].max(axis=2) < 12).mean() > 0.97
    browser.run("document.getElementById('divider').focus()")
    browser.key("ArrowRight")
    assert browser.run("document.getElementById('divider').getAttribute('aria-valuenow')") == "52"


def test_every_control_has_a_name(browser: Browser) -> None:
    nameless = browser.run(
        "[...document.querySelectorAll('button, select, input, [role=slider]')]"
        ".filter(e => !(e.textContent.trim() || e.getAttribute('aria-label') || e.labels?.length))"
        ".map(e => e.outerHTML)"
    )
    assert nameless == []


def test_nothing_was_said_in_all_of_this(_opened: Browser, page: Path) -> None:
    assert _opened.messages == []
    assert _opened.requests == [page.as_uri()]
