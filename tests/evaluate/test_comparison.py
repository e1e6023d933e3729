import dataclasses

import numpy as np
import pytest

from midair.errors import MismatchError
from midair.evaluate import advance, compare, dominant_frequency, find_delay, in_band
from midair.model import PressureFrames, Provenance


def frames(scale=1.0, rate=1000.0, channel=5, frequency=100.0, simulated=False):
    time = np.arange(400) / rate
    pressure = np.zeros((400, 16))
    pressure[:, channel] = scale * np.sin(2 * np.pi * frequency * time) * np.hanning(400)
    return PressureFrames(
        pressure=pressure.reshape(-1, 4, 4), rate=rate, band=(20, 470), provenance=Provenance(simulated=simulated)
    )


def test_a_re_recording_in_place_of_the_original_is_refused():
    again = dataclasses.replace(frames(), provenance=Provenance().then("play", {"frames": 400}))
    assert compare(again, again).gain == pytest.approx(1)
    with pytest.raises(MismatchError, match="a re-recording first; swap the two"):
        compare(again, frames())


def test_half_as_strong_and_another_place():
    comparison = compare(frames(), frames(0.5, simulated=True))
    assert comparison.channel_gain[1, 1] == pytest.approx(0.5)
    assert comparison.channel_gain[0, 0] == 0
    assert comparison.simulated
    comparison = compare(frames(), frames(channel=6))
    assert comparison.place.shift == pytest.approx((11e-3, 0), abs=0.2e-3)
    assert comparison.correlation == pytest.approx(1, abs=1e-3)
    assert comparison.waveform_error == pytest.approx(2**0.5)
    fixed = compare(frames(), frames(channel=6), fixed_place=True)
    assert (fixed.correlation, bool(fixed.place)) == (pytest.approx(0, abs=1e-9), False)


def test_a_perfect_piece_that_is_early_is_perfect():
    """The error is that of the delay; a piece that is cut before alignment loses its ends."""
    noise = in_band(np.random.default_rng(0).normal(size=(4000, 4, 4)), 4000.0, (20.0, 470.0))
    whole = dataclasses.replace(frames(rate=4000.0), pressure=noise)
    early = dataclasses.replace(whole, pressure=advance(noise, 0.11e-3, 4000.0))
    comparison = compare(whole.cut(0.4, 0.12), early, first=1600)
    assert comparison.delay == pytest.approx(-0.11e-3, abs=5e-6)
    assert comparison.distortion_ratio > 45
    assert compare(whole.cut(0.4, 0.12), early.cut(0.4, 0.12)).distortion_ratio < 40


def test_silence_gives_figures_and_no_nan():
    silent = dataclasses.replace(frames(), pressure=np.zeros((400, 4, 4)))
    for comparison in (compare(frames(), silent), compare(silent, silent), compare(silent, frames())):
        assert not any(np.isnan(value) for value, _ in comparison.figures().values())


def test_the_figures_equal_their_definitions_and_frequencies_ignore_the_mean():
    """Compared with sums over all cells at once in NumPy, while `compare` processes cell by cell."""
    rng = np.random.default_rng(1)
    x = rng.standard_normal((4000, 4, 4)) * np.linspace(0.1, 3, 16).reshape(4, 4)
    late = advance(0.7 * x * np.linspace(0.5, 2, 16).reshape(4, 4) + rng.standard_normal(x.shape), -0.0034, 1000.0)
    said = compare(PressureFrames(pressure=x, rate=1000.0), PressureFrames(pressure=late, rate=1000.0))
    y = advance(late, said.delay, 1000.0)
    gain = (x * y).sum() / (x**2).sum()
    assert said.delay == find_delay(x, late, 1000.0)
    assert said.gain == pytest.approx(gain, rel=1e-12)
    assert said.correlation == pytest.approx((x * y).sum() / np.sqrt((x**2).sum() * (y**2).sum()), rel=1e-12)
    assert said.waveform_error == pytest.approx(np.linalg.norm(y - x) / np.linalg.norm(x), rel=1e-12)
    assert said.distortion_ratio == pytest.approx(
        10 * np.log10(gain**2 * (x**2).sum() / ((y - gain * x) ** 2).sum()), rel=1e-12
    )
    assert said.frequency == (dominant_frequency(x, 1000.0), dominant_frequency(y, 1000.0))
    assert said.rms == pytest.approx([np.sqrt((each**2).mean(axis=0).max()) for each in (x, y)], rel=1e-12)
    time = np.arange(500) / 1000
    wave = 10 + np.sin(2 * np.pi * 40 * time) + 0.5 * np.sin(2 * np.pi * 120 * time)
    assert dominant_frequency(wave[:, None, None], 1000.0) == pytest.approx(40.0)
