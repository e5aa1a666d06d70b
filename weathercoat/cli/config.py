"""`weathercoat config`: begin, inspect and check a config."""

from __future__ import annotations

import json
from pathlib import Path

import click

from weathercoat.cli import options
from weathercoat.config.presets import preset_names, preset_purpose
from weathercoat.errors import ConfigError, ConfigProblem


@click.group()
def command() -> None:
    """Begin, show and check configs."""


@command.command("list")
def list_configs() -> None:
    """Name the shipped configs and say what each is for."""
    width = max(map(len, preset_names()))
    for name in preset_names():
        click.echo(f"{name:{width}}  {preset_purpose(name)}")


@command.command("new")
@click.argument("file", required=False, type=click.Path(path_type=Path))
@click.option(
    "--from", "preset", type=click.Choice(preset_names()), help="Take the values of a shipped config."
)
@options.overwrite
@options.debug
def new_config(file: Path | None, preset: str | None, overwrite: bool) -> None:
    """Write a commented config to start from, to FILE or standard output."""
    from weathercoat.config.describe import example_yaml

    if preset is None:
        text = example_yaml()
    else:
        from weathercoat.config.load import load_config

        text = example_yaml(load_config(preset).config, f"# {preset_purpose(preset)}.\n")
    if file is None:
        click.echo(text, nl=False)
        return
    from weathercoat.output.folder import whole_file

    with whole_file(file, overwrite=overwrite) as stream:
        stream.write(text.encode())


@command.command("show")
@options.config
@options.assignments
@options.as_json
@options.debug
def show_config(config: str, assignments: tuple[str, ...], as_json: bool) -> None:
    """Print every value of CONFIG and where it came from: default, preset, file and line, or --set."""
    from weathercoat.config.describe import resolved_yaml
    from weathercoat.config.load import load_config

    loaded = load_config(config, assignments)
    if as_json:
        content = {"config": loaded.config.as_dict(), "origins": dict(loaded.origins)}
        click.echo(json.dumps(content, indent=2, ensure_ascii=False))
    else:
        click.echo(resolved_yaml(loaded), nl=False)


@command.command("schema")
@click.option("--markdown", is_flag=True, help="Print the reference of all keys in Markdown instead.")
@options.debug
def print_schema(markdown: bool) -> None:
    """Print the JSON Schema of a config, for editors."""
    from weathercoat.config.describe import json_schema, reference_markdown

    if markdown:
        click.echo(reference_markdown(), nl=False)
    else:
        click.echo(json.dumps(json_schema(), indent=2, ensure_ascii=False))


@command.command("check")
@click.argument("configs", nargs=-1, required=True, metavar="CONFIG...")
@options.assignments
@options.as_json
@options.debug
def check_configs(configs: tuple[str, ...], assignments: tuple[str, ...], as_json: bool) -> None:
    """Check configs without running: every problem of every file, with line and key."""
    from weathercoat.config.load import load_config

    problems: list[ConfigProblem] = []
    for config in configs:
        try:
            load_config(config, assignments)
        except ConfigError as error:
            problems += error.problems
        else:
            if not as_json:
                click.echo(f"{config}: valid")
    if problems:
        raise ConfigError(problems=tuple(dict.fromkeys(problems)))
    if as_json:
        click.echo(json.dumps({"valid": list(configs)}, ensure_ascii=False))
