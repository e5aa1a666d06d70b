"""The viewer's page: what it holds is what the run made, and it needs nothing else."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.output.snapshots import make_snapshot
from weathercoat.errors import CorruptError, LimitError
from weathercoat.mesh.surface import make_surface
from weathercoat.output import viewer
from weathercoat.output.display import Normalisation
from weathercoat.output.pictures import PictureParameters
from weathercoat.output.viewer import content as content_module
from weathercoat.output.viewer.arrays import Chunk, pack_chunk, unpack_chunk
from weathercoat.output.viewer.content import STRAIN_RANGE, film_order, pack_run, vertex_strain
from weathercoat.output.viewer.occlusion import bake_occlusion
from weathercoat.output.viewer.page import Start, write_page
from weathercoat.sim.snapshot import Snapshot

SHIPPED = Path(viewer.__file__).parent
WEB = Path(__file__).parents[2] / "web"


class _Page(HTMLParser):
    """The scripts of a page, and every attribute that could lead elsewhere."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.scripts: list[tuple[dict[str, str | None], str]] = []
        self.addresses: list[str] = []
        self._is_script = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href", "action")]
        self._is_script = tag == "script"
        if self._is_script:
            self.scripts.append((dict(attrs), ""))

    def handle_data(self, data: str) -> None:
        if self._is_script:
            self.scripts[-1] = self.scripts[-1][0], self.scripts[-1][1] + data

    def handle_endtag(self, tag: str) -> None:
        self._is_script = False


def snapshots() -> list[Snapshot]:
    return [
        make_snapshot(step=0, age=0.0),
        make_snapshot(split_column=2, step=50),
        make_snapshot(split_column=2, lost=5, step=100, age=1.0),
    ]


def page_of(shown: list[Snapshot], **more: Any) -> bytes:
    stream = BytesIO()
    rows = [{"step": each.step, "age": each.age, "lost_share": 0.25} for each in shown]
    write_page(stream, shown, rows, PictureParameters(), name="a <b> & c", **more)
    return stream.getvalue()


def read_page(content: bytes) -> tuple[dict[str, Any], list[dict[str, Any]], _Page]:
    page = _Page(content.decode())
    about = next(json.loads(text) for attributes, text in page.scripts if attributes.get("id") == "about")
    chunks = [text for attributes, text in page.scripts if attributes.get("class") == "chunk"]
    arrays = [unpack_chunk(Chunk(*pair)) for pair in zip(chunks, about["layouts"], strict=True)]
    return about, arrays, page


def test_chunks_keep_values_of_every_width_with_and_without_differences() -> None:
    rng = np.random.default_rng(1)
    arrays: dict[str, Any] = {
        "bytes": (rng.integers(0, 256, 77).astype(np.uint8), 0),
        "shorts": (rng.integers(0, 65536, (30, 3)).astype(np.uint16), 3),
        "words": (rng.integers(0, 1 << 32, (9, 3), np.uint32), 3),
        "none": (np.empty((0, 3), np.uint16), 3),
    }
    back = unpack_chunk(pack_chunk(arrays))
    assert list(back) == list(arrays)
    for name, (values, _) in arrays.items():
        np.testing.assert_array_equal(back[name], values.ravel())


def test_a_page_holds_the_snapshots_to_the_quantisation() -> None:
    shown = snapshots()
    about, (metal, *films), _ = read_page(page_of(shown))
    normalise = Normalisation.of(shown[0])
    low, spacing = np.array(about["grid"]["low"]), about["grid"]["spacing"]
    rest = metal["rest"].reshape(-1, 3)
    faces = metal["faces"].reshape(-1, 3)
    np.testing.assert_array_equal(faces, shown[0].substrate_faces)
    np.testing.assert_allclose(
        low + spacing * rest, normalise(shown[0].substrate_vertices), atol=0.51 * spacing
    )
    assert [each["step"] for each in about["snapshots"]] == [0, 50, 100]
    for snapshot, film in zip(shown, films, strict=True):
        order = film_order(snapshot)
        origin = np.repeat(np.arange(len(rest)), film["copies"])
        np.testing.assert_array_equal(origin, snapshot.film_origin[order])
        start = np.cumsum(film["copies"], dtype=np.int64) - film["copies"]
        corners = start[faces[film["present"] == 1]] + film["rank"].reshape(-1, 3)
        by_place = np.argsort(snapshot.film_face, kind="stable")
        np.testing.assert_array_equal(order[corners], snapshot.film_faces[by_place])
        places = (rest[origin] + film["shift"].reshape(-1, 3)).astype(np.uint16)
        expected = normalise(snapshot.film_vertices)[order]
        np.testing.assert_allclose(low + spacing * places, expected, atol=0.51 * spacing)
        for name, values in (
            ("stain", snapshot.film_rust[order]),
            ("rust", snapshot.substrate_rust),
            ("dirt", snapshot.dust),
            ("adhesion", snapshot.adhesion[order] / about["ranges"]["adhesion"]),
            ("strain", vertex_strain(snapshot)[order] / (2 * STRAIN_RANGE) + 0.5),
        ):
            np.testing.assert_allclose(film[name] / 255, np.clip(values, 0, 1), atol=0.51 / 255, err_msg=name)


