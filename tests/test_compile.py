"""Where compiled kernels are kept, that they are found again, and what happens where they cannot be."""

from __future__ import annotations

import errno
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from numba.core.errors import TypingError

import weathercoat.lock
from weathercoat.compile import cache_folder, kernel, remove_unused, watch_compiling
from weathercoat.lock import FolderLock

VALUE = 0.13691995878400012
TRIAL = """
from weathercoat.compile import watch_compiling
from weathercoat.film.noise import perlin, PERMUTATION
with watch_compiling(lambda: None) as compiling:
    print(perlin(3.14, 42.0, 7.0, PERMUTATION), compiling.kernels)
"""
# the memory behind the slice is there, so that reading it does no harm
BEYOND = """
import numpy
from weathercoat.compile import kernel

@kernel
def read(array, index):
    return array[index]

try:
    print(read(numpy.zeros(8, numpy.int64)[:4], 6))
except IndexError as problem:
    print(type(problem).__name__)
"""
SOURCES = Path(weathercoat.__file__).parent
DAY = 86_400.0

pytestmark = pytest.mark.compiled


def environment(**changes: object) -> dict[str, str]:
    """That of this process without places for caches, and with `changes`."""
    places = ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME")
    kept = {key: value for key, value in os.environ.items() if key not in places}
    added = {key: str(value) for key, value in changes.items()}
    return {**kept, "PYTHONPATH": str(SOURCES.parent), "PYTHONDONTWRITEBYTECODE": "1", **added}


def start_kernel(cwd: Path, **changes: object) -> subprocess.Popen[str]:
    """A process of its own that calls a kernel."""
    command = [sys.executable, "-c", TRIAL]
    return subprocess.Popen(command, env=environment(**changes), cwd=cwd, stdout=subprocess.PIPE, text=True)


def compiled_by(process: subprocess.Popen[str]) -> int:
    """How many kernels a process of `start_kernel` compiled."""
    said, _ = process.communicate()
    assert process.returncode == 0
    value, compiled = said.split()
    assert float(value) == pytest.approx(VALUE, abs=1e-15)
    return int(compiled)


def try_kernel(cwd: Path, **changes: object) -> int:
    """Call a kernel in a process of its own; returns how many were compiled."""
    return compiled_by(start_kernel(cwd, **changes))


