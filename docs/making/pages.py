"""The pages that are generated: every key of the config, every code of a message, and the gallery."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Iterator

import weathercoat
from making import accuracy, effects, fidelity, gallery, independence, noise, speed, stability
from making.places import DOCS, IMAGES
from weathercoat import errors
from weathercoat.config.describe import reference_markdown
from weathercoat.config.presets import preset_path, preset_purpose
from weathercoat.config.schema import parameters
from weathercoat.notes import MEANINGS
from weathercoat.scene.scene_file import scene_schema

_ABOUT_PICTURES = f"""\
This page is made by `make docs`: the tables from the schema, the pictures by ageing a plate or a bracket of
{effects.FACES:,} faces in {effects.STEPS} steps, up to a share of {effects.SHARE:g} of the run unless said \
otherwise. They begin from the config
`standard` and change one value, and what must be set for it to matter.

See also [the method](method.md) for what the parameters do, and the [gallery](gallery.md) for what they make
together.
"""

_ABOUT_ERRORS = """\
# Exit codes and messages

This page is made by `make docs`. The codes are stable: scripts may rely on them.

A message is one line on standard error, `weathercoat: FILE: CODE: what; what to do`, and one for each
problem of a config, `weathercoat: FILE:LINE: E-CONFIG: key: what`. With `--json`, which every command takes,
an error is an object under `"error"` with the keys `code`, `exit_code`, `file`, `message` and `remedy`; a
traceback is printed only with `--debug`. Notes (`W-...`) go to standard error too, carry the number of
elements that they concern and do not change the exit code; `run.json` lists them. `--strict` makes the first
one an error.
"""

_ABOUT_GALLERY = """\
# Gallery

Every shipped config on generated parts, intact and at the ages 0.2, 0.4, 0.6, 0.8 and 1. The parts come from
`weathercoat sample`, and the pictures are the `preview.png` that a run writes. To make one of them:

```console
$ weathercoat sample barrel -o barrel.obj
$ weathercoat run rusting barrel.obj -o barrel --set 'snapshots.steps=[0, 200, 400, 600, 800, 1000]'
```

