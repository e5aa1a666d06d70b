"""From arguments to jobs: what is found where, what it is called, and how it is loaded."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from weathercoat.batch import loading
from weathercoat.batch.job import Job
from weathercoat.batch.sources import collect_jobs
from weathercoat.config.load import ConfigLoader, LoadedConfig, Override, load_config
from weathercoat.errors import ConfigError, LimitError, OutputExistsError, UsageError


@pytest.fixture
def lay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Lay empty files below a working directory of its own."""
    monkeypatch.chdir(tmp_path)

    def lay_files(*paths: str) -> None:
        for path in paths:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            Path(path).touch()

    return lay_files


def named(arguments: Sequence[str], **options: Any) -> dict[str, str]:
    """Names of jobs and their models, in order."""
    return {job.name: job.asset for job in collect_jobs(arguments, **options)}


def test_files_are_named_by_their_stems(lay: Callable[..., None]) -> None:
    lay("models/chair.obj")
    assert named(["models/chair.obj", "missing.ply", "a b/Größe!.tar.stl"]) == {
        "chair": "models/chair.obj",
        "missing": "missing.ply",
        "Größe_.tar": "a b/Größe!.tar.stl",
    }


def test_names_by_path() -> None:
    assert named(["../models/chair.obj", "/srv/./chair.obj", "s3://bucket/chair.obj"], names="path") == {
        "models/chair.obj": "../models/chair.obj",
        "srv/chair.obj": "/srv/./chair.obj",
        "bucket/chair.obj": "s3://bucket/chair.obj",
    }
    with pytest.raises(UsageError, match="not by size"):
        collect_jobs(["a.obj"], names="size")


def test_urls_are_taken_as_they_are() -> None:
    assert named(
        ["s3://bucket/parts/seat.glb?version=1", "file:///a/[b]/leg.ply", "zip://arm.obj::s3://b/c"]
    ) == {
        "seat": "s3://bucket/parts/seat.glb?version=1",
        "leg": "file:///a/[b]/leg.ply",
        "arm": "zip://arm.obj::s3://b/c",
    }


def test_a_folder_holds_models_at_any_depth(lay: Callable[..., None]) -> None:
    lay("m/chairs/oak.obj", "m/chairs/oak.mtl", "m/ash.PLY", "m/.hidden.obj", "m/.git/x.obj", "m/notes.txt")
    expected = {"ash": "m/ash.PLY", "chairs/oak": "m/chairs/oak.obj"}
    assert named(["m"]) == named(["m/"]) == named(["m/**"]) == expected
    assert list(named(["m"], names="path")) == ["m/ash.PLY", "m/chairs/oak.obj"]
    assert list(named(["."])) == ["m/ash", "m/chairs/oak"]


def test_results_are_no_models(lay: Callable[..., None]) -> None:
    lay(
        "m/oak.ply",
        "m/run/run.json", "m/run/snapshots/step_0001.ply",
        "m/batch/batch.json", "m/batch/oak/step.ply",
        "m/elm.partial/snapshots/step_0001.ply",
        "m/out/elm.ply",
    )  # fmt: skip
    expected = {"oak": "m/oak.ply"}
    assert named(["m"], out=Path("m/out")) == named(["m/**/*.ply"], out=Path("m/out")) == expected
    assert list(named(["m"])) == ["oak", "out/elm"]
    assert named(["m/run/snapshots/step_0001.ply"]) == {"step_0001": "m/run/snapshots/step_0001.ply"}


def test_globs(lay: Callable[..., None]) -> None:
    lay("m/chairs/oak.obj", "m/chairs/elm.dat2", "m/tables/oak.obj", "m/ash.obj", "m/odd[1].obj")
    assert list(named(["m/*/*.obj"])) == ["chairs/oak", "tables/oak"]
    assert list(named(["m/chairs/*"])) == ["oak"]
    assert list(named(["m/chairs/*.dat2"])) == ["elm"]
    assert named(["m/odd[1].obj"]) == {"odd_1_": "m/odd[1].obj"}
    assert named([str(Path("m").resolve()) + "/a*.obj"]) == {"ash": str(Path("m/ash.obj").resolve())}


def test_a_glob_takes_manifests_as_the_shell_would(lay: Callable[..., None]) -> None:
    lay("m/oak.obj")
    Path("one.csv").write_text("model\nm/oak.obj\n")
    Path("two.csv").write_text("model\nm/elm.obj\n")
    assert named(["*.csv"]) == {"oak": "m/oak.obj", "elm": "m/elm.obj"}


@pytest.mark.parametrize("argument", ["empty", "m/*.obj", "m/**/*.stl", ""])
def test_what_names_nothing_is_refused(lay: Callable[..., None], argument: str) -> None:
    lay("empty/notes.txt", "m/oak.ply")
    with pytest.raises(UsageError):
        collect_jobs(["m", argument])


def test_a_list_on_standard_input() -> None:
    text = b"\xef\xbb\xbf# chairs\nm/oak.obj\r\n\n  \nm/*.obj\n #end\nm/jobs.yaml"
    assert named(["-"], stdin=io.BytesIO(text)) == {
        "oak": "m/oak.obj",
        "_": "m/*.obj",
        "jobs": "m/jobs.yaml",
    }
    exact = b"#1.obj\0two\nlines.obj\0\xff.obj\0"
    listed = collect_jobs(["-"], stdin=io.BytesIO(exact), null_separated=True)
    assert [job.asset for job in listed] == ["#1.obj", "two\nlines.obj", "\udcff.obj"]
    assert [job.name for job in listed] == ["_1", "two_lines", "_"]


