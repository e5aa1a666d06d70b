"""Damaged configs and random command lines: each is refused in clear lines, or holds what the schema allows.

`python -m tests.fuzz configs --count 1000 --seed 1` judges 1000 cases in one process under limits: three
quarters are files, the others `--set` assignments and command lines. What breaks the promise is written to
`build/fuzz`; `--seed` and `--only` with its number judge it again.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import shlex
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tests.fuzz import strict_configs
from tests.fuzz.config_mutations import VALUES, Random, assignment, make_seeds, mutate
from tests.fuzz.workers import Verdict, Worker, case_numbers
from weathercoat.cli.handler import call
from weathercoat.config.describe import json_schema, resolved_yaml
from weathercoat.config.load import LoadedConfig, load_config
from weathercoat.errors import ConfigError

_SECONDS = 20.0  # for one case, which takes a hundredth of a second unless something grows
_EXIT_CODES = (0, 2, 3, 4, 5, 7)  # 6, 70 and signals would be faults
_LONGEST_LINE = 1000
_MODEL = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"
_SCHEMA = json_schema()


class Case(NamedTuple):
    """A file to load; or, where that is None, assignments over a shipped config, or else a command line."""

    data: bytes | None = None
    assignments: tuple[str, ...] = ()
    arguments: tuple[str, ...] = ()


def make_case(seeds: list[bytes], seed: int, number: int) -> Case:
    """The case of this number; the same for the same seeds and `seed`."""
    random = np.random.default_rng([seed, number])
    way = int(random.integers(8))
    if way < 6:
        return Case(data=mutate(seeds, random))
    if way == 6:
        return Case(assignments=tuple(assignment(random) for _ in range(1 + int(random.integers(4)))))
    return Case(arguments=tuple(_command_line(random)))


_CONFIGS = (
    "standard",
    "literal",
    "c.yaml",
    "nowhere",
    "",
    ".",
    "-",
    "crackel",
    "c.yaml/x",
    "é.yaml",
    "x" * 300,
)
_MODELS = ("m.obj", "nowhere.obj", "", ".", "m.obj/x", "x" * 300)
_FOLDERS = ("out", "", ".", "m.obj", "no/where", "x" * 300)
_COMMANDS: tuple[tuple[str, ...], ...] = (
    ("config", "check", "CONFIG"), ("config", "check", "CONFIG", "CONFIG"), ("config", "show", "CONFIG"),
    ("config", "new", "OUT"), ("config", "list"), ("config", "schema"), ("config",), ("config", "none"),
    ("run", "CONFIG", "MODEL", "-o", "OUT", "--faces", "50", "--steps", "2"), ("run", "CONFIG"), ("run",),
    ("inspect", "MODEL"), ("verify", "FOLDER"), ("render", "FOLDER", "-o", "OUT"),
    ("remesh", "MODEL", "-o", "OUT", "--faces", "50"), ("sample", "WORD"), ("WORD",), (),
)  # fmt: skip
_OPTIONS = (
    "--json", "--quiet", "-q", "--strict", "--overwrite", "--help", "--version", "--markdown", "--no-such",
    "--", "-", "--set", "--set=", "--seed", "--seed=WORD", "--format", "--format=WORD", "--quality=WORD",
    "--threads=WORD", "--threads=0", "--log-file=OUT", "--log-file=", "--set=ASSIGNMENT",
    "--set=ASSIGNMENT", "--steps=0", "--faces=WORD",
)  # fmt: skip


def _command_line(random: Random) -> list[str]:
    """A command with a few options, in the right places or not; never one that asks for much work."""
    words = list(_COMMANDS[int(random.integers(len(_COMMANDS)))])
    for _ in range(int(random.integers(4))):
        words.insert(int(random.integers(len(words) + 1)), _OPTIONS[int(random.integers(len(_OPTIONS)))])
    return [_spelled(word, random) for word in words]


def _spelled(word: str, random: Random) -> str:
    def one(choices: tuple[str, ...]) -> str:
        return choices[int(random.integers(len(choices)))]

    short = tuple(value for value in VALUES if len(value) < 40)
    fillings = {
        "CONFIG": _CONFIGS,
        "MODEL": _MODELS,
        "OUT": ("out.ply", "out", "", ".", "no/where", "/"),
        "FOLDER": _FOLDERS,
        "WORD": short,
    }
    if "ASSIGNMENT" in word:
        # of the sizes of a picture and of a mesh only what takes a moment
        text = assignment(random)
        return word.replace("ASSIGNMENT", "seed=1" if text.startswith(_COSTLY) else text)
    for name, choices in fillings.items():
        if name in word:
            return word.replace(name, one(choices))
    return word


_COSTLY = (
    "output.picture",
    "remesh",
    "ageing",
    "deformation",
    "quality",
    "output",
    "preset",
    "fracture.speed",
)


def judge(case: Case) -> Verdict:
    """What becomes of a case, in a folder of its own."""
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        start = time.process_time()
        if case.data is not None:
            Path("c.yaml").write_bytes(case.data)
            verdict = _judge_config("c.yaml", (), case.data)
        elif case.assignments:
            verdict = _judge_config("standard", case.assignments, None)
        else:
            Path("m.obj").write_text(_MODEL)
            Path("c.yaml").write_text("preset: literal\noutput: {preview: false}\n")
            verdict = _judge_command(case.arguments)
        spent = time.process_time() - start
    return Verdict("violation", f"took {spent:.0f} s") if spent > _SECONDS else verdict


def _judge_config(source: str, assignments: tuple[str, ...], data: bytes | None) -> Verdict:
    """Load a config, and give it to `config check`, which must agree."""
    options = [part for text in assignments for part in ("--set", text)]
    code, out, err = _call(["config", "check", source, *options])
    try:
        loaded = load_config(source, assignments)
    except ConfigError as error:
        wrong = _flaw_of_refusal(error, code, out, err)
        if wrong:
            return Verdict("violation", wrong)
        return Verdict("refused", _reason(error))
    if (code, out, err) != (0, f"{source}: valid\n", ""):
        return Verdict("violation", f"accepted, but config check ends with {code}: {err[:300]!r}")
    wrong = _flaw_of_config(loaded, data)
    return Verdict("violation", wrong) if wrong else Verdict("accepted", "config")


def _flaw_of_refusal(error: ConfigError, code: int, out: str, err: str) -> str | None:
    """Why a refusal is not what is promised: one clear line for each problem, from the library as from the
    command.
    """
    lines = error.lines()
    if not error.problems or error.exit_code != 2:
        return "refused without a problem"
    if (code, out) != (2, ""):
        return f"refused, but config check ends with {code}"
    said = err.splitlines()
    expected = [f"weathercoat: {line}" for line in dict.fromkeys(lines)]
    if said != expected:
        return f"config check says {said[:2]!r}, not {expected[:2]!r}"
    for line in lines:
        if ": E-CONFIG: " not in line or len(line) > _LONGEST_LINE or not line.isprintable():
            return f"not one clear line: {line[:300]!r}"
    return None


def _reason(error: ConfigError) -> str:
    return "syntax" if error.problems[0].key == "" else "value"


def _flaw_of_config(loaded: LoadedConfig, data: bytes | None) -> str | None:
    """Why a config should not have been accepted, or does not load back as what it was."""
    wrong = strict_configs.flaw(loaded.config.as_dict(), _SCHEMA)
    if wrong:
        return f"the values of an accepted config are not those of the schema: {wrong}"
    if data is not None:
        try:
            wrong = strict_configs.flaw(strict_configs.read(data), _SCHEMA)
        except strict_configs.BrokenError as broken:
            return f"accepted, though {broken}"
        if wrong:
            return f"accepted, though {wrong}"
    Path("again.yaml").write_text(resolved_yaml(loaded), encoding="utf-8")
    again = load_config("again.yaml").config
    return None if again == loaded.config else "the resolved values load back as another config"


def _judge_command(arguments: tuple[str, ...]) -> Verdict:
    code, out, err = _call(list(arguments))
    if code not in _EXIT_CODES:
        return Verdict("violation", f"exit code {code}: {err[-300:]!r}")
    if "Traceback" in out + err or "internal error" in err:
        return Verdict("violation", f"a traceback: {err[-300:]!r}")
    if code == 0:
        return Verdict("accepted", "command")
    is_help = not arguments or err.startswith("Usage:")  # a group without a command says what there is
    if not is_help and not _is_clear(err, as_json="--json" in arguments):
        return Verdict("violation", f"exit code {code} without a clear line: {err[:300]!r}")
    return Verdict("refused", f"command {code}")


def _is_clear(err: str, *, as_json: bool) -> bool:
    """Whether the last of standard error is the reason, as a line or as an object."""
    last = err.splitlines()[-1] if err else ""
    if last.startswith("{") and as_json:
        return set(json.loads(last)["error"]) >= {"code", "exit_code", "file", "message", "remedy"}
    return last.startswith("weathercoat: ") and " E-" in last


def _call(arguments: list[str]) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command line in this process."""
    out, err = (
        io.TextIOWrapper(io.BytesIO(), "utf-8", "backslashreplace", write_through=True) for _ in range(2)
    )
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = call(arguments)
    return code, *(stream.buffer.getvalue().decode("utf-8") for stream in (out, err))  # type: ignore[attr-defined]


