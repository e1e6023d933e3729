from dataclasses import replace

import pytest

from midair.errors import BrokenFileError, MismatchError
from midair.sweep.pattern_sweep import PatternSweep
from midair.sweep.store import check_settings

SWEEP = PatternSweep(count=10)
STORED = {"kind": "patterns", "settings": SWEEP.settings()}


def test_the_same_settings_pass():
    check_settings("s.zarr", STORED, SWEEP)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"seed": 7}, "seed 7, got a sweep with 2024"),
        ({"strengths": (0.1, 0.3)}, "strengths 1 0.3, got a sweep with 0.2"),
        ({"iterations": 7}, "iterations 7, got a sweep with None"),
    ],
    ids=str,
)
def test_the_first_that_differs_is_named(change, words):
    with pytest.raises(MismatchError, match=words):
        check_settings("s.zarr", STORED, replace(SWEEP, **change))


def test_another_kind_is_another_sweep():
    with pytest.raises(MismatchError, match="kind patterns, got a sweep with recordings"):
        check_settings("s.zarr", STORED | {"kind": "recordings"}, SWEEP)


def test_a_store_without_settings_is_no_sweep():
    with pytest.raises(BrokenFileError, match=r"s\.zarr"):
        check_settings("s.zarr", {}, SWEEP)
