import numpy as np
import pytest

from midair.datasets import am_stimulus, taps
from midair.datasets.stimuli import binary_patterns, channel_amplitudes
from midair.model import SensorGrid


def test_stimuli_have_their_lines_on_their_channels(subtests):
    for kind, channels, lines in [
        ("i", [0], {100.0: 30.0}),
        ("ii", [0, 15], {100.0: 30.0}),
        ("iii", [0], {25.0: 18.0, 250.0: 12.0}),
    ]:
        with subtests.test(kind=kind):
            frames = am_stimulus(kind, peak=60.0, duration=0.4)
            flat = frames.pressure.reshape(-1, 16)
            assert np.flatnonzero(flat.any(axis=0)).tolist() == channels
            spectrum = 2 * np.abs(np.fft.rfft(flat[:, channels], axis=0)) / len(flat)
            frequency = np.fft.rfftfreq(len(flat), 1 / 1000)
            for channel in range(len(channels)):
                found = {
                    float(f): float(a) for f, a in zip(frequency[1:], spectrum[1:, channel], strict=True) if a > 1e-9
                }
                assert found == pytest.approx(lines)
            assert flat.min() == 0
            assert flat.max() <= 60
            assert flat.max() > 0.97 * 60
            assert flat[0].max() == 0
            assert frames.provenance.simulated


def test_each_cell_is_tapped_in_its_own_second_by_a_half_sine_of_20_ms():
    made = taps(every=1.0, quiet=1.0, peak=30.0, spread=0.25, rate=1000.0)
    assert made.provenance.simulated
    cells = made.pressure.reshape(len(made.pressure), 16)
    assert not cells[:1000].any()
    seconds = cells[1000:17_000].reshape(16, 1000, 16).max(axis=1)
    np.testing.assert_array_equal(seconds.argmax(axis=1), np.arange(16))
    own = np.diag(seconds)
    assert 10 <= own.min() < own.max() <= 30
    assert seconds[0, 1] == seconds[0, 4] == pytest.approx(0.25 * own[0])
    assert seconds[0, 5] == pytest.approx(0.0625 * own[0])
    assert seconds[0, 15] == 0
    made = taps(sensor=SensorGrid(rows=1, columns=1), rate=8000.0, seed=3)
    push = made.pressure[:, 0, 0]
    (pressed,) = np.nonzero(push)
    assert np.ptp(pressed) + 1 == 159, "160 steps, of which the first is 0"
    np.testing.assert_allclose(push[pressed], push.max() * np.sin(np.pi * np.arange(1, 160) / 160))


def test_binary_patterns_are_a_fair_sample_of_which_bit_k_is_channel_k():
    assert np.array_equal(np.sort(binary_patterns()), np.arange(1, 65536))
    assert np.array_equal(binary_patterns(100, seed=5), binary_patterns(seed=5)[:100])
    assert not np.array_equal(binary_patterns(100, seed=5), binary_patterns(100, seed=6))
    # Half of the channels are loud, within four standard errors of a binomial distribution.
    loud = channel_amplitudes(binary_patterns(1024, seed=1)).mean()
    assert abs(loud - 0.5) < 4 * 0.5 / np.sqrt(1024 * 16)
    amplitude = channel_amplitudes([0x0001, 0x8001, 0x0660])
    assert np.flatnonzero(amplitude[0]).tolist() == [0]
    assert np.flatnonzero(amplitude[1]).tolist() == [0, 15]
    assert np.flatnonzero(amplitude[2]).tolist() == [5, 6, 9, 10]
