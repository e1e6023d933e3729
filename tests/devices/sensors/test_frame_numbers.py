from itertools import product

import numpy as np
import pytest

from midair.devices.sensors.frame_numbers import CountedFrames, StampedFrames, StatedRate, SteadyStamps
from midair.errors import RateError


def blocks(values, size):
    return [values[at : at + size] for at in range(0, len(values), size)]


@pytest.mark.parametrize("dtype", ["float32", "int8", "int16", "int32"])
def test_a_counter_of_any_type_counts_on_when_it_is_full(dtype):
    kind = np.dtype(dtype)
    full = 2 ** (8 * kind.itemsize) if kind.kind == "i" else 2 ** (np.finfo(kind).nmant + 1)
    # The sender's own count, which begins shortly before it is full, with 5 and 60 frames left out.
    sent = np.concatenate([np.arange(400), np.arange(405, 900), np.arange(960, 1500)])
    for start in (0, 1, 77):
        raw = [int(each) + full // (2 if kind.kind == "i" else 1) - 700 + start for each in sent]
        wrapped = [(each + full // 2) % full - full // 2 if kind.kind == "i" else each % full for each in raw]
        frames = CountedFrames(kind)
        found = np.concatenate([frames.number(part) for part in blocks(np.array(wrapped, kind).astype(float), 64)])
        np.testing.assert_array_equal(found, sent)
        assert frames.frames == 1500


def test_a_float32_counter_that_is_no_longer_exact_gives_none():
    """From 2^24 on a sender that increments it stands still, one that casts it skips every second number."""
    frames = CountedFrames(np.dtype("float32"))
    counter = 2.0**24 - 150 + np.arange(300)
    assert len(frames.number(counter[:100])) == 100
    assert frames.number(np.minimum(counter[100:], 2**24)) is None
    assert frames.frames == 100


def test_a_counter_that_goes_back_is_refused():
    for dtype in ("float32", "float64", "int32"):
        frames = CountedFrames(np.dtype(dtype))
        frames.number(np.arange(5000.0, 5100))
        with pytest.raises(ValueError, match="back"):
            frames.number(np.arange(100.0))


def stream(*, seconds, rate, push, jitter, ppm=0.0, lost=(), seed=0):
    """Blocks of true frame numbers and the stamps that liblsl assigns if the sender pushes every `push` s.

    `lost` holds (number, count).
    """
    rng = np.random.default_rng(seed)
    true = np.arange(round(seconds * rate))
    gone = np.zeros(len(true), bool)
    for number, count in lost:
        gone[number : number + count] = True
    taken = true / rate / (1 + ppm * 1e-6)
    now, sent = 0.0, 0
    while sent < len(true):
        now += push
        ready = np.searchsorted(taken, now, side="right")
        numbers = true[sent:ready][~gone[sent:ready]]
        sent = ready
        if len(numbers):
            stamp = 1000 + now + rng.exponential(jitter)
            yield numbers, stamp - np.arange(len(numbers))[::-1] / rate


def numbered(rate, made, **how):
    frames = StampedFrames(rate, **how)
    true, found = [], []
    for numbers, stamps in made:
        true.append(numbers)
        found += list(frames.add(numbers[:, None], stamps))
    found += list(frames.rest())
    given = np.concatenate([run.samples[:, 0] for run in found])
    np.testing.assert_array_equal(given, np.concatenate(true))
    return np.concatenate([np.arange(run.first, run.first + len(run.samples)) for run in found]), given


@pytest.mark.long
@pytest.mark.parametrize("ppm", [-200, 0, 200])
@pytest.mark.parametrize(("rate", "push", "jitter"), [(1000, 4e-3, 2e-4), (1000, 20e-3, 1e-3), (48000, 10e-3, 2e-4)])
def test_no_gap_is_found_where_there_is_none(ppm, rate, push, jitter):
    seconds = 60 if rate == 1000 else 10
    found, true = numbered(rate, stream(seconds=seconds, rate=rate, push=push, jitter=jitter, ppm=ppm))
    np.testing.assert_array_equal(found, true)


@pytest.mark.parametrize("ppm", [-200, 0, 200])
@pytest.mark.parametrize(
    ("rate", "push", "jitter", "count"), [(1000, 4e-3, 2e-4, 100), (1000, 20e-3, 1e-3, 100), (48000, 10e-3, 2e-4, 960)]
)
def test_frames_that_never_came_are_found_where_they_were(ppm, rate, push, jitter, count):
    at = round(2.4 * rate)
    made = stream(seconds=6, rate=rate, push=push, jitter=jitter, ppm=ppm, lost=[(at, count), (2 * at, 3 * count)])
    found, true = numbered(rate, made)
    steps = np.diff(found)
    # To within a push, where; and to within the jitter of the earliest stamps, how many.
    places = np.flatnonzero(steps > 1)
    assert len(places) == 2
    assert np.abs(true[places] - (at, 2 * at)).max() <= push * rate + 1
    assert np.abs(steps[places] - 1 - (count, 3 * count)).max() <= max(2, 2 * jitter * rate + 2e-4 * rate)


def test_a_late_push_is_no_gap():
    made = list(stream(seconds=6, rate=1000, push=4e-3, jitter=2e-4))
    for late in (700, 1000, 1030):
        numbers, stamps = made[late]
        made[late] = numbers, stamps + 0.15
    found, true = numbered(1000, made)
    np.testing.assert_array_equal(found, true)


def test_frames_wait_until_it_is_certain_and_no_longer():
    frames = StampedFrames(1000)
    for numbers, stamps in stream(seconds=3, rate=1000, push=4e-3, jitter=1e-4):
        assert sum(len(run.samples) for run in frames.add(numbers[:, None], stamps)) == len(numbers)
    after = 1003 + 0.5 + np.arange(200) / 1000
    assert list(frames.add(np.zeros((200, 1)), after)) == []
    given = list(frames.add(np.zeros((200, 1)), after + 0.2))
    assert given[0].first == pytest.approx(3500, abs=3)
    assert sum(len(run.samples) for run in given) == 400


def arriving(shift, *, lost=()):
    """Numbers, lost frames and jumps found in six seconds whose stamps are off by `shift` (of the true numbers)."""
    rng, frames = np.random.default_rng(0), StampedFrames(1000)
    steady, found = SteadyStamps(1000), []
    for block in blocks(np.arange(6000), 10):
        sent = block[~np.isin(block, lost)]
        if len(sent):
            arrived = 100 + (block[-1] + 1) / 1000 + 0.01 + rng.exponential(0.005)
            stamps = 100 + sent / 1000 + rng.normal(0, 2e-4, len(sent)) + shift(sent)
            found += list(map(steady.steady, frames.add(sent[:, None], stamps, arrived=arrived)))
    found += list(map(steady.steady, frames.rest()))
    # The corrected stamps stay on the first clock, so that no jump is measured as drift.
    assert np.ptp([run.stamp - run.first / 1000 for run in found]) < 0.21
    true = np.concatenate([run.samples[:, 0] for run in found])
    number = np.concatenate([np.arange(run.first, run.first + len(run.samples)) for run in found])
    return number, true, [(run.first, round(run.jump, 2)) for run in found if run.jump]


@pytest.mark.parametrize("by", [-3.0, 3.0, -0.5, 0.5])
def test_stamps_that_jump_are_reported_and_lose_no_frames(by):
    """Before, a jump forwards became lost frames, and one backwards a drift of 234,733 ppm."""
    number, true, jumps = arriving(lambda sent: np.where(sent >= 3000, by, 0))
    np.testing.assert_array_equal(number, true)
    assert jumps == [(3000, by)]


def test_a_wrong_stamp_a_small_step_and_lost_frames_are_no_jump_and_lose_nothing():
    for by in (-3.0, -0.1, 3.0):
        number, true, _ = arriving(lambda sent, by=by: np.where(sent == 3004, by, 0))
        np.testing.assert_array_equal(number, true)
    for shift, count in ((0, 50), (0, 100), (0, 700), (-0.1, 0)):
        step = lambda sent, shift=shift: np.where(sent >= 3000, shift, 0)  # noqa: E731
        number, true, jumps = arriving(step, lost=range(3000, 3000 + count))
        np.testing.assert_array_equal(number, true)
        assert jumps == []


@pytest.mark.parametrize(("rate", "chunk", "after"), [(500, 1, 0.3), (500, 50, 1), (2000, 1, 2.1), (2000, 50, 2.1)])
def test_a_sender_of_another_rate_is_refused_and_one_of_the_stated_rate_is_not(rate, chunk, after):
    """Before, 1126 of 3000 frames were invented."""
    for push, lost in product((1e-3, 20e-3, 50e-3), ((), [(50, 60)])):
        stated = StatedRate(1000)
        for _, stamps in stream(seconds=3, rate=1000, push=push, jitter=2e-3, lost=lost):
            stated.check(stamps)
    stated = StatedRate(1000)
    stamps = np.repeat(np.arange(0, 4000, chunk) / rate, chunk)
    with pytest.raises(RateError, match=rf"expected stamps 1 ms apart at the stated 1000 Hz, got {1e3 / rate:g}"):
        for block in blocks(stamps[: round(after * 1000)], 10):
            stated.check(block)
