"""Tolerance files: what they may say, and every problem with its line."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from weathercoat.comparison.tolerance import LEVEL, Rule, Tolerance, read_tolerance
from weathercoat.errors import ConfigError


def _write(folder: Path, text: str) -> Path:
    path = folder / "tolerance.yaml"
    path.write_text(text)
    return path


def test_a_file_says_everything(tmp_path: Path) -> None:
    text = """\
level: 0.05
omit: [dust, "piece_*"]
figures:
  flakes: {relative: 0.1, absolute: 2}
  "*_share": {sigmas: 4}
positions: 0.01
distances: 0.02
pictures: 0.1
"""
    tolerance = read_tolerance(_write(tmp_path, text))
    assert tolerance == Tolerance(
        level=0.05,
        omitted=("dust", "piece_*"),
        rules=(Rule("flakes", absolute=2.0, relative=0.1), Rule("*_share", sigmas=4.0)),
        positions=0.01,
        distances=0.02,
        pictures=0.1,
    )
    assert tolerance.is_omitted("piece_roundness")
    assert not tolerance.is_omitted("pieces")
    assert tolerance.rule_of("lost_share") == tolerance.rules[1]
    assert tolerance.rule_of("raised") is None


def test_the_example_of_the_docs_is_valid(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "regression.md").read_text(encoding="utf-8")
    example = page.partition("## Tolerances")[2].partition("```yaml\n")[2].partition("```")[0]
    tolerance = read_tolerance(_write(tmp_path, example))
    assert {rule.pattern for rule in tolerance.rules} == {"flakes", "*_share"}
    assert tolerance.pictures < math.inf


def test_an_empty_file_is_the_default(tmp_path: Path) -> None:
    tolerance = read_tolerance(_write(tmp_path, "# nothing\n"))
    assert tolerance == Tolerance()
    assert tolerance.level == LEVEL
    assert tolerance.positions == math.inf


def test_the_largest_limit_counts() -> None:
    rule = Rule("*", absolute=0.5, relative=0.1, sigmas=3.0)
    assert rule.allowed(1.0, -2.0, spread=0.1) == 0.5
    assert rule.allowed(10.0, 4.0, spread=0.1) == 1.0
    assert rule.allowed(1.0, 2.0, spread=1.0) == 3.0


@pytest.mark.parametrize(
    ("text", "line", "key", "what"),
    [
        ("levle: 0.1", 1, "levle", "did you mean level?"),
        ("flakes: {relative: 0.1}", 1, "flakes", "figures go below figures"),
        ("\nlevel: 0", 2, "level", "must be a number from 1e-06 to 0.5, not 0"),
        ("level: yes", 1, "level", "must be a number"),
        ("positions: -1", 1, "positions", "must be a number of at least 0, not -1"),
        ("pictures: .nan", 1, "pictures", "must be a number"),
        ("omit:\n  - 3", 2, "omit", "must be a list of names"),
        ("omit: [lost]", 1, "omit", "fits no figure; there are separated_share"),
        ("figures: [flakes]", 1, "figures", "must be a mapping"),
        ("figures:\n  flaks: {relative: 1}", 2, "figures.flaks", "did you mean flakes?"),
        ("figures:\n  flakes: 0.1", 2, "figures.flakes", "absolute, relative or sigmas"),
        ("figures:\n  flakes:\n    sigma: 3", 3, "figures.flakes.sigma", "did you mean sigmas?"),
        ("figures:\n  flakes:\n    sigmas: -3", 3, "figures.flakes.sigmas", "of at least 0"),
    ],
)
def test_problems_have_their_line(tmp_path: Path, text: str, line: int, key: str, what: str) -> None:
    path = _write(tmp_path, text)
    with pytest.raises(ConfigError) as raised:
        read_tolerance(path)
    (problem,) = raised.value.problems
    assert (problem.where, problem.line, problem.key) == (str(path), line, key)
    assert what in problem.what


def test_a_missing_file_is_a_problem(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        read_tolerance(tmp_path / "none.yaml")
