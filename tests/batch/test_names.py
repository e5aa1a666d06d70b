"""Names of jobs as folders: safe, apart from each other, and clear of what a batch writes."""

from __future__ import annotations

from pathlib import Path, PurePath

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weathercoat.batch.names import (
    PARTIAL,
    STYLES,
    Named,
    check_names,
    found_name,
    model_name,
    safe_path,
)
from weathercoat.batch.record import RECORD
from weathercoat.batch.storage import is_url
from weathercoat.errors import UsageError
from weathercoat.output.folder import safe_name

TEXT = st.text(st.characters() | st.sampled_from("./\\~ -\0"), max_size=12) | st.sampled_from(
    [RECORD, "a" + PARTIAL, "..", "s3://b/c.obj", "CON", "a" * 300 + PARTIAL]
)


def is_safe(name: str) -> bool:
    """Whether a name leads to a folder below that of the batch that nothing else is written to."""
    parts = name.split("/")
    return (
        parts[0].casefold() != RECORD
        and all(part == safe_name(part) for part in parts)
        and not any(part.casefold().endswith(PARTIAL) or part.startswith(".") for part in parts)
    )


@given(TEXT, st.sampled_from(STYLES))
def test_names_are_safe(model: str, style: str) -> None:
    assert is_safe(model_name(model, style))


@given(st.lists(TEXT, max_size=4))
def test_given_names_are_safe_and_stay(parts: list[str]) -> None:
    name = safe_path(parts)
    assert is_safe(name)
    assert safe_path(name.split("/")) == name


@given(st.lists(st.sampled_from("abc"), min_size=1, max_size=4))
def test_a_folder_and_what_is_found_in_it(parts: list[str]) -> None:
    found = PurePath(*parts).with_suffix(".obj")
    assert found_name("m", found) == "/".join(parts)
    assert found_name("../m", found, "path") == model_name(f"../m/{found}", "path") == f"m/{found}"


def test_urls() -> None:
    assert all(map(is_url, ["s3://b/c.obj", "file:///c.obj", "zip+x://c"]))
    assert not any(map(is_url, ["c.obj", "a/b:/c.obj", "://c", "3d://c"]))


def clash(names: list[str]) -> bool:
    try:
        check_names(Named(name, f"{i}.obj", f"{i}") for i, name in enumerate(names))
    except UsageError:
        return True
    return False


@given(st.lists(st.lists(st.sampled_from("abA"), min_size=1, max_size=3).map("/".join), max_size=6))
def test_folders_are_apart(names: list[str]) -> None:
    """By the definition: no folder is another one, or in another one, even where case does not count."""
    paths = [PurePath(name.lower()) for name in names]
    pairs = [(paths[i], paths[j]) for i in range(len(paths)) for j in range(len(paths)) if i != j]
    assert clash(names) == any(one.is_relative_to(other) for one, other in pairs)


@pytest.mark.parametrize("name", ["batch.json", "Batch.JSON", "x.partial", "a/x.PARTIAL"])
def test_what_a_batch_writes_itself(name: str, tmp_path: Path) -> None:
    assert safe_path(name.split("/")) != name
