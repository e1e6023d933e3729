import numpy as np
import pytest

from midair.datasets import am_stimulus
from midair.errors import InputError, RateError


@pytest.mark.parametrize(
    ("kind", "channels", "lines"),
    [("i", [0], {100.0: 30.0}), ("ii", [0, 15], {100.0: 30.0}), ("iii", [0], {25.0: 18.0, 250.0: 12.0})],
)
def test_stimuli_have_their_lines_on_their_channels(kind, channels, lines):
    frames = am_stimulus(kind, peak=60.0, duration=0.4)
    flat = frames.pressure.reshape(-1, 16)
    assert np.flatnonzero(flat.any(axis=0)).tolist() == channels
    spectrum = 2 * np.abs(np.fft.rfft(flat[:, channels], axis=0)) / len(flat)
    frequency = np.fft.rfftfreq(len(flat), 1 / 1000)
    for channel in range(len(channels)):
        found = {float(f): float(a) for f, a in zip(frequency[1:], spectrum[1:, channel], strict=True) if a > 1e-9}
        assert found == pytest.approx(lines)
    assert flat.min() == 0
    assert flat.max() <= 60
    assert flat.max() > 0.97 * 60
    assert flat[0].max() == 0
    assert frames.provenance.simulated


def test_an_invalid_stimulus_is_refused():
    with pytest.raises(InputError, match="i, ii, iii, got 'iv'"):
        am_stimulus("iv")
    with pytest.raises(RateError, match="above 500 Hz, got 500"):
        am_stimulus("iii", rate=500.0)
    with pytest.raises(InputError, match="peak"):
        am_stimulus("i", peak=0.0)
    with pytest.raises(InputError, match="duration"):
        am_stimulus("i", duration=-1.0)