def files_below(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def test_kernels_are_kept_and_mended(tmp_path: Path) -> None:
    """Compiled once; a file that is cut short, as by a crash, is no kernel and is written anew."""
    assert try_kernel(tmp_path, NUMBA_CACHE_DIR=tmp_path) > 1
    assert try_kernel(tmp_path, NUMBA_CACHE_DIR=tmp_path) == 0
    (kept,) = tmp_path.rglob("perlin-*.kernel")
    whole = kept.stat().st_size
    kept.write_bytes(kept.read_bytes()[: whole // 2])
    assert try_kernel(tmp_path, NUMBA_CACHE_DIR=tmp_path) >= 1
    assert kept.stat().st_size == whole
    assert try_kernel(tmp_path, NUMBA_CACHE_DIR=tmp_path) == 0


def test_processes_that_start_at_once_compile_each_kernel_once(tmp_path: Path) -> None:
    alone = try_kernel(tmp_path, NUMBA_CACHE_DIR=tmp_path / "alone")
    together = [start_kernel(tmp_path, NUMBA_CACHE_DIR=tmp_path / "together") for _ in range(3)]
    assert sum(map(compiled_by, together)) == alone


def doubling(name: str) -> Callable[[float], float]:
    """A kernel that is kept with those of the package, as of a module `name`."""

    def double(x: float) -> float:
        return 2.0 * x

    double.__module__ = f"weathercoat.{name}"
    return kernel(double)


def is_free(caches: Path) -> bool:
    """Whether nobody has the turn to compile."""
    lock = FolderLock(caches)
    taken = lock.take()
    lock.release(remove=False)
    return taken


def test_the_turn_to_compile_goes_back(caches: Path) -> None:
    assert doubling("well")(1.0) == 2.0
    assert is_free(caches)

    def fail(x: float) -> float:
        return x.no_such_attribute

    fail.__module__ = "weathercoat.ill"
    with pytest.raises(TypingError):
        kernel(fail)(1.0)
    assert is_free(caches)


def test_the_turn_of_a_process_that_was_killed_goes_to_the_next(caches: Path) -> None:
    script = (
        "import sys, time; from pathlib import Path; from weathercoat.lock import FolderLock\n"
        "lock = FolderLock(Path(sys.argv[1])); print(lock.take(), flush=True); time.sleep(600)"
    )
    command = [sys.executable, "-c", script, str(caches)]
    with subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "True\n"
        assert not is_free(caches)
        process.kill()
    assert doubling("killed")(1.0) == 2.0


def test_a_turn_that_does_not_come_is_not_waited_for_without_end(
    caches: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor silently: who watches learns that there is something to wait for."""
    monkeypatch.setattr(weathercoat.compile, "_SECONDS_TO_WAIT", 0.1)
    lock = FolderLock(caches)
    assert lock.take()
    begun: list[bool] = []
    with watch_compiling(lambda: begun.append(True)) as compiling:
        assert doubling("stopped")(1.0) == 2.0
    assert (compiling.kernels, len(begun)) == (1, 1)
    lock.release(remove=False)


def test_a_kernel_that_another_process_compiles_meanwhile_is_taken(
    caches: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As soon as it is there, although that process goes on with others."""
    source = doubling("meanwhile")
    assert source(1.0) == 2.0
    (kept,) = caches.rglob("double-*.kernel")
    content = kept.read_bytes()
    kept.unlink()
    lock = FolderLock(caches)
    assert lock.take()
    monkeypatch.setattr(time, "sleep", lambda seconds: kept.write_bytes(content))
    with watch_compiling(lambda: None) as compiling:
        assert doubling("meanwhile")(1.0) == 2.0
    assert compiling.kernels == 0
    lock.release(remove=False)


def test_kernels_are_kept_where_the_file_system_has_no_locks(
    caches: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(stream: object) -> None:
        raise OSError(errno.ENOLCK, "no locks available")

    monkeypatch.setattr(weathercoat.lock, "_lock", refuse)
    assert doubling("unlocked")(1.0) == 2.0
    assert list(caches.rglob("double-*.kernel"))


def test_a_change_of_an_imported_source_is_noticed(tmp_path: Path) -> None:
    """A kernel is compiled anew when its module or one that it imports changes, and by its content alone."""
    site, caches = tmp_path / "site", tmp_path / "caches"
    shutil.copytree(SOURCES, site / "weathercoat", ignore=shutil.ignore_patterns("__pycache__"))
    places = {"PYTHONPATH": site, "NUMBA_CACHE_DIR": caches}
    assert try_kernel(tmp_path, **places) > 1
    for path in site.rglob("*.py"):
        path.touch()
    assert try_kernel(tmp_path, **places) == 0
    with (site / "weathercoat" / "compile.py").open("a") as stream:
        stream.write("# changed\n")
    assert try_kernel(tmp_path, **places) > 1


def test_kernels_that_check_their_indices_are_kept_apart(tmp_path: Path) -> None:
    """Otherwise a run with checks would take those without from the cache."""
    for checks in ("0", "1"):
        assert try_kernel(tmp_path, NUMBA_CACHE_DIR=tmp_path, NUMBA_BOUNDSCHECK=checks) > 1
        assert try_kernel(tmp_path, NUMBA_CACHE_DIR=tmp_path, NUMBA_BOUNDSCHECK=checks) == 0
    (tmp_path / "beyond.py").write_text(BEYOND)
    for checks, outcome in (("0", "0"), ("1", "IndexError")):
        done = subprocess.run(
            [sys.executable, "beyond.py"],
            env=environment(NUMBA_CACHE_DIR=tmp_path, NUMBA_BOUNDSCHECK=checks),
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.strip() == outcome


@pytest.mark.parametrize("place", ["file", "no home"])
def test_kernels_run_without_a_place_to_keep_them(tmp_path: Path, place: str) -> None:
    """Where the cache folder cannot be made, each process compiles what it needs."""
    (tmp_path / "file").touch()
    changes = {"XDG_CACHE_HOME" if place == "file" else "HOME": tmp_path / "file"}
    assert try_kernel(tmp_path, **changes) > 1
    assert files_below(tmp_path) == ["file"]


def test_nothing_is_written_where_the_package_is_installed(tmp_path: Path) -> None:
    site, home = tmp_path / "site", tmp_path / "home"
    shutil.copytree(SOURCES, site / "weathercoat", ignore=shutil.ignore_patterns("__pycache__"))
    home.mkdir()
    folders = [site, *(path for path in site.rglob("*") if path.is_dir())]
    before = files_below(site)
    for folder in folders:
        folder.chmod(0o555)
    try:
        assert try_kernel(home, PYTHONPATH=site, HOME=home) > 1
        assert try_kernel(home, PYTHONPATH=site, HOME=home) == 0
    finally:
        for folder in folders:
            folder.chmod(0o755)
    assert files_below(site) == before
    assert {path.parts[0] for path in map(Path, files_below(home))} == {".cache"}


@pytest.fixture
def caches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty folder as the place of all modules' kernels."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    folder = cache_folder()
    assert folder is not None
    folder.mkdir(parents=True)
    yield folder


def make_aged(folder: Path, days: float) -> Path:
    folder.mkdir()
    (folder / "perlin-0123456789abcdef.kernel").touch()
    os.utime(folder, (time.time() - days * DAY,) * 2)
    return folder


def test_kernels_that_nobody_uses_go(caches: Path) -> None:
    make_aged(caches / "film.noise-0123456789abcdef", 31)
    kept = [
        make_aged(caches / "film.noise-fedcba9876543210", 29),
        make_aged(caches / "film.noise", 31),
        make_aged(caches / "another tool's", 31),
    ]
    assert remove_unused() == 1
    assert sorted(caches.iterdir()) == sorted(kept)


def test_kernels_in_use_stay(caches: Path) -> None:
    """Use renews the date."""
    given = os.environ["NUMBA_CACHE_DIR"]
    assert try_kernel(caches, NUMBA_CACHE_DIR=given) > 1
    folders = list(caches.iterdir())
    for folder in folders:
        os.utime(folder, (time.time() - 40 * DAY,) * 2)
    assert try_kernel(caches, NUMBA_CACHE_DIR=given) == 0
    assert remove_unused() == 0
    assert sorted(caches.iterdir()) == sorted(folders)


def test_compiling_is_watched() -> None:
    """Each kernel counts once, those that it calls too; `begun` is called before the first and no more."""

    @kernel
    def inner(x: float) -> float:
        return 2.0 * x

    @kernel
    def outer(x: float) -> float:
        return inner(x) + 1.0

    begun: list[bool] = []
    started = time.perf_counter()
    with watch_compiling(lambda: begun.append(True)) as compiling:
        assert outer(1.0) == 3.0
        assert (compiling.kernels, len(begun)) == (2, 1)
        outer(2.0)
        outer(1)
    assert (compiling.kernels, len(begun)) == (4, 1)
    assert 0.0 < compiling.seconds < time.perf_counter() - started
    with watch_compiling(lambda: begun.append(True)) as compiling:
        outer(3.0)
    assert (compiling.kernels, compiling.seconds, len(begun)) == (0, 0.0, 1)


def weathercoat_command(*arguments: object, cwd: Path, cache: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "weathercoat", *map(str, arguments)],
        env=environment(NUMBA_CACHE_DIR=cache),
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


SMALL = [
    *("--set", "remesh.faces=500"),
    *("--set", "ageing.steps=20"),
    *("--set", "snapshots.count=2"),
    *("--set", "output.picture_width=64"),
    *("--set", "output.picture_height=48"),
]


@pytest.mark.long
def test_first_runs_at_once_do_not_trip_each_other(tmp_path: Path) -> None:
    """Two runs compile into one empty place at once: the same bytes, those of a later run that finds them."""
    assert weathercoat_command("sample", "sign", cwd=tmp_path, cache=tmp_path / "other").wait() == 0
    cache = tmp_path / "cache"

    def run(name: str) -> subprocess.Popen[str]:
        return weathercoat_command(
            "run", "standard", "sign.obj", "-o", name, *SMALL, cwd=tmp_path, cache=cache
        )

    compiled: list[int] = []
    for process in [run("a"), run("b")]:
        _, said = process.communicate()
        assert process.returncode == 0, said
        compiled += map(int, re.findall(r"weathercoat: compiled (\d+) kernels", said))
    _, said = run("c").communicate()
    assert "compil" not in said
    assert sum(compiled) == len(list(cache.rglob("*.kernel"))), "each once"
    for other in ("b", "c"):
        assert files_below(tmp_path / "a") == files_below(tmp_path / other)
        for path in (tmp_path / "a").rglob("*.*"):
            if path.name != "timing.json":
                twin = tmp_path / other / path.relative_to(tmp_path / "a")
                assert path.read_bytes() == twin.read_bytes(), path.name
    assert not list(cache.rglob("tmp*")), "half-written files are left"


@pytest.mark.long
def test_nothing_is_left_to_compile_after_the_warm_up(tmp_path: Path) -> None:
    cache = tmp_path / "cache"

    def call(*arguments: object) -> str:
        process = weathercoat_command(*arguments, cwd=tmp_path, cache=cache)
        printed, said = process.communicate()
        assert process.returncode == 0, said
        return printed + said

    assert '"kernels": 0' not in call("warmup", "--json")
    assert '"kernels": 0' in call("warmup", "--json")
    call("sample", "sign")
    call("sample", "gear")
    (tmp_path / "quads.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 2 0\nv 0 1 0\nv 3 0 0\nf 1 2 3 4\nf 2 5 3\n")
    commands: list[list[object]] = [
        ["run", name, "sign.obj", "-o", name, *SMALL]
        for name in ("standard", "literal", "crackle", "curling", "rusting")
    ]
    commands += [
        ["run", "standard", "gear.obj", "-o", "gear", *SMALL, "--set", "remesh=off"],
        ["remesh", "sign.obj", "-o", "remeshed.ply", "--faces", 3000],
        ["inspect", "remeshed.ply", "--self-intersections"],
        ["inspect", "quads.obj"],
        ["render", "standard", "-o", "standard.png"],
    ]
    for arguments in commands:
        assert "compil" not in call(*arguments), arguments
