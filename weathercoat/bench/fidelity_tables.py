"""The results of the fidelity benchmark as tables, as CSV, and as the front that `quality` reads."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from weathercoat.bench.fidelity import heights_of, limits_of
from weathercoat.bench.fidelity_ways import Way
from weathercoat.bench.files import rows_as_csv
from weathercoat.bench.tables import Table, as_lines, describe_lines
from weathercoat.config.quality import LEVELS

_IMAGES = "picture, {} px"


def ways_table(results: dict[str, Any]) -> Table:
    """Every way from cheap to dear, with its errors; the last row is the noise floor."""
    heights = heights_of(results)
    heading = ["", "s", "areas", "cracks", "rims", "film, λ", "outline", *map(_IMAGES.format, heights)]
    table = [[*heading, "front"]]
    for row in sorted(results["ways"], key=lambda row: row["seconds"]["total"]):
        errors = row["errors"]
        table.append(
            [
                row["label"],
                f"{row['seconds']['total']:.3g}",
                *_figures(errors, results["shear_lag"]),
                *(f"{errors['image'][h]:.2f}" for h in heights),
                ", ".join(row["levels"]) or ("yes" if row["front"] else ""),
            ]
        )
    noise = _figures(results["noise"], results["shear_lag"])
    table.append(["two seeds at the reference", "", *noise, *("1" for _ in heights), ""])
    return table


def _figures(errors: dict[str, Any], shear_lag: float) -> list[str]:
    return [
        f"{errors['areas']:.1%}",
        f"{errors['spacing']:.1%}",
        f"{errors['rims']:.1%}",
        f"{errors['distance'] / shear_lag:.3f}",
        f"{errors['outline']:.1%}",
    ]


def as_text(results: dict[str, Any]) -> Iterator[str]:
    """All of it for a terminal, line by line."""
    yield from describe_lines(results["machine"])
    yield ""
    yield from as_lines(ways_table(results))


def as_csv(results: dict[str, Any]) -> str:
    """A line for each way, errors as they are in the JSON."""
    rows = []
    for row in results["ways"]:
        errors = {name: value for name, value in row["errors"].items() if not isinstance(value, dict)}
        images = {f"image_{height}": value for height, value in row["errors"]["image"].items()}
        about = {name: row[name] for name in ("label", "faces", "steps", "solver", "sweeps", "threads")}
        seconds = {f"{name}_s": value for name, value in row["seconds"].items()}
        rows.append(
            {**about, **seconds, **errors, **images, "front": row["front"], "levels": " ".join(row["levels"])}
        )
    return rows_as_csv(rows)


def make_front(results: dict[str, Any]) -> dict[str, Any]:
    """The content of `config/quality.json`: the ways that no other beats, from cheap to dear, the reference
    last; lengths in shear lags, pictures by pixels per shear lag.
    """
    shear_lag, resolution = results["shear_lag"], results["pixels_per_shear_lag"]
    reference, *others = [row for row in results["ways"] if row["front"]]
    others.sort(key=lambda row: row["seconds"]["total"])
    points = []
    for row in (*others, reference):
        way = Way(row["faces"], row["steps"], row["solver"], row["sweeps"])
        errors = row["errors"]
        points.append(
            {
                "edge_length": _rounded(way.edge_length() / shear_lag),
                "values": way.values(),
                "errors": None
                if row is reference
                else {
                    "areas": _rounded(errors["areas"]),
                    "spacing": _rounded(errors["spacing"]),
                    "distance": _rounded(errors["distance"] / shear_lag),
                    "image": {
                        str(_rounded(resolution[height])): _rounded(value)
                        for height, value in errors["image"].items()
                    },
                },
            }
        )
    named = {name: place for place, row in enumerate((*others, reference)) for name in row["levels"]}
    return {
        "measured": {key: results["machine"][key] for key in ("cpu", "date")},
        "points": points,
        "levels": {name: named[name] for name in LEVELS},
        "limits": {name: _rounded(limit) for name, limit in limits_of(results).items()},
    }


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")
