from dataclasses import replace

import pytest

from midair.errors import MismatchError
from midair.sweep.pattern_sweep import PatternSweep
from midair.sweep.store import check_settings

SWEEP = PatternSweep(count=10)
STORED = {"kind": "patterns", "settings": SWEEP.settings()}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"seed": 7}, "seed 7, got a sweep with 2024"),
        ({"strengths": (0.1, 0.3)}, "strengths 1 0.3, got a sweep with 0.2"),
        ({"iterations": 7}, "iterations 7, got a sweep with None"),
        ({"method": "gs-pat"}, "method gs-pat, got a sweep with fast"),
        ({"bits": 4}, "bits 4, got a sweep with 8"),
    ],
    ids=str,
)
def test_the_first_that_differs_is_named(change, words):
    with pytest.raises(MismatchError, match=words):
        check_settings("s.zarr", STORED, replace(SWEEP, **change))


def test_another_kind_is_another_sweep():
    with pytest.raises(MismatchError, match="kind patterns, got a sweep with recordings"):
        check_settings("s.zarr", STORED | {"kind": "recordings"}, SWEEP)
