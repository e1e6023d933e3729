import numpy as np
import pytest

from midair.errors import InputError
from midair.model import PressureFrames
from midair.targets import MAPPINGS, mapping_report


def wave(frequency=50.0, amplitude=10.0, rate=4000.0, duration=1.0):
    pressure = np.zeros((int(duration * rate), 4, 4))
    pressure[:, 1, 2] = amplitude * np.sin(2 * np.pi * frequency * np.arange(len(pressure)) / rate)
    return PressureFrames(pressure=pressure, rate=rate)


def test_half_wave_of_a_sine_by_hand():
    """x+ = A (1/pi + sin / 2 - 2/pi sum cos(2 k w t) / (4 k^2 - 1)): gain 1/2, mean A / pi, peak A, on half the time.

    Harmonics of 50 Hz in 20-470 Hz: 100, 200, 300, 400 Hz of 2/pi (1/3, 1/15, 1/35, 1/63). Against 1/2:
    SDR = 10 log10(.25 / (.2122^2 + .0424^2 + .0182^2 + .0101^2)) = 7.22 dB.
    """
    report = mapping_report(wave(duration=4.0), "half-wave")
    assert report.gain == pytest.approx(0.5, rel=1e-3)
    assert report.distortion_ratio == pytest.approx(7.22, abs=0.03)
    assert report.mean == pytest.approx(10 / np.pi, rel=1e-3)
    assert report.peak == pytest.approx(10, rel=1e-3)
    assert report.wanted == pytest.approx(0.5 / np.sqrt(2), rel=1e-2)
    assert report.on == pytest.approx(0.5, abs=0.01)
    assert report.exposure == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("mapping", ["constant-offset", "slow-bias"])
def test_a_lifted_sine_by_hand(mapping):
    """P = A (1 + sin): gain 1, mean A, peak 2 A; per wanted part pi / 2 of the half wave's mean: 1.96 dB."""
    report = mapping_report(wave(), mapping)
    assert report.gain == pytest.approx(1, rel=1e-3)
    assert report.distortion_ratio > 45
    assert report.mean == pytest.approx(10, rel=2e-3)  # the bias rises and falls at the ends
    assert report.peak == pytest.approx(20, rel=1e-3)
    assert report.wanted == pytest.approx(0.5 / np.sqrt(2), rel=1e-2)
    assert report.on == pytest.approx(1, abs=0.03)
    assert report.exposure == pytest.approx(10 * np.log10(np.pi / 2), abs=0.02)


@pytest.mark.parametrize("mapping", MAPPINGS)
def test_silence_costs_nothing(mapping):
    report = mapping_report(PressureFrames(pressure=np.zeros((400, 4, 4)), rate=1000.0), mapping)
    assert (report.gain, report.mean, report.peak, report.on, report.exposure) == (0, 0, 0, 0, 0)
    assert set(report.figures()) >= {"mapping", "gain", "distortion_ratio", "exposure"}


def test_an_unknown_mapping_is_refused():
    with pytest.raises(InputError, match="mapping: expected one of"):
        mapping_report(wave(duration=0.1), "full-wave")
