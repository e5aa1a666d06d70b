"""What rows of manifests become, and the line of everything that is wrong with one."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weathercoat.batch.manifest import MOST_VALUES, Row, is_manifest, read_manifest
from weathercoat.batch.sources import collect_jobs
from weathercoat.config.document import Item, read_items
from weathercoat.config.load import Override
from weathercoat.errors import ConfigError, WeathercoatError


@pytest.fixture(autouse=True)
def inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in a folder of its own."""
    monkeypatch.chdir(tmp_path)


def rows_of(name: str, content: str | bytes) -> list[Row]:
    Path(name).parent.mkdir(exist_ok=True)
    Path(name).write_bytes(content.encode() if isinstance(content, str) else content)
    rows, problems = read_manifest(name)
    assert problems == []
    return rows


def problems_of(name: str, content: str | bytes) -> list[str]:
    Path(name).write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(ConfigError) as caught:
        collect_jobs([name])
    return [str(problem) for problem in caught.value.problems]


def test_manifests_go_by_their_extension() -> None:
    assert all(map(is_manifest, ["a.yaml", "b/a.YML", "c.csv"])) and not is_manifest("csv")


YAML = """\
defaults: {config: rusting, seed: 4, set: {curl: {radius: 0.2}}}
jobs:
- a/oak.obj
- model: ../elm.obj
  name: trees/elm
  config: literal
  format: ply
  seed: 5
  set:
    curl.radius: 0.1
    dust: {rate: 0.3}
    snapshots.steps: [1, 2]
- asset: s3://bucket/ash.glb
"""


def test_rows_in_yaml() -> None:
    common = (Override("seed", 4, "in/jobs.yaml", 1), Override("curl.radius", 0.2, "in/jobs.yaml", 1))
    own = (
        Override("seed", 5, "in/jobs.yaml", 8),
        Override("curl.radius", 0.1, "in/jobs.yaml", 10),
        Override("dust.rate", 0.3, "in/jobs.yaml", 11),
        Override("snapshots.steps", [1, 2], "in/jobs.yaml", 12),
    )
    elm = Row("trees/elm", "in/../elm.obj", "in/jobs.yaml:4", "literal", (*common, *own), "ply")
    assert rows_of("in/jobs.yaml", YAML) == [
        Row("oak", "in/a/oak.obj", "in/jobs.yaml:3", "rusting", common),
        elm,
        Row("ash", "s3://bucket/ash.glb", "in/jobs.yaml:13", "rusting", common),
    ]


CSV = """\
model, config,seed,curl.radius,appearance.paint,name,snapshots.steps
oak.obj,, 3,0.1,#ff0000,,

elm.obj,literal,,,,"tall
elm","[1, 2]"
ash.obj
"""


@pytest.mark.parametrize("encoding, newline", [("utf-8", "\n"), ("utf-8-sig", "\r\n")])
def test_rows_in_csv(encoding: str, newline: str) -> None:
    values = (
        Override("seed", 3, "in/jobs.csv", 2),
        Override("curl.radius", 0.1, "in/jobs.csv", 2),
        Override("appearance.paint", "#ff0000", "in/jobs.csv", 2),
    )
    content = CSV.replace("\n", newline).encode(encoding)
    steps = (Override("snapshots.steps", [1, 2], "in/jobs.csv", 4),)
    assert rows_of("in/jobs.csv", content) == [
        Row("oak", "in/oak.obj", "in/jobs.csv:2", None, values),
        Row(rows_of("in/jobs.csv", content)[1].name, "in/elm.obj", "in/jobs.csv:4", "literal", steps),
        Row("ash", "in/ash.obj", "in/jobs.csv:6"),
    ]


def test_configs_and_absolute_models_of_a_manifest() -> None:
    Path("in").mkdir()
    Path("in/own.yaml").write_text("curl: {radius: 0.3}")
    Path("in/literal").write_text("curl: {radius: 0.4}")
    (own, literal, model) = rows_of(
        "in/jobs.csv", "model,config\na.obj,own.yaml\nb.obj,literal\n/srv/c.obj,standard\n"
    )
    assert (own.config, literal.config, model.config) == ("in/own.yaml", "in/literal", "standard")
    assert model.asset == "/srv/c.obj"
    radii = [job.loaded.config.curl.radius for job in collect_jobs(["in/jobs.csv"])]
    assert radii[:2] == [0.3, 0.4]


