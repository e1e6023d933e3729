from dataclasses import fields, is_dataclass

import pytest

from midair.errors import InputError
from midair.model import Acoustics, Medium
from midair.settings import CHOICES, MODES, Settings, format_setting, nearest_mode

# Settings without an option: parts of settings that have one, and constants of the array.
PYTHON_ONLY = {
    "target.grid.columns": "points",
    "target.grid.centre": "of the array",
    "compensation.dynamics": "of the transducers",
    "compensation.ramp": "of the silencer",
    "solver.guard": "guard, its margin",
    "target.circle": "circle, its radius",
    **{f"acoustics.medium.{name}": "the air" for name in ("density", "speed", "attenuation", "alpha")},
}


def leaves(value, before=""):
    for one in fields(value):
        got, path = getattr(value, one.name), f"{before}{one.name}"
        if is_dataclass(got) and path not in PYTHON_ONLY:
            yield from leaves(got, f"{path}.")
        else:
            yield path


def test_every_setting_has_an_option_or_is_python_only():
    offered = {choice.path.removesuffix(".weight") for choice in CHOICES}
    assert {path for path in leaves(Settings()) if path not in offered} == set(PYTHON_ONLY)


def test_a_guard_that_is_given_by_its_width_has_that_margin_and_none_has_none():
    margin = next(choice for choice in CHOICES if choice.name == "guard")
    assert margin.of(Settings().but(guard=0.02)) == 0.02
    assert margin.of(Settings()) is None


def put(settings, name, value):
    return next(choice for choice in CHOICES if choice.name == name).put(settings, value)


def test_a_temperature_is_the_air_of_a_laboratory_and_the_surface_stays():
    soft = Settings(acoustics=Acoustics(medium=Medium(alpha=1.5), directivity="piston"))
    warm = put(put(soft, "temperature", 26.0), "humidity", 0.3)
    assert warm.acoustics == Acoustics(
        medium=Medium.at(temperature=26.0, humidity=0.3, alpha=1.5), directivity="piston"
    )
    assert put(soft, "temperature", 26.0).acoustics.medium.humidity == 0.5


def test_a_humidity_without_a_temperature_is_refused():
    with pytest.raises(InputError, match="--humidity: expected --temperature beside it"):
        put(Settings(), "humidity", 0.3)


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("target.grid.height", 0.2, "200mm"),
        ("calibration.band", (20.0, 470.0), "20Hz 470Hz"),
        ("acoustics.medium.speed", 345.0, "345m/s"),
        ("compensation.dynamics.time_constant", 1.9e-4, "0.00019s"),
        ("solver.method.near", 0.2, "0.2"),
        ("target.strength", None, "default"),
    ],
)
def test_a_setting_is_formatted_with_its_unit(path, value, words):
    assert format_setting(path, value) == words


@pytest.mark.parametrize("mode", MODES)
def test_settings_are_their_mode_and_what_differs_from_it(mode):
    settings = MODES[mode]()
    assert nearest_mode(settings) == (mode, {})
    assert nearest_mode(settings.but(gain=2.0, level=0.5)) == (mode, {"gain": 2.0, "level": 0.5})
    assert nearest_mode(settings.but(ramp=1e-3)) is None, "no choice sets it"
