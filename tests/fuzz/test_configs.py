"""A bounded run of the fuzzer of configs, and that its own reader and validator see what is wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.fuzz import configs, strict_configs
from tests.fuzz.config_mutations import make_seeds, schema_of, valid_value
from tests.fuzz.workers import Verdict
from weathercoat.config.describe import json_schema
from weathercoat.config.schema import Config, parameters

COUNT = 150


def test_damaged_configs_are_refused_clearly_or_valid() -> None:
    outcomes, violations = configs.run(COUNT, seed=30)
    assert [(number, verdict.what) for number, _, verdict in violations] == []
    assert outcomes["accepted config"] > COUNT / 20
    assert outcomes["refused syntax"] > COUNT / 20 and outcomes["refused value"] > COUNT / 20


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_many_damaged_configs(seed: int) -> None:
    _, violations = configs.run(1000, seed)
    assert [(number, verdict.what) for number, _, verdict in violations] == []


def test_the_configs_themselves_are_valid() -> None:
    for data in make_seeds():
        assert configs.judge(configs.Case(data=data)) == Verdict("accepted", "config"), data[:60]


def test_cases_depend_on_seed_and_number_alone() -> None:
    seeds = make_seeds()
    one = [configs.make_case(seeds, 3, number) for number in range(50)]
    assert one == [configs.make_case(make_seeds(), 3, number) for number in range(50)]
    assert one != [configs.make_case(seeds, 4, number) for number in range(50)]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("seed: 1\nseed: 2\n", "given twice"),
        ("seed: !!python/name:os.system x\n", "tag"),
        ("a: &a [*a]\n", "contains itself"),
        ("- 1\n", "no mapping"),
        ("a: 1\n---\nb: 2\n", "no YAML"),
        ("\tseed: 1\n", "no YAML"),
    ],
)
def test_the_strict_reader_refuses(text: str, why: str) -> None:
    with pytest.raises(strict_configs.BrokenError, match=why):
        strict_configs.read(text.encode())


INVALID = """
sead: 1
seed: 1.5
seed: true
seed: '1'
seed: !!str 1
seed: .inf
seed: -1
seed: 9223372036854775808
lift: 3
lift: {sum: plane}
lift: {coefficient: .nan}
rust: {alignment: 1}
output: {formats: []}
output: {formats: [fbx]}
output: {preview: 1}
model: {up: [0, 0]}
appearance: {paint: '#ff000'}
appearance: {paint: [256, 0, 0]}
version: 2
snapshots: {steps: [-1]}
"""


@pytest.mark.parametrize("text", INVALID.split("\n")[1:-1])
def test_the_validator_refuses(text: str) -> None:
    assert strict_configs.flaw(strict_configs.read(text.encode()), json_schema())


def test_every_random_valid_value_is_valid() -> None:
    """By the validator and by the package; bounds that are excluded are not drawn."""
    random, schema = np.random.default_rng(1), json_schema()
    for parameter in parameters():
        part = schema_of(parameter.key)
        for _ in range(30):
            value = valid_value(parameter, random)
            as_json = list(value) if isinstance(value, tuple) else value
            assert strict_configs.flaw(as_json, schema, part) is None, f"{parameter.key}: {value}"
            content: Any = as_json
            for name in reversed(parameter.key.split(".")):
                content = {name: content}
            Config.model_validate(content)
