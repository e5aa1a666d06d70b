"""Values of a config that follow from others: of a quality, of physical units, of a scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from weathercoat.errors import ConfigError, ConfigProblem

if TYPE_CHECKING:
    from weathercoat.config.load import LoadedConfig


def with_values(loaded: LoadedConfig, values: Mapping[str, Any], origin: str) -> LoadedConfig:
    """A config with other values, by dotted keys; origin: where they come from.

    Raises ConfigError for values out of bounds, or that do not go together with the rest.
    """
    from pydantic import ValidationError

    from weathercoat.config.schema import Config
    from weathercoat.config.wording import explain

    content = loaded.config.as_dict()
    for key, value in values.items():
        section, _, name = key.partition(".")
        if name:
            content[section][name] = value
        else:
            content[section] = value
    try:
        config = Config.model_validate(content)
    except ValidationError as error:
        found = [explain(detail) for detail in error.errors(include_url=False)]
        problems = [ConfigProblem(origin, 0, ".".join(path), what) for path, what in found]
    else:
        problems = [ConfigProblem(origin, 0, *problem) for problem in config.conflicts()]
    if problems:
        raise ConfigError(problems=tuple(problems))
    return replace(loaded, config=config, origins={**loaded.origins, **dict.fromkeys(values, origin)})
