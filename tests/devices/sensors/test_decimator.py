"""Rates, delays and aliases of the streaming filter, compared with sines in closed form and `dsp.resample`."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.devices.sensors.decimated import CENTRE, Decimator
from midair.dsp import resample

RATES = [(48000, 1000), (44100, 1000), (3000, 2000), (1200, 1000), (48000, 8000)]


made = cache(Decimator)


def through(x, rate, new_rate, pieces=(1000,)):
    decimator, out, at = made(rate, new_rate), [], 0
    decimator.restart()
    while at < len(x):
        size = pieces[len(out) % len(pieces)]
        out.append(decimator.push(x[at : at + size]))
        at += size
    return np.concatenate(out)


@pytest.mark.parametrize(("rate", "new_rate"), RATES)
def test_it_agrees_with_the_offline_filter(rate, new_rate):
    x = np.random.default_rng(0).normal(size=(round(0.4 * rate), 3))
    streamed = through(x, rate, new_rate)
    offline = resample(x, rate, new_rate)[CENTRE:]
    assert len(streamed) > 100
    np.testing.assert_allclose(streamed, offline[: len(streamed)], atol=1e-12)


@pytest.mark.long
@given(pieces=st.lists(st.integers(1, 700), min_size=1, max_size=8))
def test_the_size_of_the_pieces_does_not_matter(pieces):
    x = np.random.default_rng(1).normal(size=(5000, 2))
    np.testing.assert_allclose(through(x, 1470, 1000, pieces), through(x, 1470, 1000, (5000,)), atol=1e-13)


def test_a_sine_in_the_band_keeps_its_time_and_what_would_alias_is_80_db_down():
    frequency, rate = np.array([0.0, 20, 250, 470, 530, 900, 9030, 23000]), 48000
    y = through(np.cos(2 * np.pi * frequency * np.arange(rate)[:, None] / rate), rate, 1000)
    when = (np.arange(len(y))[:, None] + CENTRE) / 1000
    np.testing.assert_allclose(y[:, :4], np.cos(2 * np.pi * frequency[:4] * when), atol=1e-3)
    assert np.abs(y[:, 4:]).max() < 1e-4


def test_the_stated_delay_is_half_the_filter():
    assert Decimator(48000, 1000).delay == pytest.approx(0.064)
    # A click is seen in 128 frames: the one at its own time is the largest, and they lie evenly around it.
    x = np.zeros((48000, 1))
    x[24000] = 1
    y = through(x, 48000, 1000)[:, 0]
    seen = np.flatnonzero(np.abs(y) > 1e-12)
    assert np.abs(y).argmax() == 500 - CENTRE
    assert seen[0] + seen[-1] == 2 * (500 - CENTRE)
    assert seen[-1] - seen[0] <= 2 * CENTRE
