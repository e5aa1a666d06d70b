"""What is rendered from the schema loads back, and the shipped files follow it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from weathercoat.config.describe import example_yaml, json_schema, reference_markdown, resolved_yaml
from weathercoat.config.load import load_config
from weathercoat.config.presets import preset_names, preset_path, preset_purpose
from weathercoat.config.schema import Config, parameters

SHIPPED = {"crackle", "curling", "literal", "rusting", "standard"}


def reload(tmp_path: Path, text: str) -> Config:
    file = tmp_path / "again.yaml"
    file.write_text(text, encoding="utf-8")
    return load_config(file).config


def test_the_standard_config_is_the_commented_example() -> None:
    assert preset_path("standard").read_text(encoding="utf-8") == example_yaml()
    assert load_config("standard").config == Config()


def test_the_example_has_every_key_with_its_meaning() -> None:
    text = example_yaml()
    for parameter in parameters():
        assert f"{parameter.key.rpartition('.')[2]}: " in text
    assert text.count("\n  # ") >= len(list(parameters())) - 5


@pytest.mark.parametrize("name", sorted(SHIPPED))
def test_resolved_values_and_example_load_back(name: str, tmp_path: Path) -> None:
    loaded = load_config(name)
    assert reload(tmp_path, resolved_yaml(loaded)) == loaded.config
    assert reload(tmp_path, example_yaml(loaded.config)) == loaded.config


def test_awkward_values_load_back(tmp_path: Path) -> None:
    names = '["a b", "off", "null", "1", "caf\\u00e9", "#x", "*", "true", "body", "\\"q\\""]'
    overrides = [
        "remesh=off",
        "snapshots.steps=[1, 2]",
        f"paint.only={names}",
        "model.up=[0, 0, 1]",
        "curl.radius=1e-5",
    ]
    loaded = load_config("standard", overrides)
    assert reload(tmp_path, resolved_yaml(loaded)) == loaded.config
    assert reload(tmp_path, example_yaml(loaded.config)) == loaded.config


def test_resolved_values_name_their_origins(tmp_path: Path) -> None:
    file = tmp_path / "c.yaml"
    file.write_text("preset: literal\nadhesion:\n  amplitude: 0.25\n")
    lines = resolved_yaml(load_config(file, ["seed=3"])).splitlines()
    assert any(line.startswith("seed: 3 ") and line.endswith("# --set") for line in lines)
    assert any(line.startswith("  amplitude: 0.25 ") and line.endswith("c.yaml:3") for line in lines)
    assert any(line.startswith("  rounds: one ") and "# preset literal:" in line for line in lines)
    assert any(line.startswith("  octaves: ") and line.endswith("# default") for line in lines)


def test_shipped_configs_say_what_they_are_for() -> None:
    assert set(preset_names()) >= SHIPPED
    for name in preset_names():
        assert len(preset_purpose(name)) > 20, name


def test_shipped_configs_differ() -> None:
    names = set(preset_names()) - {"c3"}  # which other environments are relative to
    configs = {name: load_config(name).config for name in names}
    assert len({json.dumps(config.as_dict()) for config in configs.values()}) == len(configs)


def test_the_reference_has_every_key_and_symbol() -> None:
    text = reference_markdown()
    for parameter in parameters():
        assert f"| `{parameter.key}` |" in text
        if parameter.symbol:
            assert f"| {parameter.symbol} | `{parameter.key}` |" in text


def keys_of(schema: dict[str, Any], node: dict[str, Any], prefix: str = "") -> set[str]:
    """Dotted keys that a schema accepts, following its references."""
    found: set[str] = set()
    for key, entry in node["properties"].items():
        reference = entry.get("$ref") or next(
            (o["$ref"] for o in entry.get("oneOf", ()) if "$ref" in o), None
        )
        if reference is None:
            found.add(prefix + key)
        else:
            found |= keys_of(schema, schema["$defs"][reference.rpartition("/")[2]], f"{prefix}{key}.")
    return found


def test_the_json_schema_is_closed_and_complete() -> None:
    schema = json.loads(json.dumps(json_schema(), allow_nan=False))
    assert schema["$schema"].startswith("https://json-schema.org/draft/2020-12")
    assert keys_of(schema, schema) == {parameter.key for parameter in parameters()}
    assert all(part["additionalProperties"] is False for part in (schema, *schema["$defs"].values()))
    assert "off" in json.dumps(schema["properties"]["remesh"])
    threshold = schema["$defs"]["Fracture"]["properties"]["direction_threshold"]
    assert (threshold["exclusiveMinimum"], threshold["exclusiveMaximum"]) == (0, 1)
    assert threshold["symbol"] == "α"  # noqa: RUF001
    assert schema["$defs"]["Curl"]["properties"]["radius"]["unit"] == "sizes"
    assert '"ge"' not in json.dumps(schema) and '"le"' not in json.dumps(schema)
