"""Folders and files that appear whole or not at all, and runs that read back."""

from __future__ import annotations

import errno
import os
import stat
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.output.snapshots import make_snapshot
from weathercoat.errors import AccessError, CorruptError, FormatError, OutputError, OutputExistsError
from weathercoat.output.folder import RunFolder, read_run, safe_name, snapshot_stem, whole_file
from weathercoat.output.report import write_json
from weathercoat.output.snapshots import write_snapshot_ply


def write_run(target: Path, content: str = "{}", *, overwrite: bool = False) -> None:
    with RunFolder(target, overwrite=overwrite) as folder:
        (folder / "run.json").write_text(content)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_the_folder_appears_when_it_is_whole(tmp_path: Path) -> None:
    with RunFolder(tmp_path / "out") as folder:
        assert folder.parent == tmp_path
        (folder / "run.json").write_text("{}")
        assert not (tmp_path / "out").exists()
    assert names(tmp_path) == ["out"] and names(tmp_path / "out") == ["run.json"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
def test_nothing_stays_after_an_exception(tmp_path: Path, error: type[BaseException]) -> None:
    with pytest.raises(error), RunFolder(tmp_path / "out") as folder:
        (folder / "run.json").write_text("{}")
        raise error
    assert names(tmp_path) == []


def test_an_existing_folder_is_refused_before_any_work(tmp_path: Path) -> None:
    write_run(tmp_path / "out")
    with pytest.raises(OutputExistsError) as caught:
        RunFolder(tmp_path / "out")
    assert caught.value.exit_code == 7 and "--overwrite" in caught.value.line()


def test_overwriting_swaps_only_after_success(tmp_path: Path) -> None:
    target = tmp_path / "out"
    write_run(target, "1")
    (target / "more.txt").write_text("old")
    with pytest.raises(ValueError), RunFolder(target, overwrite=True) as folder:
        (folder / "run.json").write_text("2")
        raise ValueError
    assert (target / "run.json").read_text() == "1"
    write_run(target, "3", overwrite=True)
    assert (target / "run.json").read_text() == "3"
    assert names(tmp_path) == ["out"] and names(target) == ["run.json"]


def test_a_folder_that_is_no_run_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.tex").write_text("years of work")
    with pytest.raises(OutputError, match=r"run\.json"):
        RunFolder(tmp_path / "thesis", overwrite=True)


def test_files_that_appear_meanwhile_are_not_overwritten(tmp_path: Path) -> None:
    target = tmp_path / "out"
    with pytest.raises(OutputExistsError), RunFolder(target):
        target.mkdir()
        (target / "run.json").write_text("another's")
    assert (target / "run.json").read_text() == "another's" and names(tmp_path) == ["out"]


def test_a_file_as_target_is_refused_even_with_overwrite(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(OutputError, match="is a file"):
        RunFolder(tmp_path / "out", overwrite=True)


@pytest.mark.parametrize("target", ["none/out", "file/out", "a\0b", "x" * 256])
def test_impossible_targets_are_one_line(tmp_path: Path, target: str) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError) as caught:
        write_run(tmp_path / target)
    assert "\n" not in caught.value.line() and caught.value.exit_code == 7


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_parent_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(OutputError):
            RunFolder(tmp_path / "out")
    finally:
        tmp_path.chmod(0o700)


def test_a_full_disk_is_an_output_error(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="No space left"), RunFolder(tmp_path / "out"):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert names(tmp_path) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_file_on_a_full_device_is_an_output_error() -> None:
    with pytest.raises(OutputError, match="No space left"), whole_file("/dev/full") as stream:
        stream.write(b"x" * 1_000_000)


def test_errors_of_other_files_pass_through(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), RunFolder(tmp_path / "out"):
        (tmp_path / "none").read_bytes()


@pytest.mark.skipif(sys.platform == "win32", reason="modes are those of POSIX")
def test_the_folder_has_the_mode_of_any_new_folder(tmp_path: Path) -> None:
    write_run(tmp_path / "out")
    (tmp_path / "plain").mkdir()
    assert stat.S_IMODE((tmp_path / "out").stat().st_mode) == stat.S_IMODE(
        (tmp_path / "plain").stat().st_mode
    )


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    write_run(tmp_path / "real", "1")
    (tmp_path / "link").symlink_to("real")
    write_run(tmp_path / "link", "2", overwrite=True)
    assert (tmp_path / "link").is_symlink() and (tmp_path / "real" / "run.json").read_text() == "2"


def test_a_whole_file_appears_at_the_end_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    with pytest.raises(ValueError), whole_file(path) as stream:
        stream.write(b"half")
        raise ValueError
    assert names(tmp_path) == []
    with whole_file(path) as stream:
        stream.write(b"whole")
    with pytest.raises(OutputExistsError), whole_file(path):
        pass
    with whole_file(path, overwrite=True) as stream:
        stream.write(b"new")
    assert path.read_bytes() == b"new" and names(tmp_path) == ["a.obj"]


def test_a_folder_is_no_target_for_a_file(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="is a folder"), whole_file(tmp_path, overwrite=True):
        pass


@given(st.text(), st.sampled_from(["", ".glb", "-aged"]))
def test_safe_names_fit_in_any_folder(text: str, suffix: str) -> None:
    name = safe_name(text, suffix)
    assert name.endswith(suffix) and 0 < len(name.encode()) <= 255
    assert not set(name) & set('/\\:*?"<>|\0\n\r\t') and name not in (".", "..")
    assert not name.startswith((".", "-")) and safe_name(text, suffix) == name


def test_safe_names_keep_what_can_be_kept() -> None:
    assert safe_name("Türschild 3.alt") == "Türschild 3.alt"
    assert safe_name("看板") == "看板"
    assert safe_name("a\udc80/b") == "a__b"
    assert safe_name("con") != "con"
    long = [safe_name("é" * 300 + end, ".ply") for end in "ab"]
    assert long[0] != long[1]


def test_runs_read_back_in_order_of_time(tmp_path: Path) -> None:
    with RunFolder(tmp_path / "out") as folder:
        (folder / "snapshots").mkdir()
        for step in (1000, 20):
            write_snapshot_ply(folder / "snapshots", make_snapshot(step=step), snapshot_stem(step, 1000))
        write_json(folder / "run.json", {"seed": 7})
    report, snapshots = read_run(tmp_path / "out")
    assert report == {"seed": 7} and [snapshot.step for snapshot in snapshots] == [20, 1000]
    np.testing.assert_array_equal(snapshots[0].film_vertices, make_snapshot().film_vertices)


def test_what_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(AccessError):
        read_run(tmp_path / "none")
    with pytest.raises(AccessError):
        read_run(tmp_path)
    (tmp_path / "run.json").write_text("{")
    with pytest.raises(CorruptError):
        read_run(tmp_path)
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(FormatError):
        read_run(tmp_path)
