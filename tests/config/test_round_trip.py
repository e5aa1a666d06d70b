"""Valid configs survive being written and read, and every bound is where the schema says."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from tests.fuzz.config_mutations import schema_of, valid_value
from weathercoat.config.describe import example_yaml, resolved_yaml
from weathercoat.config.load import Override, load_config
from weathercoat.config.presets import preset_names
from weathercoat.config.schema import Config, parameters
from weathercoat.errors import ConfigError

NUMBERS = [p.key for p in parameters() if schema_of(p.key).get("type") in ("number", "integer")]


def nested(key: str, value: Any) -> dict[str, Any]:
    for name in reversed(key.split(".")):
        value = {name: value}
    return value


@given(st.sampled_from(preset_names()), st.integers(0, 10**6), st.sampled_from([0.1, 0.5, 1.0]))
def test_what_is_shown_reads_back(preset: str, seed: int, often: float) -> None:
    """The resolved values and the commented example of random configs at their bounds."""
    random = np.random.default_rng(seed)
    drawn = {
        parameter.key: valid_value(parameter, random) for parameter in parameters() if random.random() < often
    }
    values = {key: value for key, value in drawn.items() if value is not None}
    try:
        loaded = load_config(preset, [Override(key, value) for key, value in values.items()])
    except ConfigError as error:
        assert {problem.what.partition(" ")[0] for problem in error.problems} <= {"must", "give", "auto"}
        return  # values that do not go together
    path = Path("again.yaml")
    for text in (resolved_yaml(loaded), example_yaml(loaded.config)):
        path.write_text(text, encoding="utf-8")
        assert load_config(path).config == loaded.config


@pytest.fixture(autouse=True, scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Any:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("configs"))
        yield


@pytest.mark.parametrize(
    "key", [key for key in NUMBERS if "enum" not in schema_of(key) and "const" not in schema_of(key)]
)
def test_bounds_are_where_the_schema_says(key: str) -> None:
    part = schema_of(key)
    is_whole = part["type"] == "integer"
    for side, away in (("imum", 1), ("imum", -1)):
        name = ("max" if away > 0 else "min") + side
        is_open = f"exclusive{name.capitalize()}" in part
        bound = part[f"exclusive{name.capitalize()}" if is_open else name]
        beyond = bound + away if is_whole else math.nextafter(bound, away * math.inf)
        inside = bound - away if is_whole else math.nextafter(bound, -away * math.inf)
        Config.model_validate(nested(key, inside if is_open else bound))
        with pytest.raises(ValidationError):
            Config.model_validate(nested(key, bound if is_open else beyond))
