import json
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.sweep.task import settings_of


@dataclass(frozen=True)
class Inner:
    place: tuple[int, ...]
    path: Path


@dataclass(frozen=True)
class Outer:
    inner: Inner
    heights: dict


def test_settings_of_objects_at_hand():
    outer = Outer(inner=Inner(place=(1, 2), path=Path("a/b")), heights={150: 0.15, None: [True]})
    assert settings_of(outer) == {
        "inner": {"place": [1, 2], "path": str(Path("a/b"))},
        "heights": {"150": 0.15, "None": [True]},
    }
    assert settings_of(Inner) == str(Inner)  # a class is no object with settings


LEAVES = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text() | st.complex_numbers()


@pytest.mark.long
@given(st.recursive(LEAVES, lambda few: st.lists(few) | st.tuples(few, few) | st.dictionaries(st.integers(), few)))
def test_settings_equal_their_json_round_trip(thing):
    plain = settings_of(thing)
    assert json.loads(json.dumps(plain)) == plain
    assert settings_of(plain) == plain


@pytest.mark.parametrize("value", [0, 1.5, "a", None, True])
def test_json_values_are_unchanged(value):
    assert settings_of(value) is value
