"""A bounded run of the fuzzer, and the fuzzer itself: it repeats, and it finds what is wrong."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest

from tests.fuzz import files
from tests.fuzz.seeds import foreign_seeds, make_seeds, real_seeds
from tests.fuzz.workers import Verdict, Worker

COUNT = 900


def test_damaged_files_are_refused_or_come_in_whole() -> None:
    """The same files everywhere: those of every checkout, and a count, not a time."""
    found: list[object] = []
    outcomes = files.run(files.Sources(make_seeds()), COUNT, 20, lambda *violation: found.append(violation))
    assert found == []
    assert any(f"accepted {seed.extension}" in outcomes for seed in foreign_seeds())
    accepted = sum(times for outcome, times in outcomes.items() if outcome.startswith("accepted"))
    assert COUNT / 10 < accepted < COUNT / 2


def test_the_files_themselves_come_in() -> None:
    for seed in [*make_seeds(), *foreign_seeds()]:
        assert files.judge((seed.extension, seed.data)).kind == "accepted", seed.name


def test_cases_depend_on_seed_and_number_alone() -> None:
    sources = files.Sources(make_seeds())
    one = [files.make_case(sources, 3, number) for number in range(50)]
    assert one == [files.make_case(files.Sources(make_seeds()), 3, number) for number in range(50)]
    assert one != [files.make_case(sources, 4, number) for number in range(50)]


@pytest.mark.long
def test_damaged_real_files(meshes_folder: Path) -> None:
    sources = files.Sources(real_seeds())
    assert len(sources.own) > 40
    found: list[object] = []
    files.run(sources, 2000, 1, lambda *violation: found.append(violation))
    assert found == []


def misbehave(how: str) -> Verdict:
    """Break one of the promises."""
    match how:
        case "signal":
            os.kill(os.getpid(), signal.SIGSEGV)
        case "hang":
            time.sleep(60)
        case "memory":
            bytearray(2 << 30)
        case "error":
            raise KeyError("inside")
    return Verdict("accepted", how)


@pytest.mark.parametrize(
    ("how", "says"),
    [
        ("signal", "SIGSEGV"),
        ("hang", "no answer within 1 s"),
        ("memory", "MemoryError"),
        ("error", "KeyError: 'inside' (test_files.py:"),
    ],
)
def test_what_breaks_the_promise_is_found_and_the_next_is_judged(how: str, says: str) -> None:
    with Worker(misbehave, "well", seconds=1.0) as worker:
        verdict = worker.judge(how)
        assert verdict.kind == "violation"
        assert says in verdict.what
        assert worker.judge("well") == Verdict("accepted", "well")


def test_command_writes_what_it_finds_and_judges_it_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = Verdict("violation", "wrong")
    monkeypatch.setattr(Worker, "judge", lambda self, case: found)
    arguments = ["--count", "2", "--seed", "5", "--output", str(tmp_path)]
    assert files.main(arguments) == 2
    first, second, *_ = capsys.readouterr().out.splitlines()
    path = Path(first.removesuffix(": wrong"))
    content = path.read_bytes()
    assert second.endswith(": wrong")
    assert files.main(["--seed", "5", "--only", "0", "--output", str(tmp_path)]) == 0
    assert path.read_bytes() == content
    assert files.main(["--replay", str(path)]) == 0
    assert "violation" not in capsys.readouterr().out
