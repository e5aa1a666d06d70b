"""The table of formats: every cell is yes, or the one reason that is known."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import measure_formats

KNOWN = {"no: OBJ has no place for them"}


def test_every_format_keeps_what_the_table_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("pxr", "vtk", "pygltflib"):
        pytest.importorskip(name)
    monkeypatch.setattr(measure_formats, "FACES", 1200)
    monkeypatch.setattr(measure_formats, "STEPS", 40)
    _, _, *rows = measure_formats.measure(tmp_path)
    assert len(rows) == len(measure_formats.READERS)
    for row in rows:
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        assert all(cell.startswith("yes") or cell in KNOWN for cell in cells[2:6]), row
