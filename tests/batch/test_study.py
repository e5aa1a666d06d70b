"""Members of parameter studies: their names, their values, and what these hang on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from weathercoat.batch.job import Job
from weathercoat.batch.sources import collect_jobs
from weathercoat.batch.study import hashed, parse_study
from weathercoat.config.load import load_config
from weathercoat.errors import ConfigError, LimitError, UsageError


def radius(job: Job) -> float:
    return job.loaded.config.curl.radius


def values_of(law: str, count: int = 2000) -> list[Any]:
    """Values that a law draws for the variants of one job."""
    study = parse_study(vary=[f"k={law}"], variants=count)
    return [member.overrides[-1].value for member in study.drawn(1, "oak")]


def test_a_matrix_is_a_product_in_the_order_of_its_options() -> None:
    jobs = collect_jobs(["m/oak.obj"], matrix=["curl.radius=0.1,2e-1", "config=standard,rusting"])
    assert [job.name for job in jobs] == [
        "oak/curl.radius_0.1+config_standard",
        "oak/curl.radius_0.1+config_rusting",
        "oak/curl.radius_2e-1+config_standard",
        "oak/curl.radius_2e-1+config_rusting",
    ]
    assert [(radius(job), job.loaded.source) for job in jobs] == [
        (0.1, "standard"), (0.1, "rusting"), (0.2, "standard"), (0.2, "rusting"),
    ]  # fmt: skip
    assert {job.loaded.config.seed for job in jobs} == {1}


def test_members_of_a_matrix_have_the_config_of_a_run() -> None:
    one, other = collect_jobs(["oak.obj"], matrix=["seed=3,4"])
    assert one.loaded.config == load_config("standard", ["seed=3"]).config
    assert other.loaded.config == load_config("standard", ["seed=4"]).config
    assert (one.name, other.name) == ("oak/seed_3", "oak/seed_4")


@pytest.mark.parametrize(
    "text, names, values",
    [
        ("k=[1,2],[3, 4]", ["k_1_2", "k_3_4"], [[1, 2], [3, 4]]),
        ("k=a,\"b,c\",'d'", ["k_a", "k_b_c", "k_d"], ["a", "b,c", "d"]),
        ("k=off, on", ["k_off", "k_on"], ["off", "on"]),
        ("k=#ff0000,#00ff00", ["k_ff0000", "k_00ff00"], ["#ff0000", "#00ff00"]),
        ("k=it's,b", ["k_it_s", "k_b"], ["it's", "b"]),
        ("k=-1,+1", ["k_-1", "k_+1"], [-1, 1]),
        ('k=["]",","],x', ["k____", "k_x"], [["]", ","], "x"]),
    ],
)
def test_values_between_commas(text: str, names: list[str], values: list[Any]) -> None:
    members = parse_study(matrix=[text]).combinations
    assert [member.overrides[0].value for member in members] == values
    assert [member.suffix for member in members] == names


def test_variants_have_names_and_seeds_of_their_own() -> None:
    jobs = collect_jobs(["oak.obj", "elm.obj"], variants=3)
    names = [f"{model}/v{i:04d}" for model in ("oak", "elm") for i in range(3)]
    assert [job.name for job in jobs] == names
    assert len({job.loaded.config.seed for job in jobs}) == 6
    assert all(job.loaded.config.seed < 2**53 for job in jobs)
    assert jobs[0].loaded.origins["seed"] == "--variants"
    alone, other = (
        collect_jobs(["oak.obj"], variants=1),
        collect_jobs(["oak.obj"], variants=1, overrides=["seed=2"]),
    )
    assert alone == jobs[:1]
    assert other[0].loaded.config.seed != alone[0].loaded.config.seed


def test_a_known_draw() -> None:
    """Values are part of the interface: a study is repeated years later with the same ones."""
    assert hashed(1, "oak", "curl.radius", 0) == 210897683001986493826879192938930155183
    (job,) = collect_jobs(["oak.obj"], vary=["curl.radius=uniform(0.1,0.2)"], variants=1)
    assert (radius(job), job.loaded.config.seed) == (0.161977259, 3843931459437945)


def test_a_matrix_of_variants() -> None:
    jobs = collect_jobs(
        ["oak.obj"], matrix=["config=standard,rusting"], vary=["curl.radius=log(0.01,1)"], variants=2
    )
    assert [job.name for job in jobs] == [
        f"oak/config_{name}/v{i:04d}" for name in ("standard", "rusting") for i in range(2)
    ]
    assert len({radius(job) for job in jobs}) == 4


def test_seed_and_config_can_be_drawn() -> None:
    jobs = collect_jobs(
        ["oak.obj"], vary=["seed=integer(1,3)", "config=choice(standard,rusting)"], variants=20
    )
    assert {job.loaded.config.seed for job in jobs} == {1, 2, 3}
    assert {job.loaded.source for job in jobs} == {"standard", "rusting"}


KEYS = ["curl.radius=uniform(0.1,0.9)", "dust.rate=log(0.01,0.1)", "rust.bare_rate=normal(0.5,0.01)"]


@settings(max_examples=30)
@given(
    st.lists(st.sampled_from(["oak", "elm", "ash", "fir"]), min_size=1, unique=True),
    st.lists(st.sampled_from(KEYS), unique=True),
    st.integers(1, 4),
    st.integers(1, 4),
)
def test_a_value_hangs_on_its_own_job_alone(models: list[str], keys: list[str], few: int, more: int) -> None:
    """Neither other models, other keys, the order of either, nor more variants change it."""

    def drawn(models: Sequence[str], keys: Sequence[str], variants: int) -> dict[str, dict[str, Any]]:
        jobs = collect_jobs([f"{model}.obj" for model in models], vary=keys, variants=variants)
        return {
            job.name: {"seed": job.loaded.config.seed}
            | {key: value(job) for key, value in READ.items() if any(text.startswith(key) for text in keys)}
            for job in jobs
        }

    whole = drawn(["fir", "oak", "elm", "ash"], KEYS, few + more)
    for name, values in drawn(models, keys, few).items():
        assert values.items() <= whole[name].items()


READ = {
    "curl.radius": radius,
    "dust.rate": lambda job: job.loaded.config.dust.rate,
    "rust.bare_rate": lambda job: job.loaded.config.rust.bare_rate,
}


@given(st.integers(0, 2**63 - 1), st.text(max_size=5), st.text(max_size=5), st.integers(0, 10**6))
def test_hashes_differ_where_anything_does(seed: int, job: str, key: str, number: int) -> None:
    others = [(seed + 1, job, key, number), (seed, job + "v", key, number), (seed, job, key + "x", number)]
    ours = hashed(seed, job, key, number)
    assert 0 <= ours < 2**128
    assert ours not in [
        hashed(*other) for other in [*others, (seed, job, key, number + 1), (seed, key + "-", job, number)]
    ]


def test_distributions() -> None:
    """Means and spreads against those of the law, at five standard errors of 2,000 draws."""
    count, bound = 2000, 5.0 / math.sqrt(2000)
    uniform, log = np.array(values_of("uniform(2,4)", count)), np.log(values_of("log(0.01,1)", count))
    normal = np.array(values_of("normal(3,0.5)", count))
    assert (
        abs(uniform.mean() - 3.0) < bound * uniform.std() and abs(uniform.std() - 2 / math.sqrt(12)) < bound
    )
    assert (
        abs(log.mean() - math.log(0.1)) < bound * log.std() and log.max() <= 0 and np.exp(log.min()) >= 0.01
    )
    assert abs(normal.mean() - 3.0) < bound * 0.5 and abs(normal.std() - 0.5) < bound * 0.5
    for law, chances in (("integer(-1,2)", [-1, 0, 1, 2]), ("choice(a,[1,2],off)", ["a", [1, 2], "off"])):
        values = values_of(law, count)
        share = 1.0 / len(chances)
        assert all(
            abs(values.count(x) / count - share) < bound * math.sqrt(share * (1 - share)) for x in chances
        )
        assert all(value in chances for value in values)


@given(st.floats(-1e6, 1e6), st.floats(0, 1e3))
def test_numbers_stay_within_their_bounds(low: float, width: float) -> None:
    values = values_of(f"uniform({low!r},{low + width!r})", 20)
    assert all(low <= value <= low + width for value in values)


def test_large_whole_numbers_are_exact() -> None:
    values = values_of(f"integer({2**62},{2**62 + 10})", 200)
    assert {value - 2**62 for value in values} == set(range(11))


@pytest.mark.parametrize(
    "options",
    [
        {"matrix": ["curl.radius"]},
        {"matrix": ["=1"]},
        {"matrix": ["k="]},
        {"matrix": ["k=1,,2"]},
        {"matrix": ["k=[1,2"]},
        {"matrix": ["k=1]"]},
        {"matrix": ["k=(1]"]},
        {"matrix": ["k=1,1"]},
        {"matrix": ["k=a/b,a_b"]},
        {"matrix": ["k=1", "k=2"]},
        {"matrix": ["k..x=1"]},
        {"vary": ["k=uniform(1,2)"]},
        {"vary": ["k=uniform(1,2)"], "variants": 0},
        {"vary": ["k=uniform(1,2)", "k=log(1,2)"], "variants": 1},
        {"vary": ["k=uniform(1,2)"], "matrix": ["k=1"], "variants": 1},
        {"vary": ["k=unifrom(1,2)"], "variants": 1},
        {"vary": ["k=0.5"], "variants": 1},
        {"vary": ["k=uniform(1)"], "variants": 1},
        {"vary": ["k=uniform(2,1)"], "variants": 1},
        {"vary": ["k=uniform(1,x)"], "variants": 1},
        {"vary": ["k=uniform(true,2)"], "variants": 1},
        {"vary": ["k=uniform(1,.inf)"], "variants": 1},
        {"vary": ["k=log(0,1)"], "variants": 1},
        {"vary": ["k=normal(0,-1)"], "variants": 1},
        {"vary": ["k=integer(1.5,2)"], "variants": 1},
        {"vary": ["k=choice()"], "variants": 1},
    ],
)
def test_a_study_that_is_none(options: dict[str, Any]) -> None:
    with pytest.raises(UsageError):
        parse_study(**options)


def test_a_study_that_is_too_large() -> None:
    with pytest.raises(LimitError):
        parse_study(matrix=[f"k{i}=" + ",".join(map(str, range(100))) for i in range(9)])


def test_values_that_the_config_refuses_name_a_job() -> None:
    with pytest.raises(ConfigError) as caught:
        collect_jobs(["oak.obj"], vary=["curl.radius=uniform(-2,-1)", "curll=choice(1)"], variants=5)
    radius, unknown = sorted(map(str, caught.value.problems))
    assert radius.startswith("--vary: curl.radius: must be at least 1e-05, not -1.")
    assert radius.endswith("; in the job oak/v0000 and 4 more")
    assert "curll: unknown key; did you mean curl" in unknown
