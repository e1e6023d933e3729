"""Every setting can be typed, but for those that are known to be Python's."""

from dataclasses import fields, is_dataclass

from midair.settings import CHOICES, Settings

# What only Python can say: parts of what has an option, and constants of the array.
PYTHON_ONLY = {
    "target.grid.columns": "points",
    "target.grid.centre": "of the array",
    "compensation.dynamics": "of the transducers",
    "compensation.ramp": "of the silencer",
    "solver.guard": "guard, its margin",
    "target.circle": "circle, its radius",
    "acoustics.medium": "the air",
}


def leaves(value, before=""):
    for one in fields(value):
        got, path = getattr(value, one.name), f"{before}{one.name}"
        if is_dataclass(got) and path not in PYTHON_ONLY:
            yield from leaves(got, f"{path}.")
        else:
            yield path


def test_every_setting_is_a_choice_or_known_to_be_python_s():
    offered = {choice.path for choice in CHOICES}
    assert {path for path in leaves(Settings()) if path not in offered} == set(PYTHON_ONLY)


def test_a_guard_that_is_given_by_its_width_has_that_margin_and_none_has_none():
    margin = next(choice for choice in CHOICES if choice.name == "guard")
    assert margin.of(Settings().but(guard=0.02)) == 0.02
    assert margin.of(Settings()) is None