def test_one_model_under_several_names() -> None:
    rows = rows_of("jobs.csv", "model,name,seed\noak.obj,one,1\noak.obj,two,2\n")
    assert [row.name for row in rows] == ["one", "two"]


def test_who_wins() -> None:
    """The command line over the row, the row over the defaults, these over the config."""
    Path("jobs.yaml").write_text(
        "defaults: {seed: 2, set: {curl.radius: 0.2}}\njobs: [{model: a.obj, seed: 3}]"
    )
    (job,) = collect_jobs(["jobs.yaml"], config="rusting", overrides=["dust.rate=0.25"])
    config = job.loaded.config
    assert (config.seed, config.curl.radius, config.dust.rate) == (3, 0.2, 0.25)
    assert job.loaded.source == "rusting"
    assert job.loaded.origins["curl.radius"] == "jobs.yaml:1"
    (job,) = collect_jobs(["jobs.yaml"], overrides=["seed=9", "curl.radius=0.5"])
    assert (job.loaded.config.seed, job.loaded.config.curl.radius) == (9, 0.5)


def test_a_value_is_blamed_on_its_line() -> None:
    text = "model,curl.radius,dust.rate\na.obj,0.1,\nb.obj,-1,x\n\nc.obj,-1,\n"
    found = problems_of("jobs.csv", text)
    assert [problem.partition(", not")[0] for problem in found] == [
        "jobs.csv:3: curl.radius: must be at least 1e-05",
        "jobs.csv:3: dust.rate: must be a number",
        "jobs.csv:5: curl.radius: must be at least 1e-05",
    ]
    found = problems_of(
        "jobs.yaml", "- model: a.obj\n  set:\n    curl:\n      radius: -1\n    lift.x: 1\n- model: b\n"
    )
    assert [problem.partition(", not")[0] for problem in found] == [
        "jobs.yaml:4: curl.radius: must be at least 1e-05",
        "jobs.yaml:5: lift.x: unknown key; in the job a",
    ]


def test_all_problems_at_once() -> None:
    """Of the manifest itself, and of the configs of its sound rows."""
    Path("other.csv").write_text("model,seed\nz.obj,-5\n")
    Path("jobs.yaml").write_text(
        "- {model: a.obj, sed: 3}\n- {name: b}\n- 5\n- {model: c.obj, set: {curl.radius: -1}}\n"
    )
    with pytest.raises(ConfigError) as caught:
        collect_jobs(["jobs.yaml", "other.csv"])
    assert [problem.place() for problem in caught.value.problems] == [
        *(f"jobs.yaml:{line}" for line in (1, 2, 3, 4)),
        "other.csv:2",
    ]


@pytest.mark.parametrize(
    "text, expected",
    [
        ("", "jobs.yaml:1: must be a list of jobs, or a mapping with such a list under jobs"),
        ("[]", "jobs.yaml: holds no jobs"),
        ("seed: 3\ncurl: {}", "jobs.yaml:1: has no jobs; where this is a config, give it with -c"),
        ("jobs: 3", "jobs.yaml:1: must be a list of jobs, or a mapping with such a list under jobs"),
        ("jobs: [a.obj]\ndefault: {}", "jobs.yaml:2: default: unknown key; a manifest has defaults and jobs"),
        ("jobs: [a.obj]\ndefaults:\n  name: x", "jobs.yaml:2: defaults.name: is a matter of each job"),
        ("- a.obj\n- 3", "jobs.yaml:2: must be a mapping with the key model, or the path of a model"),
        ("- model: 3", "jobs.yaml:1: model: must be text, put it in quotes"),
        ("- model: a\n  asset: b", "jobs.yaml:1: model: is given as asset too"),
        ("- set: {}", "jobs.yaml:1: model: is missing"),
        ("- model: a\n  modle: b", "jobs.yaml:2: modle: unknown key; did you mean model?"),
        ("- model: a\n  dust: 3", "jobs.yaml:2: dust: unknown key; values of the config go below set"),
        ("- model: a\n  set: 3", "jobs.yaml:2: set: must be a mapping of the config's keys to values"),
        ("- model: a\n  set: {lyft: {angle: 3}}", "jobs.yaml:2: lyft: unknown key; did you mean lift?"),
        ("- model: a\n  set: {remesh: {}, seed: {a: {}}}", "jobs.yaml:2: seed: must be a whole number"),
        ("- model: a\n  seed: {a: {}}", "jobs.yaml:2: seed: must be a whole number"),
        ("- model: a\n  set: {a..b: 3}", "jobs.yaml:2: a..b: is no key of a config"),
        ("- model: a\n  config: my.yaml", "jobs.yaml:2: config: there is no file my.yaml, and no shipped"),
        ("- model: a\n\t- b", "jobs.yaml:2: a tab indents this line; use spaces"),
        (b"- model: a\n- \xff", "jobs.yaml:2: byte 0xff is not UTF-8; save the file as UTF-8"),
    ],
)
def test_what_is_wrong_in_yaml(text: str | bytes, expected: str) -> None:
    problem, *_ = problems_of("jobs.yaml", text)
    if "my.yaml" in expected:
        expected = expected.replace(":2: config", ":1: config")
    assert problem.startswith(expected)


