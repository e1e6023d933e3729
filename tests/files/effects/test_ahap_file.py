"""AHAP: intensity and sharpness of known signals, within the limits of Core Haptics."""

import json

import numpy as np
import pytest

from midair.files import save
from midair.files.effects.ahap_file import envelope
from midair.model import Provenance, Recording


def tone(frequency, seconds=1.0, rate=1000.0, loud=1.0, **says):
    time = np.arange(round(seconds * rate)) / rate
    wave = loud * np.sin(2 * np.pi * frequency * time)
    return Recording(samples=np.broadcast_to(wave[:, None, None], (len(time), 4, 4)), rate=rate, unit="Pa", **says)


def points(pattern, name):
    """Absolute times and values of a parameter, all curves together."""
    found = []
    for part in pattern["Pattern"]:
        curve = part.get("ParameterCurve")
        if curve and curve["ParameterID"] == name:
            found += [
                (curve["Time"] + point["Time"], point["ParameterValue"])
                for point in curve["ParameterCurveControlPoints"]
            ]
    return np.array(found)


def exported(recording, path):
    lost = save(recording, path)
    return json.loads(path.read_text(encoding="ascii")), lost


@pytest.mark.parametrize("frequency", [90.0, 155.0, 220.0])
def test_the_envelope_of_a_tone_is_its_frequency(frequency):
    time, intensity, centre = envelope(tone(frequency))
    inside = (time > 0.1) & (time < 0.9)
    np.testing.assert_allclose(centre[inside], frequency, atol=2)
    np.testing.assert_allclose(intensity[inside], 1, atol=0.02)


def test_intensity_is_a_part_of_the_largest(tmp_path):
    samples = tone(150.0).samples.copy()
    samples[:500] *= 0.25
    pattern, _ = exported(Recording(samples=samples, rate=1000), tmp_path / "a.ahap")
    curve = points(pattern, "HapticIntensityControl")
    early = curve[(curve[:, 0] > 0.1) & (curve[:, 0] < 0.4), 1]
    late = curve[(curve[:, 0] > 0.6) & (curve[:, 0] < 0.9), 1]
    np.testing.assert_allclose(early / late.mean(), 0.25, rtol=0.05)
    assert curve[:, 1].max() == 1
    assert (curve[:, 1] >= 0).all()


def test_sharpness_goes_from_low_to_high(tmp_path):
    for frequency, expected in ((40.0, -0.5), (155.0, 0.0), (400.0, 0.5)):
        pattern, _ = exported(tone(frequency), tmp_path / "a.ahap")
        curve = points(pattern, "HapticSharpnessControl")
        np.testing.assert_allclose(curve[(curve[:, 0] > 0.1) & (curve[:, 0] < 0.9), 1], expected, atol=0.03)


def test_stays_within_the_limits_of_core_haptics(tmp_path):
    pattern, lost = exported(tone(100.0, seconds=70.0, rate=400.0), tmp_path / "a.ahap")
    assert pattern["Version"] == 1.0
    events = [part["Event"] for part in pattern["Pattern"] if "Event" in part]
    assert [(event["Time"], event["EventDuration"]) for event in events] == [(0, 30), (30, 30), (60, 10)]
    curves = [part["ParameterCurve"] for part in pattern["Pattern"] if "ParameterCurve" in part]
    assert max(len(curve["ParameterCurveControlPoints"]) for curve in curves) == 16
    times = points(pattern, "HapticIntensityControl")[:, 0]
    assert (np.diff(times) >= 0).all()
    assert (times[0], times[-1]) == (0, 70)
    assert [loss.what for loss in lost] == ["channels", "waveform", "band", "scale", "provenance", "length"]


def test_reports_that_simulated_data_loses_its_mark(tmp_path):
    _, lost = exported(tone(100.0, provenance=Provenance(simulated=True)), tmp_path / "a.ahap")
    assert any("SIMULATED" in str(loss) for loss in lost)


@pytest.mark.parametrize("frames", [1, 2, 30])
def test_short_and_silent_recordings_make_a_pattern(frames, tmp_path):
    pattern, _ = exported(Recording(samples=np.ones((frames, 4, 4)), rate=1000), tmp_path / "a.ahap")
    assert (points(pattern, "HapticIntensityControl")[:, 1] == 0).all()
