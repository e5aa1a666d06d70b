"""`weathercoat run`: age one model."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from weathercoat import unfinished
from weathercoat.cli import filter, options
from weathercoat.cli.messages import Messages
from weathercoat.cli.signals import Patience
from weathercoat.cli.writing import STANDARD_OUTPUT, refuse_terminal, send
from weathercoat.errors import UsageError


@click.command()
@options.config
@options.model
@options.output("Folder of the results, MODEL-CONFIG by default; - for the aged mesh on standard output.")
@options.to(filter.FORMATS, "Format of the aged mesh on standard output; glb by default.")
@options.assignments
@options.quality
@options.seed
@options.steps
@options.until
@options.faces
@options.model_format
@options.threads
@options.portable
@options.max_memory
@options.overwrite
@options.resume
@options.strict
@options.no_check
@options.quiet
@options.as_json
@options.log_file
@options.debug
def command(
    config: str,
    model: str,
    output: Path | None,
    to: str | None,
    assignments: tuple[str, ...],
    quality: str | None,
    seed: int | None,
    steps: int | None,
    until: tuple[str, ...],
    faces: int | None,
    model_format: str | None,
    threads: int | None,
    max_memory: int | None,
    overwrite: bool,
    resume: bool,
    strict: bool,
    check: bool,
    quiet: bool,
    as_json: bool,
    log_file: Path | None,
) -> None:
    """Age the paint of MODEL by the rules of CONFIG.

    CONFIG is a YAML file or the name of a shipped config (see `weathercoat config list`), MODEL a mesh; one
    of them may be - for standard input. The folder of the results appears only once it is whole; a run that
    was interrupted leaves what it has in FOLDER.partial, from where --resume goes on.
    """
    from weathercoat.config.load import load_config
    from weathercoat.output.folder import safe_name

    if overwrite and resume:
        raise UsageError("--resume goes on, and --overwrite begins anew", remedy="give one of them")
    is_filter = output == STANDARD_OUTPUT
    kind = to or filter.FORMATS[0]
    if is_filter:
        _require_filter(kind, resume=resume, overwrite=overwrite, as_json=as_json)
    elif to:
        remedy = "add -o -, or choose formats of the folder with --set output.formats="
        raise UsageError("--to is the format on standard output", remedy=remedy)
    options.require_config_first(config, model)
    options.require_one_reader(config, model)
    shortcuts = options.shortcuts(quality=quality, seed=seed, steps=steps, faces=faces, until=until)
    extra = filter.settings(kind) if is_filter else ()
    loaded = load_config(config, [*assignments, *shortcuts, *extra])
    is_piped = model == "-"
    stem = "model" if is_piped else Path(model).stem
    folder = output or Path(safe_name(f"{stem}-{Path(config).stem}"))
    with Messages(quiet=quiet or as_json, log_file=log_file) as messages, _say_how_to_go_on():
        from weathercoat.run import run_asset

        def run(out: Path) -> dict[str, Any]:
            return run_asset(
                loaded,
                sys.stdin.buffer if is_piped else model,
                out,
                format=model_format,
                overwrite=overwrite,
                resume=resume,
                strict=strict,
                check=check,
                max_memory=max_memory,
                threads=threads or options.threads_beside(1),
                progress=messages.progress,
                log=messages.log,
                patience=None if is_filter else Patience(),
            )

        if is_filter:
            send(filter.aged_mesh(run, kind))
            return
        report = run(folder)
    if as_json:
        click.echo(json.dumps(report, indent=2, ensure_ascii=False))
    elif not quiet:
        click.echo("\n".join([*_table(report), f"written to {folder}"]))


def _require_filter(kind: str, *, resume: bool, overwrite: bool, as_json: bool) -> None:
    """Raise UsageError where what is asked for needs a folder, or standard output for itself."""
    if as_json:
        raise UsageError("--json and -o - both write to standard output", remedy="give a folder to -o")
    if resume or overwrite:
        raise UsageError("-o - keeps nothing to go on from or to replace", remedy="give a folder to -o")
    if kind != "obj":
        refuse_terminal(kind.upper())


@contextmanager
def _say_how_to_go_on() -> Iterator[None]:
    """Note the command that goes on where an error leaves work to go on from."""
    given = [word for word in click.get_current_context().find_root().obj if word != "--overwrite"]
    again = given if "--resume" in given else [*given[:1], "--resume", *given[1:]]
    how = f"go on with: {shlex.join(['weathercoat', *again])}"

    def at_sudden_end(told: list[str]) -> str | None:
        return how if told else None

    unfinished.begin(at_sudden_end)
    try:
        yield
    except BaseException as error:
        if getattr(error, "__notes__", None):
            error.add_note(how)
        raise
    finally:
        unfinished.end(at_sudden_end)


def _table(report: dict[str, Any]) -> Iterator[str]:
    """What became of the paint, one line a snapshot."""
    yield f"{'step':>8} {'age':>6} {'separated':>10} {'lost':>7} {'flakes':>7} {'rust':>6}"
    for row in report["snapshots"]:
        yield (
            f"{row['step']:8d} {row['age']:6.2f} {row['separated_share']:10.1%} {row['lost_share']:7.1%}"
            f" {row['flakes']['count']:7d} {row['substrate_rust']:6.2f}"
        )