@pytest.mark.parametrize(
    "text, expected",
    [
        ("", "jobs.csv: holds no jobs"),
        ("model,seed\n", "jobs.csv: holds no jobs"),
        ("seed,name\n3,x", "jobs.csv:1: the first line must name the columns, one of them model"),
        ("model,model\na,b", "jobs.csv:1: model: is a column twice"),
        ("model,\na,b", "jobs.csv:1: column 2 has no name"),
        ("modle\na", "jobs.csv:1: modle: unknown key; did you mean model?"),
        ("model,curl.radios\na,1", "jobs.csv:1: curl.radios: unknown key; did you mean curl.radius?"),
        ("model,seed\n,3", "jobs.csv:2: model: is missing"),
        ("model\na,b", "jobs.csv:2: has 2 cells, and the first line 1"),
        ('model,name\n\na,"b', "jobs.csv:3: is no valid CSV"),
        ("model,curl\na,{radius: 1}", "jobs.csv:2: curl: is a mapping; give each of its keys a column"),
        ("model,curl.radius\na,[1", "jobs.csv:2: curl.radius: "),
        (b"model\n\xff.obj", "jobs.csv:2: byte 0xff is not UTF-8"),
    ],
)
def test_what_is_wrong_in_csv(text: str | bytes, expected: str) -> None:
    problem, *more = problems_of("jobs.csv", text)
    assert problem.startswith(expected) and not more


def test_a_manifest_that_cannot_be_read() -> None:
    Path("folder.d").mkdir()
    for name in ("none.csv", "none.yaml"):
        with pytest.raises(ConfigError, match="manifest cannot be read: No such file"):
            collect_jobs([name])


def test_a_long_manifest_is_none_too_long() -> None:
    """Beyond what a config may be."""
    rows = rows_of("jobs.csv", "model,seed\n" + "".join(f"m/{i:05d}.obj,{i}\n" for i in range(20_000)))
    assert len(rows) == 20_000 and rows[-1].overrides[0].value == 19_999


def test_lists_with_lines() -> None:
    items = read_items(b"- a\n- b: [1]\n", "f", MOST_VALUES)
    assert items == [Item("a", 1), Item({"b": Item([Item(1, 2)], 2)}, 2)]
    with pytest.raises(ConfigError, match="more than 2 values"):
        read_items(b"[1, 2]", "f", 2)


PIECES = [
    "model",
    "asset",
    "jobs",
    "defaults",
    "set",
    "seed",
    "curl.radius",
    "remesh",
    "name",
    "off",
    "a.obj",
    "/",
]
PIECES += [
    ":",
    ": ",
    "- ",
    "\n",
    "\n  ",
    ",",
    ", ",
    "{",
    "}",
    "[",
    "]",
    '"',
    "#",
    "..",
    "1",
    "-1e9",
    "\r",
    "\0",
    "é",
]
PIECES += ["&x ", "*x", "<<", "!!set "]


@given(st.sampled_from(["jobs.yaml", "jobs.csv"]), st.lists(st.sampled_from(PIECES), max_size=25))
def test_any_text_gives_jobs_or_a_message(name: str, pieces: list[str]) -> None:
    Path(name).write_text("".join(pieces), encoding="utf-8", newline="")
    try:
        jobs = collect_jobs([name])
    except WeathercoatError as error:
        assert error.exit_code == 2 and error.lines()
    else:
        assert all(job.asset and job.name for job in jobs)


@pytest.mark.parametrize("language", ["yaml", "csv"])
def test_manifests_of_the_docs(language: str) -> None:
    page = (Path(__file__).parents[2] / "docs" / "batch.md").read_text(encoding="utf-8")
    block, *_ = re.findall(rf"^```{language}\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    Path(f"jobs.{language}").write_text(block)
    assert [job.name for job in collect_jobs([f"jobs.{language}"])][:2] == ["bracket", "street/stop"]
