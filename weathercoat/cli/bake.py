"""`weathercoat bake`: maps of a finished run on the texture coordinates of its model."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from weathercoat.cli import options
from weathercoat.errors import UsageError

if TYPE_CHECKING:
    from weathercoat.finished import FinishedRun
    from weathercoat.output.maps.bake import Baker, MapParameters

_MOST = 16_384
_SIZE = re.compile(r"(\d{1,5})(?:x(\d{1,5}))?")


class _PictureSize(click.ParamType):
    name = "size"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        if isinstance(value, tuple):
            return value
        found = _SIZE.fullmatch(value)
        if found is None:
            self.fail(f"{value!r} is no size, such as 2048 or 1000x500", param, ctx)
        width, height = int(found[1]), int(found[2] or found[1])
        if not (1 <= width <= _MOST and 1 <= height <= _MOST):
            self.fail(f"maps have 1 to {_MOST:,} texels a side", param, ctx)
        return width, height


class _Step(click.ParamType):
    name = "step"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int | str:
        if value == "all":
            return "all"
        try:
            return int(value)
        except ValueError:
            self.fail(f"{value!r} is no step: give a number, or all", param, ctx)


@click.command()
@click.argument("run", type=click.Path(path_type=Path))
@options.output("The folder for the maps.", required=True)
@click.option("--model", type=click.Path(path_type=Path), metavar="PATH", help="The model of the run.")
@click.option("--step", type=_Step(), metavar="N|all", help="The snapshot; the last, by default.")
@click.option(
    "--size",
    type=_PictureSize(),
    default="2048",
    show_default=True,
    metavar="WIDTH[xHEIGHT]",
    help="Texels of a map.",
)
@click.option("--maps", metavar="NAMES", help="Which maps, with commas; all, by default.")
@click.option(
    "--pack",
    multiple=True,
    metavar="[NAME:]R=MAP,...",
    help="A further map whose channels are those named, such as R=rust,G=dirt,B=bare,A=crack.",
)
@click.option("--bits", type=click.Choice(["8", "16"]), default="8", show_default=True, help="Of a channel.")
@click.option(
    "--format",
    "to",
    type=click.Choice(["png", "exr"]),
    default="png",
    show_default=True,
    help="Of the maps; EXR has half floats, and heights in the model's units.",
)
@click.option(
    "--padding",
    type=click.IntRange(0, 1024),
    default=16,
    show_default=True,
    metavar="TEXELS",
    help="How far charts go on beyond their edges.",
)
@click.option("--atlas", is_flag=True, help="Lay out texture coordinates anew; writes the model with them.")
@options.threads
@options.overwrite
@options.quiet
@options.as_json
@options.debug
def command(
    run: Path,
    output: Path,
    model: Path | None,
    step: int | str | None,
    size: tuple[int, int],
    maps: str | None,
    pack: tuple[str, ...],
    bits: str,
    to: str,
    padding: int,
    atlas: bool,
    threads: int | None,
    overwrite: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Bake the state of RUN, the folder of a finished run, onto the texture coordinates of its model: base
    colour, occlusion-roughness-metalness, normal, height, and masks.

    Beside the maps lie maps.json, which says how to read them, and model.glb, the model that wears them.
    """
    from weathercoat.baking import ATLAS, prepare_baker, summary
    from weathercoat.cli.messages import Messages
    from weathercoat.finished import open_run
    from weathercoat.output.folder import RunFolder
    from weathercoat.output.maps.bake import MapParameters
    from weathercoat.output.maps.channels import MAPS, map_kinds, parse_pack
    from weathercoat.output.maps.folder import MAPS_REPORT
    from weathercoat.output.meshes import write_mesh
    from weathercoat.run import painted_faces, report_compiling

    names = tuple(MAPS) if maps is None else tuple(name.strip() for name in maps.split(",") if name.strip())
    parameters = MapParameters(
        width=size[0],
        height=size[1],
        maps=names,
        packs=tuple(parse_pack(text) for text in pack),
        format=to,
        bits=int(bits),
        padding=padding,
    )
    if not map_kinds(parameters.maps, parameters.packs):
        raise UsageError("no map is asked for", remedy=f"the maps are {', '.join(MAPS)}")
    finished = open_run(run)
    folder = RunFolder(output, overwrite=overwrite, marker=MAPS_REPORT)
    with Messages(quiet=quiet or as_json) as messages, report_compiling(messages.log), folder as target:
        surface = finished.read_model(model)
        baker = prepare_baker(
            surface,
            painted_faces(surface, finished.config),
            finished.read_snapshot(),
            finished.config,
            up=finished.up,
            atlas_size=min(size) if atlas else None,
        )
        if atlas:
            write_mesh(target / ATLAS, baker.surface)
        written = _bake(finished, step, baker, parameters, target, threads or options.threads_beside(1))
        if step == "all":
            from weathercoat.output.report import write_json

            write_json(target / MAPS_REPORT, {"steps": written})
    if as_json:
        click.echo(json.dumps(written if step == "all" else written[0], indent=2, ensure_ascii=False))
    elif not quiet:
        pictures = sum(len(tile["files"]) for about in written for tile in about["tiles"])
        click.echo("\n".join([f"written to {output}: {pictures} maps", *summary(written)]))


def _bake(
    finished: FinishedRun,
    step: int | str | None,
    baker: Baker,
    parameters: MapParameters,
    folder: Path,
    threads: int,
) -> list[dict[str, Any]]:
    """Bake the wanted steps: one into the folder itself, all into folders in it."""
    from weathercoat.output.folder import snapshot_stem
    from weathercoat.output.maps.folder import write_maps

    if step != "all":
        number = None if step is None else int(step)
        return [write_maps(baker, finished.read_snapshot(number), parameters, folder, threads=threads)]
    written = []
    for number in finished.steps:
        place = folder / snapshot_stem(number, finished.steps[-1])
        place.mkdir()
        written.append(write_maps(baker, finished.read_snapshot(number), parameters, place, threads=threads))
    return written
