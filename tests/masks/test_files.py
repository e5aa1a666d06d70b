"""Pictures and lines from files, and what is wrong with them in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from weathercoat.config.load import load_config
from weathercoat.errors import ConfigError
from weathercoat.masks.files import hash_masks, mask_source, read_lines, read_picture


def config_of(folder: Path, text: str) -> Path:
    path = folder / "own.yaml"
    path.write_text(f"seed: 1\nsteering:\n{text}")
    return path


def test_lines_of_obj_and_csv(tmp_path: Path) -> None:
    obj, table = tmp_path / "a.obj", tmp_path / "a.csv"
    obj.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nl 1 2 3\nl -1/1 1\n")
    table.write_text("x,y,z\n0,0,0\n1,0,0\n1,1,0\n\n1,1,0\n0,0,0\n")
    for path in (obj, table):
        lines = [line.tolist() for line in read_lines(path)]
        assert lines == [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[1, 1, 0], [0, 0, 0]]]


@pytest.mark.parametrize(
    ("name", "text", "what"),
    [
        ("a.obj", "v 0 0 0\nl 1 2\n", "line 2: no such vertex"),
        ("a.obj", "v 0 0 0\nf 1 1 1\n", "holds no lines"),
        ("a.csv", "0,0,0\n1,nan,0\n", "line 2: a point has three finite coordinates"),
        ("a.csv", "0,0,0\n", "holds no lines"),
    ],
)
def test_broken_lines_are_told_of(tmp_path: Path, name: str, text: str, what: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=what):
        read_lines(tmp_path / name)


def test_channels_of_pictures_of_8_and_16_bits(tmp_path: Path) -> None:
    Image.fromarray(np.array([[[255, 0, 51, 102]]], np.uint8)).save(tmp_path / "four.png")
    for channel, value in (("r", 1.0), ("g", 0.0), ("b", 0.2), ("a", 0.4), ("grey", 0.2126 + 0.0722 * 0.2)):
        assert read_picture(tmp_path / "four.png", channel)[0, 0] == pytest.approx(value, abs=1e-12)
    Image.fromarray(np.array([[257, 65535]], np.uint16)).save(tmp_path / "deep.png")
    assert read_picture(tmp_path / "deep.png", "grey")[0].tolist() == [257 / 65535, 1.0]


def test_what_is_no_picture_is_told_of(tmp_path: Path) -> None:
    (tmp_path / "bad.png").write_text("no picture")
    with pytest.raises(ValueError, match="is no picture that can be read"):
        read_picture(tmp_path / "bad.png", "r")


def test_files_lie_beside_the_config_and_are_hashed(tmp_path: Path) -> None:
    folder = tmp_path / "deep"
    folder.mkdir()
    (folder / "way.csv").write_text("0,0,0\n1,0,0\n")
    loaded = load_config(config_of(folder, "  - guide: way.csv\n"))
    assert mask_source(loaded).folder == folder
    first = hash_masks(loaded)
    (folder / "way.csv").write_text("0,0,0\n2,0,0\n")
    assert list(first) == ["steering/way.csv"] and hash_masks(loaded) != first


def test_a_missing_file_is_one_line_with_its_key(tmp_path: Path) -> None:
    path = config_of(tmp_path, "  - change: dirt\n    multiply: 2\n    by: {image: {file: none.png}}\n")
    with pytest.raises(ConfigError) as caught:
        hash_masks(load_config(path))
    (line,) = caught.value.lines()
    assert line.startswith(
        f"{path}:2: E-CONFIG: steering[0]: {tmp_path / 'none.png'} cannot be read: No such"
    )