@pytest.mark.parametrize("arguments, data", [(["-"], b"\n# none\n"), (["-", "-"], b"a.obj\n"), (["-"], None)])
def test_standard_input_that_gives_nothing(arguments: list[str], data: bytes | None) -> None:
    with pytest.raises(UsageError):
        collect_jobs(arguments, stdin=None if data is None else io.BytesIO(data))


def test_nul_without_a_list() -> None:
    with pytest.raises(UsageError, match="-0 is about"):
        collect_jobs(["oak.obj"], null_separated=True)


def test_two_jobs_with_one_name_are_refused() -> None:
    with pytest.raises(UsageError, match=r"oak \(a/oak.obj\) and Oak \(b/Oak.ply\)") as caught:
        collect_jobs(["a/oak.obj", "b/Oak.ply"])
    assert "--names path" in caught.value.remedy
    assert len(named(["a/oak.obj", "b/Oak.ply"], names="path")) == 2
    with pytest.raises(UsageError, match=r"a/oak\.obj is asked for twice"):
        collect_jobs(["a/oak.obj", "a/oak.obj"])


def test_no_job_lies_within_the_folder_of_another(lay: Callable[..., None]) -> None:
    lay("m/Oak.obj", "m/oak/leg.obj")
    with pytest.raises(UsageError, match=r"oak/leg \(m/oak/leg.obj\) would lie within those of Oak"):
        collect_jobs(["m"])


def test_names_stay_clear_of_what_a_batch_writes() -> None:
    assert list(named(["a/batch.json.obj", "oak.Partial.obj", "oak.obj", "CON.obj"])) == [
        "batch_json",
        "oak_partial",
        "oak",
        "_CON",
    ]


def test_results_of_other_batches_are_not_built_upon(lay: Callable[..., None]) -> None:
    """`oak` would take `oak/v0000` along when it is replaced."""
    lay("out/oak/run.json")
    for study in ({"variants": 1}, {"matrix": ["seed=1"]}):
        with pytest.raises(OutputExistsError, match="result of a job oak"):
            collect_jobs(["elm.obj", "oak.obj"], out=Path("out"), **study)
    collect_jobs(["elm.obj", "oak.obj"], out=Path("out"))
    collect_jobs(["elm.obj"], out=Path("out"), variants=1)


def test_a_config_is_loaded_once(monkeypatch: pytest.MonkeyPatch) -> None:
    loads = []

    class Counting(ConfigLoader):
        def load(self, *arguments: Any) -> LoadedConfig:
            loads.append(arguments)
            return super().load(*arguments)

    monkeypatch.setattr(loading, "ConfigLoader", Counting)
    jobs = collect_jobs([f"{i}.obj" for i in range(200)], overrides=["curl.radius=0.2"])
    assert len(loads) == 1
    assert len({id(job.loaded) for job in jobs}) == 1


def test_a_job_alone_has_the_config_of_a_run() -> None:
    overrides = [Override("seed", 7, "--seed"), "quality=auto", "scene.distance=3"]
    (job,) = collect_jobs(["oak.obj"], config="rusting", overrides=overrides)
    assert job == Job("oak", "oak.obj", load_config("rusting", overrides))


def test_problems_of_configs() -> None:
    with pytest.raises(ConfigError) as caught:
        collect_jobs(["oak.obj", "elm.obj"], overrides=["curl.radius=-1", "curll.radius=1"])
    problems = [str(problem) for problem in caught.value.problems]
    assert len(problems) == 2 and not any("job" in problem for problem in problems)
    with pytest.raises(ConfigError) as caught:
        collect_jobs(["oak.obj", "elm.obj"], matrix=["curl.radius=0.1,-1,-2"])
    (problem,) = map(str, caught.value.problems)
    assert problem.startswith("--matrix: curl.radius: must be at least")
    assert problem.endswith("; in the job oak/curl.radius_-1 and 3 more")


def test_too_many_jobs_are_refused_before_any_work() -> None:
    with pytest.raises(LimitError):
        collect_jobs(["oak.obj"], variants=10**9)


STEMS = st.lists(
    st.text("abcAB ._-0", min_size=1, max_size=4).filter(lambda text: text.strip(" .-")),
    min_size=1, max_size=5, unique_by=lambda text: text.strip(" .-").casefold(),
)  # fmt: skip


@settings(max_examples=30)
@given(STEMS, st.randoms(use_true_random=False))
def test_a_job_is_the_same_whatever_else_is_there(stems: list[str], random: Any) -> None:
    """Same name, seed and drawn values beside other models and in another order."""
    models = [f"m/{stem}.obj" for stem in stems]
    study: dict[str, Any] = {
        "vary": ["curl.radius=log(0.01,1)"],
        "variants": 2,
        "matrix": ["dust.rate=0.1,0.2"],
    }
    alone = [job for model in models for job in collect_jobs([model], **study)]
    random.shuffle(models)
    together = collect_jobs(models, **study)
    assert sorted(alone, key=lambda job: job.name) == sorted(together, key=lambda job: job.name)


def test_folders_pass_over_extensions_that_mostly_belong_to_other_things(tmp_path: Path) -> None:
    for name in ("a.obj", "readme.xml", "values.dat"):
        (tmp_path / name).touch()
    assert [job.name for job in collect_jobs([str(tmp_path)])] == ["a"]
    assert [job.name for job in collect_jobs([str(tmp_path / "values.dat")])] == ["values"]
