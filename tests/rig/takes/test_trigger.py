import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.rig.takes.meters import PreRoll, Trigger

RATE = 1000.0


def flags(samples, level=0.5, block=50):
    trigger = Trigger(level, RATE)
    return np.concatenate([trigger.exceeded(samples[first : first + block]) for first in range(0, len(samples), block)])


def test_the_first_frame_past_the_level_is_found_about_any_rest():
    samples = np.full((1000, 2, 2), 100.0)
    samples[:, 1, 1] = -3
    samples[612:640, 1, 0] += 0.6
    samples[700:710, 1, 1] -= 0.6
    assert flags(samples).nonzero()[0].tolist() == [*range(612, 640), *range(700, 710)]


def test_rest_follows_a_slow_drift_and_not_a_touch():
    """1 V in 10 s is .05 V behind at a time constant of half a second; a touch of 2 s does not become rest."""
    samples = np.linspace(0, 1, 10_000)[:, None, None] + np.zeros((10_000, 1, 1))
    assert not flags(samples, level=0.2).any()
    held = np.zeros((4000, 1, 1))
    held[1000:3000] = 1.0
    assert flags(held).nonzero()[0].tolist() == list(range(1000, 3000))


@pytest.mark.parametrize("block", [1, 13, 50])
def test_noise_below_the_level_is_no_touch(block):
    samples = np.random.default_rng(0).normal(5, 0.1, (2000, 4, 4))
    assert not flags(samples, level=1.0, block=block).any()


@given(st.integers(0, 30), st.lists(st.integers(0, 20), max_size=20))
def test_the_pre_roll_holds_the_last_frames(size, blocks):
    roll, at = PreRoll(size), 0
    for count in blocks:
        roll.add(np.arange(at, at + count, dtype=float).reshape(-1, 1, 1))
        at += count
    kept = roll.take()
    expected = np.arange(at)[max(0, at - size) :] if size else np.zeros(0)
    assert (kept is None) == (len(expected) == 0)
    if kept is not None:
        np.testing.assert_array_equal(kept.ravel(), expected)
    assert roll.take() is None


def test_the_pre_roll_keeps_no_more_memory_than_it_needs():
    roll = PreRoll(100)
    for _ in range(1000):
        roll.add(np.zeros((30, 4, 4)))
    assert sum(len(part) for part in roll._parts) <= 130