def run(
    count: int | None, seed: int, *, seconds: float | None = None
) -> tuple[Counter[str], list[tuple[int, Case, Verdict]]]:
    """Judge `count` cases, or as many as `seconds` allow: how often each outcome, and the violations."""
    seeds = make_seeds()
    outcomes: Counter[str] = Counter()
    violations = []
    with Worker(
        judge, Case(arguments=("run", "c.yaml", "m.obj", "-o", "out", "--steps", "2")), seconds=3 * _SECONDS
    ) as worker:
        for number in case_numbers(count, seconds):
            case = make_case(seeds, seed, number)
            verdict = worker.judge(case)
            outcomes[f"{verdict.kind} {verdict.what}" if verdict.kind != "violation" else "violation"] += 1
            if verdict.kind == "violation":
                violations.append((number, case, verdict))
    return outcomes, violations


def main(arguments: list[str]) -> int:
    """The command; returns the number of violations."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz configs", description=__doc__)
    parser.add_argument("--count", type=int, help="cases; without it, as many as --seconds allow")
    parser.add_argument("--seconds", type=float, help="stop after so long")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int, help="judge only the case of this number")
    parser.add_argument("--output", type=Path, default=Path("build/fuzz"), help="folder of what is found")
    options = parser.parse_args(arguments)
    if options.only is not None:
        case = make_case(make_seeds(), options.seed, options.only)
        print(f"{_write(options.output, options.seed, options.only, case)}: {judge(case)}")
        return 0
    if options.count is None and options.seconds is None:
        parser.error("give --count or --seconds")
    start = time.monotonic()
    outcomes, violations = run(options.count, options.seed, seconds=options.seconds)
    for number, case, verdict in violations:
        print(f"{_write(options.output, options.seed, number, case)}: {verdict.what}")
    print(f"{outcomes.total()} configs and command lines in {time.monotonic() - start:.0f} s")
    for outcome, times in sorted(outcomes.items()):
        print(f"{times:8d} {outcome}")
    return len(violations)


def _write(folder: Path, seed: int, number: int, case: Case) -> Path:
    """Keep a case: the file, or the command line."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"config-{seed}-{number}.{'yaml' if case.data is not None else 'txt'}"
    shown = shlex.join(case.arguments) or shlex.join(f"--set={text}" for text in case.assignments)
    path.write_bytes(os.fsencode(shown) if case.data is None else case.data)
    return path
