"""The results of the benchmark as tables: for the terminal, for Markdown, and as rows of a CSV."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from weathercoat.bench.cases import STAGES
from weathercoat.bench.files import rows_as_csv

Table = list[list[str]]  # the first row is the heading


def stage_table(results: dict[str, Any]) -> Table:
    """Seconds for 1,000 steps by stage, each with the paper's below it where it has such a mesh."""
    table = [["", "faces", *STAGES, "total", "CPU", "times faster"]]
    for case in results["cases"]:
        stages = [digits(case["seconds"][name]) for name in (*STAGES, "total")]
        paper = case["paper"]
        faster = f"{paper['times_faster']:.1f}" if paper else ""
        table.append([case["label"], f"{case['faces']:,}", *stages, digits(case["cpu_seconds"]), faster])
        if paper:
            theirs = [digits(paper["seconds"][name]) for name in (*STAGES, "total")]
            table.append([f"paper: {paper['name']}", f"{paper['faces']:,}", *theirs, "", ""])
    exponents = results["growth"]["exponents"]
    if exponents["total"] is not None:
        grown = [
            "" if exponents.get(name) is None else f"{exponents[name]:.2f}" for name in (*STAGES, "total")
        ]
        table.append(["growth exponent", "", *grown, "", ""])
    return table


def step_table(results: dict[str, Any]) -> Table:
    """Milliseconds per step and per sweep, constraints in a second, and memory."""
    heading = [
        "",
        "ms/step",
        "at 60 %",
        "steps/s",
        "ms/sweep",
        "floor",
        "plain",
        "ratio",
        "lengths",
        "angles",
    ]
    table = [[*heading, "constraints/s", "memory"]]
    for case in results["cases"]:
        sweep, speed = case["sweep"], case["steps_per_second"]
        memory = case["memory_bytes"]
        table.append(
            [
                case["label"],
                digits(case["step_ms"]),
                digits(case["step_ms_at_end"]),
                f"{digits(speed[0])} to {digits(min(speed))}",
                digits(sweep["ms"]),
                digits(sweep["floor_ms"]),
                digits(sweep["plain_ms"]),
                f"{sweep['times_plain']:.1f}",
                f"{sweep['lengths']:,}",
                f"{sweep['angles']:,}",
                f"{sweep['constraints_per_second'] / 1e6:.0f} M",
                "" if memory is None else f"{memory / 1e6:,.0f} MB",
            ]
        )
    return table


def peer_table(results: dict[str, Any]) -> Table:
    """Milliseconds per sweep beside the peer's; only a heading where it was not timed."""
    table = [["", "lengths", "angles", "weathercoat", "pypbd", "ratio"]]
    for case in results["cases"]:
        if case["peer"]:
            sweep, peer = case["sweep"], case["peer"]
            counts = [f"{sweep['lengths']:,}", f"{sweep['angles']:,}"]
            row = [case["label"], *counts, digits(sweep["ms"]), digits(peer["ms"])]
            table.append([*row, f"{peer['times_ours']:.1f}"])
    return table


def variant_table(results: dict[str, Any]) -> Table:
    """Each variant beside what it varies: how much faster, and how far apart they end, in mean edges."""
    table = [["", "ms/step", "at 60 %", "times faster", "faster at 60 %", "RMS", "99 %", "largest"]]
    by_label = {case["label"]: case for case in results["cases"]}
    for case in results["cases"]:
        if case["variant_of"]:
            base, gap = by_label[case["variant_of"]], case["apart"]
            faster = [f"{base[name] / case[name]:.2f}" for name in ("step_ms", "step_ms_at_end")]
            gaps = [digits(gap[name]) for name in ("rms", "percentile_99", "largest")]
            times = [digits(case[name]) for name in ("step_ms", "step_ms_at_end")]
            table.append([case["label"], *times, *faster, *gaps])
    return table


def load_table(results: dict[str, Any]) -> Table:
    """What each run came to, and how much of it was timed."""
    table = [["", "steps timed", "separated", "breaks per 10,000 faces", "fallen"]]
    for case in results["cases"]:
        load = case["load"]
        table.append(
            [
                case["label"],
                f"{case['timed_steps']:,} of {case['steps']:,}",
                f"{load['separated_share']:.1%}",
                f"{load['broken_edges'] / case['faces'] * 1e4:,.0f}",
                f"{load['lost_share']:.1%}",
            ]
        )
    return table


def machine_lines(results: dict[str, Any]) -> list[str]:
    """The machine, its versions, and what it can do at most."""
    machine = results["machine"]
    warm_up = machine["warm_up"]
    compiled = warm_up["compiled_kernels"]
    what = f"compiling {compiled} kernels" if compiled else "loading the compiled kernels"
    return [
        *describe_lines(machine),
        f"One core copies {machine['copy_bandwidth'] / 1e9:.1f} GB/s (read and written) and does"
        f" {machine['arithmetic_peak'] / 1e9:.1f} GFlop/s in a vectorised kernel.",
        f"The first run of all, {what} included, took {warm_up['seconds']:.1f} s.",
    ]


def describe_lines(machine: dict[str, Any]) -> list[str]:
    """The machine with the date, and the versions."""
    return [
        f"{machine['cpu']}, {machine['cores']} cores, {machine['system']}, {machine['date']}",
        ", ".join(f"{name} {number}" for name, number in machine["versions"].items()),
    ]


def as_text(results: dict[str, Any]) -> Iterator[str]:
    """All tables for a terminal, line by line."""
    yield from machine_lines(results)
    titles = {
        "Seconds for 1,000 steps": stage_table,
        "Steps, and one sweep at the end": step_table,
        "One sweep beside the peer's, ms": peer_table,
        "Variants: speed, and how far from the base they end, in mean edges": variant_table,
        "The situation at the end": load_table,
    }
    for title, make in titles.items():
        table = make(results)
        if len(table) > 1:
            yield from ("", title)
            yield from as_lines(table)


def as_lines(table: Sequence[Sequence[str]]) -> Iterator[str]:
    """A table for a terminal, its first column to the left and the others to the right."""
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for row in table:
        first, *others = (cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        yield f"{first.strip():{widths[0]}}  " + "  ".join(others)


def as_markdown(table: Sequence[Sequence[str]]) -> str:
    """A table in Markdown, its first column to the left and the others to the right."""
    heading, *rows = table
    lines = [heading, ["---", *["---:"] * (len(heading) - 1)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def as_csv(results: dict[str, Any]) -> str:
    """The figures of each case on a line, all times in the unit that the column names."""
    return rows_as_csv([_csv_row(case) for case in results["cases"]])


def _csv_row(case: dict[str, Any]) -> dict[str, Any]:
    sweep, peer = case["sweep"], case["peer"]
    return {
        **{name: case[name] for name in ("label", "faces", "steps", "timed_steps", "repeats")},
        **{f"{name}_s": seconds for name, seconds in case["seconds"].items()},
        "cpu_s": case["cpu_seconds"],
        "step_ms": case["step_ms"],
        "step_at_end_ms": case["step_ms_at_end"],
        "sweep_ms": sweep["ms"],
        "plain_sweep_ms": sweep["plain_ms"],
        "peer_sweep_ms": peer["ms"] if peer else None,
        "lengths": sweep["lengths"],
        "angles": sweep["angles"],
        "constraints_per_s": sweep["constraints_per_second"],
        "memory_bytes": case["memory_bytes"],
        **case["load"],
    }


def digits(value: float) -> str:
    """Three significant digits, and of large numbers all before the point."""
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"
