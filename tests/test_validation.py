from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from midair.errors import InputError, NonFiniteError
from midair.validation import Declared, check_settings, frozen_array, setting


@given(hnp.arrays(np.float64, hnp.array_shapes(min_dims=2, max_dims=2), elements=st.floats(-1e9, 1e9)))
def test_the_copy_is_read_only(value):
    frozen = frozen_array(value, "x", ("a", "b"))
    assert (frozen == value).all()
    assert not np.shares_memory(frozen, value)
    with pytest.raises(ValueError, match="read-only"):
        frozen[0, 0] = 1


def test_a_non_finite_number_is_named_with_its_index():
    for bad in [np.nan, np.inf, -np.inf]:
        value = np.array([[0, 0], [0, 0], [0, bad]])
        with pytest.raises(NonFiniteError, match=r"x: .*\(2, 1\)"):
            frozen_array(value, "x", ("a", "b"))
        assert frozen_array(value, "x", ("a", "b"), finite=False).shape == (3, 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Oven(Declared):
    degrees: float = setting(20.0, "Temperature.", limits=(0, 300))
    timer: float | None = setting(60.0, "Time.", unit="s", limits=(0, np.inf), above=True)
    recipe: str | None = setting(None, "File with the recipe.", load=lambda path: f"read {path}")

    def __post_init__(self):
        check_settings(self)


def test_changed_settings_take_defaults_for_none_and_read_files():
    hot = Oven(degrees=200.0, timer=None)
    assert hot.but(degrees=180.0) == Oven(degrees=180.0, timer=None), "other values stay, also None"
    assert hot.but(degrees=None, timer=None) == Oven()
    assert hot.but(recipe="bread.toml").recipe == "read bread.toml"
    assert hot.but(recipe=Path("bread.toml")).recipe == "read bread.toml"
    with pytest.raises(InputError, match="degrees: expected 0 to 300") as wrong:
        hot.but(degrees=400.0)
    assert wrong.value.setting == "degrees"
    with pytest.raises(InputError, match="timer: expected above 0 s, got 0 s"):
        hot.but(timer=0.0)
