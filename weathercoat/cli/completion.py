"""`weathercoat completion`: the script that teaches a shell to complete."""

from __future__ import annotations

import json

import click

from weathercoat.cli import options


@click.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
@options.as_json
@options.debug
def command(shell: str, as_json: bool) -> None:
    """Print the completion script of SHELL.

    \b
    bash:  weathercoat completion bash > ~/.local/share/bash-completion/completions/weathercoat
    zsh:   weathercoat completion zsh > a folder of $fpath, as _weathercoat
    fish:  weathercoat completion fish > ~/.config/fish/completions/weathercoat.fish
    """
    from click.shell_completion import get_completion_class

    from weathercoat.cli.handler import COMPLETION_VARIABLE, PROGRAM
    from weathercoat.cli.root import weathercoat

    kind = get_completion_class(shell)
    if kind is None:
        raise click.UsageError(f"this version of Click has no completion for {shell}")
    script = kind(weathercoat, {}, PROGRAM, COMPLETION_VARIABLE).source()
    click.echo(json.dumps({"script": script}, ensure_ascii=False) if as_json else script)
