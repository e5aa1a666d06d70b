"""How much memory a process may use, what a run is expected to need, and polite refusals."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from weathercoat import memory
from weathercoat.cli.handler import call
from weathercoat.config.load import load_config
from weathercoat.cost import estimate_cost, faces_that_fit
from weathercoat.errors import LimitError, UsageError
from weathercoat.memory import MemoryLimit, memory_limit, parse_size, usable_memory
from weathercoat.mesh.shapes import make_plate
from weathercoat.output.meshes import write_mesh
from weathercoat.run import run_asset


@pytest.mark.parametrize(
    ("text", "size"),
    [("4G", 4_000_000_000), ("500mb", 500_000_000), ("1.5GiB", 3 << 29), (" 2 Ki ", 2048), ("7", 7)],
)
def test_sizes(text: str, size: int) -> None:
    assert parse_size(text) == size


@pytest.mark.parametrize("text", ["", "G", "-1G", "0", "4X", "1e9", "4 G B", "nan"])
def test_what_is_no_size(text: str) -> None:
    with pytest.raises(UsageError, match="no size of memory"):
        parse_size(text)


def test_the_least_limit_counts_and_says_what_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "_control_groups", lambda: iter([10**7]))
    limit = usable_memory()
    assert limit is not None
    assert limit.bytes == 10**7 and "control group" in limit.origin


def test_a_wanted_limit_counts_instead_of_all_but_those_of_the_shell(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "_soft_limits", lambda: iter([MemoryLimit(10.0, "free")]))
    monkeypatch.setattr(memory, "_rigid_limits", lambda: iter(()))
    assert memory_limit(None) == (10.0, "free")
    assert memory_limit(1000) == (1000, "what --max-memory allows")
    monkeypatch.setattr(memory, "_rigid_limits", lambda: iter([MemoryLimit(100.0, "shell")]))
    assert memory_limit(1000) == (100.0, "shell")
    assert memory_limit(50) == (50, "what --max-memory allows")


def test_control_groups_of_both_versions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The groups above a process's own limit it as well; a missing file and `max` say nothing."""

    def in_root(path: str) -> Path:
        return tmp_path / path.lstrip("/")

    monkeypatch.setattr(memory, "Path", in_root)
    outer = tmp_path / "sys/fs/cgroup/outer"
    (outer / "inner").mkdir(parents=True)
    (outer / "memory.max").write_text("3000\n")
    (outer / "inner" / "memory.max").write_text("max\n")
    old = tmp_path / "sys/fs/cgroup/memory/job"
    old.mkdir(parents=True)
    (old / "memory.limit_in_bytes").write_text("2000\n")
    (tmp_path / "proc/self").mkdir(parents=True)
    (tmp_path / "proc/self/cgroup").write_text("4:memory:/job\n3:cpu:/job\n0::/outer/inner\n")
    assert sorted(memory._control_groups()) == [2000, 3000]


def test_what_fits_does_fit() -> None:
    config = load_config("standard").config
    fits = faces_that_fit(config, 1000, 10**9)
    for faces, expected in ((fits, True), (2 * fits, False)):
        asked = load_config("standard", [f"remesh.faces={faces}"]).config
        assert (estimate_cost(asked, 1000).memory <= 10**9) is expected
    assert faces_that_fit(config, 1000, 10**6) == 0


def test_large_pictures_count() -> None:
    large = load_config("standard", ["output.picture_width=16384", "output.picture_height=16384"]).config
    cost = estimate_cost(large, 1000)
    assert cost.stage == "pictures" and cost.memory > 20e9


def test_a_run_that_needs_too_much_is_refused_before_the_work(tmp_path: Path) -> None:
    write_mesh(tmp_path / "plate.obj", make_plate())
    loaded = load_config("standard", ["remesh.faces=2000000"])
    with pytest.raises(LimitError) as raised:
        run_asset(loaded, tmp_path / "plate.obj", tmp_path / "out", max_memory=10**9)
    line = raised.value.line()
    assert line.startswith("plate.obj: E-LIMIT: the run needs about ")
    assert "more than 1,000 MB, what --max-memory allows" in line
    assert "remesh.faces=" in line and "would fit" in line
    assert [path.name for path in tmp_path.iterdir()] == ["plate.obj"]


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    file = tmp_path / "large.ply"
    with file.open("wb") as stream:
        stream.truncate(1 << 30)
    with pytest.raises(LimitError, match=r"a file of 1,074 MB needs about .* to be read"):
        run_asset(load_config("standard"), file, tmp_path / "out", max_memory=10**9)


def test_inspect_and_plan_tell_what_would_be_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "plate.obj"
    write_mesh(model, make_plate())
    for command in (["inspect", str(model)], ["plan", "standard", str(model)]):
        assert call([*command, "--set", "remesh.faces=2000000", "--max-memory", "1G"]) == 0
        said = capsys.readouterr().out
        assert "more than 1,000 MB, what --max-memory allows" in said and "would fit" in said
        assert call([*command, "--max-memory", "1G", "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        figures = found.get("run_cost") or found["cost"]
        assert figures["fits"] and figures["memory_limit_mb"] == 1000 > figures["memory_mb"]


@pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")
@pytest.mark.parametrize("kind", ["RLIMIT_AS", "RLIMIT_DATA"])
def test_limits_of_the_shell(kind: str) -> None:
    """Too tight for the libraries: refused before they are loaded. Else it counts, with some to spare."""
    program = (
        "import resource, sys\n"
        f"resource.setrlimit(resource.{kind}, (int(sys.argv[1]), resource.RLIM_INFINITY))\n"
        "from weathercoat.memory import require_address_space, usable_memory\n"
        "from weathercoat.errors import LimitError\n"
        "try: require_address_space()\n"
        "except LimitError as error: print(error.line())\n"
        "else: print(usable_memory().bytes / int(sys.argv[1]))\n"
    )

    def said(limit: int) -> str:
        run = subprocess.run([sys.executable, "-c", program, str(limit)], capture_output=True, text=True)
        assert run.returncode == 0, run.stderr
        return run.stdout

    assert "E-LIMIT" in said(200_000_000)
    assert 0.0 <= float(said(1_000_000_000)) < 0.8


def test_no_limit_where_the_system_tells_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "_soft_limits", lambda: iter(()))
    monkeypatch.setattr(memory, "_rigid_limits", lambda: iter(()))
    assert usable_memory() is None
