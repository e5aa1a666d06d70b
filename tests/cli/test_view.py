"""`view` makes a page of a finished run, of the steps that are wanted."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from weathercoat.cli.handler import call

QUICK = (
    "--faces",
    "300",
    "--steps",
    "40",
    "--set",
    "snapshots.steps=[10,20,40]",
    "--set",
    "output.preview=false",
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("view")
    assert call(["sample", "plate", "-o", str(folder / "plate.obj")]) == 0
    assert call(["run", "standard", str(folder / "plate.obj"), "-o", str(folder / "run"), *QUICK]) == 0
    return folder / "run"


def about(page: Path) -> dict[str, object]:
    found = re.search(r'id="about">(.*?)</script>', page.read_text(encoding="utf-8"))
    assert found is not None
    return json.loads(found[1])  # type: ignore[no-any-return]


def test_a_page_has_all_snapshots_and_their_figures(run: Path, tmp_path: Path) -> None:
    page = tmp_path / "view.html"
    assert call(["view", str(run), "-o", str(page)]) == 0
    held = about(page)
    report = json.loads((run / "run.json").read_text(encoding="utf-8"))
    assert held["name"] == "plate"
    assert [each["step"] for each in held["snapshots"]] == [10, 20, 40]  # type: ignore[attr-defined]
    for moment, row in zip(held["snapshots"], report["snapshots"], strict=True):  # type: ignore[call-overload]
        assert moment["severity"] == row["severity"]
        assert moment["figures"]["lost_share"] == row["lost_share"]


def test_a_page_has_the_steps_that_are_asked_for(run: Path, tmp_path: Path) -> None:
    page = tmp_path / "view.html"
    assert call(["view", str(run), "-o", str(page), "--steps", "40", "--before", "10"]) == 0
    held = about(page)
    assert [each["step"] for each in held["snapshots"]] == [10, 40]  # type: ignore[attr-defined]
    assert held["start"] == {"before": 10}


def test_risk_is_laid_over_where_it_is_asked_for(run: Path, tmp_path: Path) -> None:
    for name, more in (("plain", []), ("risk", ["--risk"])):
        page = tmp_path / f"{name}.html"
        assert call(["view", str(run), "-o", str(page), *more]) == 0
        layouts = about(page)["layouts"]
        has_risk = [any(array[0] == "risk" for array in layout) for layout in layouts[1:]]  # type: ignore[index]
        assert has_risk == [name == "risk"] * 3


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--steps", "15"], "no snapshot of step 15"),
        (["--steps", "many"], "no list of steps"),
        (["--after", "40"], "--before too"),
        (["--step", "10", "--before", "20"], "--after"),
    ],
)
def test_what_does_not_go_is_refused(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], more: list[str], said: str
) -> None:
    page = tmp_path / "view.html"
    assert call(["view", str(run), "-o", str(page), *more]) == 2
    assert said in capsys.readouterr().err
    assert not page.exists()
