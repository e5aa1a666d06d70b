"""Physical units, and what follows from them."""

from __future__ import annotations

from pathlib import Path

import pytest

from weathercoat.config.load import load_config
from weathercoat.config.physical import SUSTAINED, curl_radius, peel_stress, physical_values
from weathercoat.config.schema import Physical
from weathercoat.errors import ConfigError

PAINT = ["physical.stress=3", "physical.thickness=90", "physical.modulus=1.8", "physical.size=0.6"]


def test_the_radius_is_stoneys() -> None:
    """The skin as Stoney's film, the rest of the coat as his plate."""
    stress, thickness, modulus, poisson, skin = 2.5e6, 80e-6, 2.2e9, 0.33, 0.25
    film, plate = skin * thickness, (1.0 - skin) * thickness
    expected = modulus * plate**2 / (6.0 * (1.0 - poisson) * film * stress)
    assert curl_radius(2.5, 80.0, 2.2, poisson, skin) == pytest.approx(expected, rel=1e-12)


def test_the_peel_stress_is_the_moment_that_holds_the_coat_flat() -> None:
    stress, thickness, modulus, poisson, skin = 4e6, 120e-6, 1.1e9, 0.4, 0.35
    radius = curl_radius(4.0, 120.0, 1.1, poisson, skin)
    moment = modulus * thickness**3 / (12.0 * (1.0 - poisson) * radius)
    assert peel_stress(4.0, skin) * 1e6 == pytest.approx(moment / thickness**2, rel=1e-12)
    assert stress > 0


def test_lift_over_adhesion_on_a_flat_is_peel_stress_over_sustained_strength() -> None:
    lift = physical_values(Physical(stress=2.0, adhesion=5.0))["lift.coefficient"]
    assert 3.0 * lift == pytest.approx(peel_stress(2.0, 0.3) / (SUSTAINED * 5.0), rel=1e-5)


def test_a_common_coat_comes_near_the_defaults() -> None:
    values = physical_values(
        Physical(years=15, stress=3, strength=2.25, adhesion=3, thickness=90, modulus=1.8, size=0.6)
    )
    defaults = load_config("standard").config
    assert values["ageing.duration"] == defaults.ageing.duration
    assert values["lift.coefficient"] == pytest.approx(defaults.lift.coefficient, rel=0.05)
    assert values["cohesion.base"] == pytest.approx(defaults.cohesion.base, rel=0.05)
    assert values["curl.radius"] == pytest.approx(defaults.curl.radius, rel=0.5)


def test_values_that_are_set_beside_or_after_it_stay(tmp_path: Path) -> None:
    assert load_config("curling", PAINT).config.curl.radius == pytest.approx(0.0376923)
    assert load_config("curling", [*PAINT, "curl.radius=0.2"]).config.curl.radius == 0.2
    file = tmp_path / "paint.yaml"
    file.write_text("preset: curling\nphysical: {years: 30, lifetime: 10}\ncurl: {radius: 0.3}\n")
    config = load_config(file).config
    assert (config.ageing.duration, config.curl.radius) == (3.0, 0.3)
    loaded = load_config(file, PAINT)
    assert loaded.config.curl.radius == pytest.approx(0.0376923), "options come after the file"
    assert loaded.origins["ageing.duration"] == "physical"


def test_what_sets_nothing_is_refused() -> None:
    with pytest.raises(ConfigError) as refused:
        load_config("standard", ["physical.modulus=2", "physical.years=3"])
    (problem,) = refused.value.problems
    assert problem.key == "physical.modulus"
    assert "stress and thickness and size" in problem.what


def test_what_follows_is_held_to_the_bounds_of_its_key() -> None:
    with pytest.raises(ConfigError, match=r"deformation\.film_thickness"):
        load_config("standard", ["physical.thickness=90", "physical.size=1e3"])


def test_configs_go_together_by_a_plus(tmp_path: Path) -> None:
    both = load_config("rusting+c5").config
    assert both.rust == load_config("rusting").config.rust
    assert both.environment == load_config("c5").config.environment
    file = tmp_path / "mine.yaml"
    file.write_text("preset: c4\ndust: {rate: 3}\n")
    mine = load_config(f"rusting+{file}").config
    assert (mine.dust.rate, mine.environment.corrosion, mine.curl.radius) == (3, 1.7, 0.15)
    strange = tmp_path / "a+b.yaml"
    strange.write_text("seed: 7\n")
    assert load_config(strange).config.seed == 7
    with pytest.raises(ConfigError, match="no shipped config 'nothing'"):
        load_config("nothing+rusting")
