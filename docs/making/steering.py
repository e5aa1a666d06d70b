"""Pictures of steering and of risk, on generated parts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

import weathercoat
from making.places import IMAGES, save_picture
from weathercoat.config.load import load_config
from weathercoat.masks.files import mask_source
from weathercoat.mesh.shapes import make_barrel, make_plate
from weathercoat.mesh.surface import Surface
from weathercoat.output.pictures import render_snapshot
from weathercoat.output.risk import draw_risk
from weathercoat.recording import picture_parameters
from weathercoat.run import prepare_simulation
from weathercoat.sim.risk import assess_risk
from weathercoat.sim.simulation import Simulation

FOLDER = IMAGES / "steering"
FACES, STEPS, SHARES = 16_000, 400, (0.35, 0.7, 1.0)
WIDTH, HEIGHT = 380, 300

# Strokes of the letters of RUST, in a box of 0.6 by 1.
LETTERS: Mapping[str, tuple[tuple[tuple[float, float], ...], ...]] = {
    "R": (
        ((0, 0), (0, 1), (0.5, 1), (0.6, 0.85), (0.6, 0.65), (0.5, 0.5), (0, 0.5)),
        ((0.25, 0.5), (0.62, 0)),
    ),
    "U": (((0, 1), (0, 0.2), (0.12, 0), (0.48, 0), (0.6, 0.2), (0.6, 1)),),
    "S": (
        (
            (0.6, 0.85), (0.48, 1), (0.12, 1), (0, 0.85), (0, 0.62), (0.12, 0.52), (0.48, 0.48),
            (0.6, 0.38), (0.6, 0.15), (0.48, 0), (0.12, 0), (0, 0.15),
        ),
    ),
    "T": (((0, 1), (0.6, 1)), ((0.3, 1), (0.3, 0))),
}  # fmt: skip

CASES = {
    "stripe": (
        "stripe",
        "[{change: adhesion, multiply: 2}, {change: adhesion, multiply: 0.15, by: {color: r}}]",
    ),
    "foot": (
        "barrel",
        "[{change: adhesion, multiply: 2},"
        " {change: adhesion, multiply: 0.4, by: {height: {to: 0.05, soft: 0.4}}},"
        " {change: protection, set: 0.7, by: {height: {from: 0.6, soft: 0.3}}}]",
    ),
    "weather_side": (
        "barrel",
        "[{change: adhesion, multiply: 2}, {change: adhesion, multiply: 0.4,"
        " by: {direction: {towards: [1, 0.2, 0.7], within: 25, soft: 60}}}]",
    ),
    "letters": (
        "plate",
        "[{guide: word.csv, width: 0.008}, {change: cohesion, multiply: 3}, {change: adhesion, multiply: 2},"
        " {change: adhesion, multiply: 0.2, by: {line: {points: word.csv, within: 0.015, soft: 0.03}}}]",
    ),
}


def draw_steering() -> None:
    """One picture for each case, with its states from left to right, and that of the risk before the run."""
    for name, (part, entries) in CASES.items():
        with TemporaryDirectory() as folder:
            simulation = _prepare(part, entries, Path(folder))
        if name == "weather_side":
            save_picture(
                Image.fromarray(draw_risk(simulation.surface, assess_risk(simulation))), FOLDER / "risk.webp"
            )
        save_picture(_states(simulation), FOLDER / f"{name}.webp")


def _prepare(part: str, entries: str, folder: Path) -> Simulation:
    surface = _part(part)
    (folder / "word.csv").write_text(word_csv("RUST"), encoding="utf-8")
    config = folder / "own.yaml"
    config.write_text(f"steering: {entries}\nageing: {{steps: {STEPS}}}\n", encoding="utf-8")
    loaded = load_config(config)
    meshed = weathercoat.remesh(surface, faces=FACES)
    return prepare_simulation(meshed, loaded.config, surface, masks=mask_source(loaded))


def _part(name: str) -> Surface:
    if name == "barrel":
        return make_barrel()
    plate = make_plate(1.0, 1.0, 80, 80)
    if name == "plate":
        return plate
    low = plate.vertices.min(axis=0)
    across = np.abs(np.sum(plate.vertices - low, axis=1) - 1.0) / np.sqrt(2.0)
    colors = np.ones((len(plate.vertices), 4))
    colors[:, 0] = across < 0.09
    return replace(plate, colors=colors)


def word_csv(word: str) -> str:
    """The strokes of a word on the sample plate, a unit square that stands on its middle."""
    rows = []
    for number, letter in enumerate(word):
        for stroke in LETTERS[letter]:
            rows += [f"{-0.41 + 0.215 * number + 0.27 * x:.3f},{0.35 + 0.3 * y:.3f},0" for x, y in stroke]
            rows.append("")
    return "\n".join(rows) + "\n"


def _states(simulation: Simulation) -> Image.Image:
    sheet = Image.new("RGB", (WIDTH * len(SHARES), HEIGHT))
    look = replace(picture_parameters(load_config("standard").config), width=WIDTH, height=HEIGHT)
    for number, share in enumerate(SHARES):
        while simulation.step_count < share * simulation.steps:
            simulation.step()
        image = render_snapshot(simulation.snapshot(), look, up=simulation.surface.up)
        sheet.paste(Image.fromarray(image), (number * WIDTH, 0))
    return sheet
