"""Options and arguments that several subcommands share, so that each is spelled and explained once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from weathercoat.config.presets import preset_names
from weathercoat.config.quality import AUTO, LEVELS
from weathercoat.errors import UsageError
from weathercoat.memory import parse_size
from weathercoat.target import pin

if TYPE_CHECKING:
    from weathercoat.config.load import Override


class _ConfigName(click.ParamType):
    name = "config"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        shipped = [CompletionItem(name) for name in preset_names() if name.startswith(incomplete)]
        return [*shipped, CompletionItem(incomplete, type="file")]


class _Assignment(click.ParamType):
    name = "key=value"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        from weathercoat.config.schema import parameters

        matching = (parameter for parameter in parameters() if parameter.key.startswith(incomplete))
        return [CompletionItem(f"{parameter.key}=", help=parameter.description) for parameter in matching]


MOST_THREADS = 4  # more gain little: what is met across tiles is met by one

config = click.argument("config", type=_ConfigName())
model = click.argument("model", type=click.Path(path_type=str))
assignments = click.option(
    "--set",
    "assignments",
    multiple=True,
    type=_Assignment(),
    metavar="KEY=VALUE",
    help="Override a value of the config, such as curl.radius=0.1; may be given several times.",
)
seed = click.option("--seed", type=int, metavar="N", help="Override seed.")
steps = click.option("--steps", type=int, metavar="N", help="Override ageing.steps.")
faces = click.option("--faces", type=int, metavar="N", help="Override remesh.faces.")
until = click.option(
    "--until",
    multiple=True,
    metavar="LIMIT",
    help="Override ageing.until: stop at the first step that reaches rust=Ri3, flaking=4, bare=12% or the "
    "like; commas join what has to be reached all, and of several options one is enough.",
)
quality = click.option(
    "--quality",
    type=click.Choice([*LEVELS, AUTO]),
    help="Override quality: how fine a mesh, how many steps and which solver; auto needs a scene.",
)
model_format = click.option(
    "--format",
    "model_format",
    metavar="NAME",
    help="Format of the model, where its content and extension do not tell.",
)
threads = click.option(
    "--threads",
    type=click.IntRange(min=1),
    metavar="N",
    help="Threads that share the work of a large film; all cores, at most 4, by default. Changes no result.",
)


workers = click.option(
    "-j",
    "--workers",
    type=click.IntRange(min=1),
    metavar="N",
    help="How many jobs run at once, as far as memory allows; as many as there are cores, by default.",
)


class _Size(click.ParamType):
    name = "size"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        return value if isinstance(value, int) else parse_size(value)


max_memory = click.option(
    "--max-memory",
    type=_Size(),
    metavar="SIZE",
    help="Memory that a run may take at its peak, such as 4G; what this process may use, by default.",
)
quiet = click.option("-q", "--quiet", is_flag=True, help="Print errors only, and what --json asks for.")
as_json = click.option("--json", "as_json", is_flag=True, help="Print results, and an error, as JSON.")
resume = click.option(
    "--resume",
    is_flag=True,
    help="Go on from where an interrupted run stopped, or extend a finished one; begin where there is none.",
)
overwrite = click.option("--overwrite", is_flag=True, help="Replace what is there.")
strict = click.option("--strict", is_flag=True, help="Refuse a model that needs any repair.")
no_check = click.option(
    "--no-check",
    "check",
    is_flag=True,
    flag_value=False,
    default=True,
    help="Do not verify the result at the end.",
)
log_file = click.option(
    "--log-file", type=click.Path(path_type=Path, dir_okay=False), help="Write all messages to a file too."
)
debug = click.option("--debug", is_flag=True, expose_value=False, help="Print the traceback of an error.")


def threads_beside(workers: int) -> int:
    """The threads of a run, where so many go on at once."""
    from weathercoat.deform.team import usable_cores

    return max(1, min(MOST_THREADS, usable_cores() // workers))


def to(formats: Sequence[str], about: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The option --to, the format of a mesh that is written."""
    return click.option("--to", "to", type=click.Choice(formats), help=about)


def require_one_reader(config: str, model: str) -> None:
    """Raise UsageError where both CONFIG and MODEL would read standard input."""
    if config == model == "-":
        raise UsageError("config and model cannot both be standard input", remedy="give a file for one")


def portable(command: Callable[..., Any]) -> Callable[..., Any]:
    """The option --portable, which pins the process before the command begins."""

    @click.option(
        "--portable",
        is_flag=True,
        help="Make results that are the same bytes on every x86-64-v3 processor (with AVX2 and FMA).",
    )
    @wraps(command)
    def pinned(*, portable: bool, **arguments: Any) -> Any:
        if portable:
            pin()
        return command(**arguments)

    return pinned


def shortcuts(**values: object) -> Iterator[Override]:
    """What the options `quality`, `seed`, `steps`, `faces` and `until` override, of those that were given."""
    from weathercoat.config.load import Override

    keys = {
        "quality": "quality",
        "seed": "seed",
        "steps": "ageing.steps",
        "faces": "remesh.faces",
        "until": "ageing.until",
    }
    for option, value in values.items():
        if value is not None and value != ():
            yield Override(keys[option], list(value) if isinstance(value, tuple) else value, f"--{option}")


def require_config_first(config: str, model: str) -> None:
    """Raise UsageError where CONFIG and MODEL are plainly the other way round."""

    def is_config(name: str) -> bool:
        return Path(name).suffix.lower() in (".yaml", ".yml") or (
            name in preset_names() and not Path(name).exists()
        )

    if is_config(model) and not is_config(config):
        raise UsageError(
            f"{model} is a config, and CONFIG comes before MODEL", remedy=f"say {model} {config}"
        )


def output(what: str, *, required: bool = False) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The option -o for `what`."""
    return click.option(
        "-o",
        "--output",
        "output",
        type=click.Path(path_type=Path),
        metavar="PATH",
        required=required,
        help=what,
    )