def test_film_that_holds_costs_nothing_to_place() -> None:
    _, (_, film), _ = read_page(page_of([make_snapshot()]))
    assert not film["shift"].any()
    assert not film["rank"].any()


def test_a_page_asks_for_nothing_and_says_so() -> None:
    content = page_of(snapshots()).decode()
    page = _Page(content)
    assert page.addresses == ["data:,"]
    assert "default-src 'none'" in content
    assert "<title>a &lt;b&gt; &amp; c</title>" in content
    assert not re.search(r"url\((?!data:)", (SHIPPED / "viewer.css").read_text(encoding="utf-8"))


def test_the_same_run_makes_the_same_bytes() -> None:
    assert page_of(snapshots()) == page_of(snapshots())


def test_text_of_a_run_cannot_end_the_script_it_lies_in() -> None:
    stream = BytesIO()
    evil = {"step": 1, "age": 0.5, "severity": {"note": "</script><script>alert(1)</script>"}}
    write_page(stream, [make_snapshot()], [evil], PictureParameters(), name="x")
    about, _, page = read_page(stream.getvalue())
    assert about["snapshots"][0]["severity"]["note"].startswith("</script>")
    assert not any("alert(1)" in text and "about" not in str(of) for of, text in page.scripts)


def test_a_page_begins_where_it_is_told() -> None:
    about, _, _ = read_page(page_of(snapshots(), start=Start(step=100, before=0)))
    assert about["start"] == {"step": 100, "before": 0}


def test_parts_without_paint_and_risk_are_in_the_page_where_there_are_any() -> None:
    shown = snapshots()[:1]
    vertices, faces = shown[0].substrate_vertices + 2.0, shown[0].substrate_faces
    risk = np.linspace(0.0, 2.0, len(shown[0].film_vertices))
    about, (metal, film), _ = read_page(
        page_of(shown, untouched=make_surface(vertices, faces), risk={0: risk})
    )
    box = about["untouched"]
    places = np.array(box["low"]) + box["spacing"] * metal["untouched"].reshape(-1, 3)
    np.testing.assert_allclose(places, Normalisation.of(shown[0])(vertices), atol=0.51 * box["spacing"])
    np.testing.assert_array_equal(metal["untouched_faces"], faces.ravel())
    expected = np.clip(risk[film_order(shown[0])], 0, 1)
    np.testing.assert_allclose(film["risk"] / 255, expected, atol=0.51 / 255)


def test_strain_is_the_mean_stretch_of_the_edges_at_a_vertex() -> None:
    snapshot = make_snapshot()
    stretched = replace(snapshot, film_vertices=1.03 * snapshot.film_vertices)
    np.testing.assert_allclose(vertex_strain(stretched), 0.03, rtol=1e-9)


def test_what_lies_under_a_flap_is_darker_than_what_lies_open() -> None:
    snapshot = make_snapshot(cells=12, split_column=6)
    light = bake_occlusion(snapshot, 1.0)
    x = snapshot.substrate_vertices[:, 0]
    under, open_front = light.metal[(x > 0.6) & (x < 0.9)], light.front[snapshot.film_vertices[:, 0] < 0.3]
    assert under.mean() < 0.4
    assert open_front.min() > 0.95
    assert not light.metal[x < 0.3].any()  # under film that holds


def test_a_film_that_is_all_gone_is_no_obstacle() -> None:
    faces = len(make_snapshot().film_faces)
    bare = make_snapshot(lost=faces)
    _, (_, film), _ = read_page(page_of([bare]))
    assert not film["present"].any()
    assert film["open_metal"].min() == 255


def test_a_page_too_large_for_a_browser_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(content_module, "MOST_FACES", 60)
    with pytest.raises(LimitError, match=r"3 snapshots have .* at most 60") as refused:
        pack_run(snapshots())
    assert "--steps" in (refused.value.remedy or "")


def test_a_film_of_another_metal_is_refused() -> None:
    snapshot = make_snapshot()
    with pytest.raises(CorruptError):
        pack_run([replace(snapshot, film_face=snapshot.film_face[::-1].copy())])


def test_the_shipped_script_is_built_from_its_sources(tmp_path: Path) -> None:
    if shutil.which("node") is None or not (WEB / "node_modules" / "three").exists():
        pytest.skip("needs Node and web/node_modules: make web")
    subprocess.run(["node", str(WEB / "build.mjs"), str(tmp_path)], check=True)
    for name in ("viewer.js", "THREE-LICENSE.txt"):
        assert (tmp_path / name).read_bytes() == (SHIPPED / name).read_bytes(), f"{name}: make web"


def test_the_shipped_script_names_the_version_of_three_that_is_asked_for() -> None:
    wanted = json.loads((WEB / "package.json").read_text(encoding="utf-8"))["devDependencies"]["three"]
    assert f"three.js {wanted}," in (SHIPPED / "viewer.js").read_text(encoding="utf-8")[:200]
