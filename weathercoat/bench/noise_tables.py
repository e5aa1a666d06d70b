"""The results of the benchmark of noise as tables: for the terminal, for Markdown, and as a CSV."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from weathercoat.bench.files import rows_as_csv
from weathercoat.bench.noise import THRESHOLDS
from weathercoat.bench.tables import Table, as_lines, describe_lines, digits
from weathercoat.comparison.statistics import FIGURES


def spread_table(results: dict[str, Any], parts: tuple[str, ...] = ("plate", "bracket")) -> Table:
    """Mean and standard deviation of each figure at the end, of the default config on two parts, and what is
    shipped for other models.
    """
    cases = [
        case for part in parts for case in results["spreads"]
        if case["part"] == part and case["config"] == "standard"
    ]  # fmt: skip
    rows = [["figure", *parts, "at one age", "mean over ages"]]
    for figure in FIGURES:
        shipped = results["figures"][figure]
        ends = [case["figures"][figure] for case in cases]
        cells = [f"{digits(end['mean'][-1])} ± {digits(end['spread'][-1])}" for end in ends]
        rows.append([figure, *cells, digits(shipped["at_an_age"]), digits(shipped["of_the_mean"])])
    return rows


def rates_table(results: dict[str, Any]) -> Table:
    """How often groups of runs are called different: such of one kind, and such of two."""
    heading = ["part", "runs", "false alarms", f"{THRESHOLDS[0]} against {THRESHOLDS[1]} found"]
    return [
        heading,
        *(
            [
                row["part"],
                f"{row['a']} against {row['b']}",
                f"{row['false_alarms']:.1%}",
                f"{row['power']:.1%}",
            ]
            for row in results["rates"]
        ),
    ]


def as_text(results: dict[str, Any]) -> Iterator[str]:
    """All tables for a terminal, line by line."""
    yield from describe_lines(results["machine"])
    yield from ("", f"{results['faces']:,} faces, {results['steps']:,} steps, {results['seeds']} seeds")
    yield from as_lines(spread_table(results))
    yield from ("", f"{results['trials']:,} judgements of groups of {results['judged']} other seeds")
    yield from as_lines(rates_table(results))


def as_csv(results: dict[str, Any]) -> str:
    """Each figure of each case at each age on a line."""
    rows = [
        {
            "part": case["part"],
            "config": case["config"],
            "figure": figure,
            "age": age,
            "mean": row["mean"][i],
            "spread": row["spread"][i],
        }
        for case in results["spreads"]
        for figure, row in case["figures"].items()
        for i, age in enumerate(case["ages"])
    ]
    return rows_as_csv(rows)