There are [looks](#looks), [paints and metals](#paints-and-metals) and [environments](#environments). They go
together: a later one wins where both set a key, and a config of your own comes last, here `mine.yaml`:

```console
$ weathercoat run marine_epoxy+c5 barrel.obj -o salty
$ printf 'preset: [powder_coat, c4]\\nappearance: {paint: "#2f6f4f"}\\n' > mine.yaml
$ weathercoat run mine.yaml barrel.obj -o green
```

All of them are looks: their numbers were chosen by eye, and none was measured on a paint. For values in MPa,
µm and years see [physical units](physical.md).

`python docs/make.py gallery` makes all of them. For `literal` beside `standard` see
[the method](method.md#the-literal-rules-and-the-default-side-by-side).
"""

_ABOUT_PYTHON = """\
# In Python

This page is made by `make docs` from the docstrings of `weathercoat.api`. Five functions: each step of what
`weathercoat run` does, and the check of a finished run:

```python
import weathercoat

weathercoat.write("plate.ply", weathercoat.read("sign.obj"))
surface = weathercoat.remesh(weathercoat.read("plate.ply", up="y"), faces=2000)
simulation = weathercoat.simulate(surface, "curling", until=0.5)
while simulation.age < 0.6:
    simulation.step()
weathercoat.write("curled.png", simulation.snapshot())
```

A `Surface` is frozen, with plain NumPy arrays (`vertices`, `faces`, `groups`, `notes`, ...). A `Simulation`
steps and hands out snapshots; `residual()` says how well the film meets its constraints. A `Snapshot` is film
and metal at one moment as plain arrays, the same that [the PLY](formats.md#ply) holds. Every error is a
subclass of `weathercoat.errors.WeathercoatError` and carries its [code and exit code](errors.md).
"""

_EXIT_CODES = {
    0: "done; what was repaired is listed as `W-...`",
    1: "`compare`: the sides are different, or one is corrupt",
    2: "the command line or the config is not valid",
    3: "the model cannot be read",
    4: "the model holds no usable surface, or needed a repair under `--strict`",
    5: "over a limit of size, faces or memory",
    6: "a result fails its checks: the tool's own, and nothing was written, or a run given to `verify`",
    7: "the output cannot be written, or exists",
    8: "batch: some jobs failed; the results of the others are kept, and a rerun goes on",
    70: "internal error: please report it",
    130: "interrupted (Ctrl-C); nothing half-written is left",
    141: "whoever read the standard output went away, as `head` does",
    143: "terminated; nothing half-written is left",
}


def configuration_page() -> str:
    """The reference of all keys, each section followed by the pictures of its parameters."""
    first, *sections = reference_markdown().split("\n## ")
    parts = [first.rstrip() + "\n\n" + _ABOUT_PICTURES.rstrip()]
    for section in sections:
        heading = section.partition("\n")[0].strip("`")
        prefix = "" if heading == "Top level" else f"{heading}."
        parts.append("\n".join(["## " + section.rstrip(), *_effect_rows(prefix)]))
    return "\n\n".join(parts) + "\n"


def _effect_rows(prefix: str) -> Iterator[str]:
    """Pictures of the parameters of a section, by the prefix of their keys, and why the others have none."""
    keys = [p.key for p in parameters() if p.key.rpartition(".")[0] == prefix.rstrip(".")]
    shown = [key for key in keys if key in effects.EFFECTS]
    if shown:
        yield "\n| key | from left to right | |\n|---|---|---|"
    for key in shown:
        effect = effects.EFFECTS[key]
        notes = []
        if effect.also:
            notes.append("with " + ", ".join(f"`{setting}`" for setting in effect.also))
        if effect.share != effects.SHARE:
            notes.append(f"at a share of {effect.share:g}")
        values = ", ".join(f"`{value}`" for value in effect.values)
        link = _link(effects.FOLDER, effects.picture_name(key))
        yield f"| `{key}` | {'; '.join([values, *notes])} | ![{key}: {values.replace('`', '')}]({link}) |"
    without = [f"`{key}` ({effects.WITHOUT_PICTURE[key]})" for key in keys if key in effects.WITHOUT_PICTURE]
    if without:
        yield "\nWithout a picture: " + ", ".join(without) + "."


def errors_page() -> str:
    """Exit codes, errors and warnings, each with its remedy."""
    lines = [_ABOUT_ERRORS, "## Exit codes", "", "| exit | meaning |", "|---|---|"]
    lines += [f"| {code} | {meaning} |" for code, meaning in _EXIT_CODES.items()]
    lines += ["", "## Errors", "", "| code | exit | what it means | what to do |", "|---|---|---|---|"]
    lines += [f"| `{e.code}` | {e.exit_code} | {_summary(e)} | {e.remedy} |" for e in coded_errors()]
    lines += ["", "The message itself is often more particular than this table.", ""]
    lines += ["## Notes", "", "| code | what it means | what to do |", "|---|---|---|"]
    lines += [f"| `{code}` | {what} | {remedy} |" for code, (what, remedy) in MEANINGS.items()]
    return "\n".join(lines) + "\n"


def coded_errors() -> list[type[errors.WeathercoatError]]:
    """Every class of error with a code of its own, by exit code, in the order of the source."""
    classes = [value for value in vars(errors).values() if isinstance(value, type)]
    own = [c for c in classes if issubclass(c, errors.WeathercoatError) and "code" in vars(c)]
    return sorted(own, key=lambda error: error.exit_code)


def _summary(error: type[errors.WeathercoatError]) -> str:
    if error is errors.WeathercoatError:
        return "A fault of the tool."
    return " ".join((error.__doc__ or "").partition("\n\n")[0].split())


def python_page() -> str:
    """The functions of the Python interface, with their signatures and docstrings."""
    lines = [_ABOUT_PYTHON.rstrip()]
    for name in weathercoat.__all__:
        function = getattr(weathercoat, name)
        lines += ["", f"## `{name}`", "", "```text", _signature(name, function), "```", ""]
        lines += [inspect.getdoc(function) or ""]
    return "\n".join(lines) + "\n"


def _signature(name: str, function: Callable[..., object]) -> str:
    """The signature of a function, a line for each parameter."""
    signature = inspect.signature(function)
    lines = [f"{name}("]
    is_keyword_only = False
    for parameter in signature.parameters.values():
        if parameter.kind is parameter.KEYWORD_ONLY and not is_keyword_only:
            is_keyword_only = True
            lines.append("    *,")
        default = "" if parameter.default is parameter.empty else f" = {parameter.default!r}"
        lines.append(f"    {parameter.name}: {parameter.annotation}{default},")
    return "\n".join([*lines, f") -> {signature.return_annotation}"])


def gallery_page() -> str:
    """Every shipped config on its parts, with the command that makes the picture."""
    lines = [_ABOUT_GALLERY.rstrip()]
    kinds = {
        "Looks": gallery.LOOKS,
        "Paints and metals": gallery.PAINTS,
        "Environments": gallery.ENVIRONMENTS,
    }
    for title, names in kinds.items():
        lines += ["", f"## {title}"]
        for name in names:
            lines += ["", f"### {name}", "", f"{_about(name)}", ""]
            lines += [f"[`configs/{name}.yaml`](../configs/{name}.yaml)", ""]
            for config, part in gallery.shown(name):
                link = _link(gallery.FOLDER, gallery.picture_name(config, part))
                paint, _, environment = config.partition("+")
                with_paint = f", {paint}" if environment else ""
                lines += [f"![{preset_purpose(name)}{with_paint}, on a {part}]({link})", ""]
            lines.pop()
    return "\n".join(lines) + "\n"


def _about(name: str) -> str:
    """The comment that heads a shipped config."""
    comment = []
    for line in preset_path(name).read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        comment.append(line.lstrip("# "))
    return " ".join(comment)


def _link(folder: object, name: str) -> str:
    return f"images/{str(folder).removeprefix(str(IMAGES))[1:]}/{name}"


def scene_schema_file() -> str:
    """The published JSON Schema of scene files."""
    return json.dumps(scene_schema(), indent=2, ensure_ascii=False) + "\n"


PAGES: dict[str, Callable[[], str]] = {
    "configuration.md": configuration_page,
    "errors.md": errors_page,
    "fidelity.md": fidelity.fidelity_page,
    "gallery.md": gallery_page,
    "performance.md": speed.performance_page,
    "accuracy.md": accuracy.accuracy_page,
    "stability.md": stability.stability_page,
    "independence.md": independence.independence_page,
    "regression.md": noise.regression_page,
    "python.md": python_page,
    "../weathercoat/schemas/scene.json": scene_schema_file,
}


def write_pages() -> None:
    """Write the generated pages."""
    for name, make in PAGES.items():
        (DOCS / name).write_text(make(), encoding="utf-8")
        print(name, flush=True)
