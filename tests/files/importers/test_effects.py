"""Effects of AHAP and of Meta Haptics Studio: what is written becomes a wave of that level and frequency."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from midair.errors import BrokenFileError
from midair.files import load, open_take


def event(kind, time, *, duration=None, **parameters):
    told = [{"ParameterID": name, "ParameterValue": value} for name, value in parameters.items()]
    held = {} if duration is None else {"EventDuration": duration}
    return {"Event": {"Time": time, "EventType": kind, "EventParameters": told, **held}}


@pytest.fixture
def pattern(tmp_path):
    def written(*entries):
        path = tmp_path / "effect.ahap"
        path.write_text(json.dumps({"Version": 1.0, "Pattern": list(entries)}))
        return path

    return written


def wave(path, **more):
    return load(path, scale=10.0, **more).samples.ravel() / 10


def frequency_of(wave, rate=8000):
    """Strongest frequency in Hz."""
    power = np.abs(np.fft.rfft(wave * np.hanning(len(wave)), 8 * len(wave)))
    return power.argmax() * rate / (8 * len(wave))


@pytest.mark.parametrize(("sharpness", "hertz"), [(0.0, 80), (0.5, 155), (1.0, 230)])
def test_a_continuous_event_is_a_sine_of_its_intensity_and_sharpness(sharpness, hertz, pattern):
    made = wave(pattern(event("HapticContinuous", 0.1, duration=0.5, HapticIntensity=0.6, HapticSharpness=sharpness)))
    assert len(made) == 4800
    assert not made[:800].any()
    assert made[800:].max() == pytest.approx(0.6, abs=0.01)
    assert frequency_of(made[800:]) == pytest.approx(hertz, abs=1)


def test_a_curve_is_linear_and_holds_its_last_value_and_a_step_lasts_until_the_next(pattern):
    points = [{"Time": 0.0, "ParameterValue": 0.0}, {"Time": 0.2, "ParameterValue": 1.0}]
    curve = {
        "ParameterCurve": {"ParameterID": "HapticIntensityControl", "Time": 0.1, "ParameterCurveControlPoints": points}
    }
    made = np.abs(wave(pattern(event("HapticContinuous", 0.0, duration=0.6, HapticSharpness=1.0), curve)))
    loud = [made[round(8000 * at) - 60 : round(8000 * at) + 60].max() for at in (0.05, 0.15, 0.25, 0.5)]
    assert loud == pytest.approx([1.0, 0.25, 0.75, 1.0], abs=0.06)
    steps = [
        {"Parameter": {"ParameterID": "HapticIntensityControl", "Time": at, "ParameterValue": value}}
        for at, value in ((0.2, 0.5), (0.4, 0.0))
    ]
    made = np.abs(wave(pattern(event("HapticContinuous", 0.0, duration=0.6), *steps)))
    assert [made[first : first + 800].max() for first in (400, 2000, 3600)] == pytest.approx([1, 0.5, 0], abs=0.02)


def test_of_overlapping_curves_the_one_that_begins_last_holds(pattern):
    def curve(at, *points):
        listed = [{"Time": when, "ParameterValue": value} for when, value in points]
        name = {"ParameterID": "HapticIntensityControl", "Time": at, "ParameterCurveControlPoints": listed}
        return {"ParameterCurve": name}

    # The second one is in the list last and begins before the first point of the other.
    curves = curve(0.1, (0.3, 0.2), (0.5, 0.2)), curve(0.2, (0.0, 0.5), (0.1, 0.5)), curve(0.05)
    made = np.abs(wave(pattern(event("HapticContinuous", 0.0, duration=0.8, HapticSharpness=1.0), *curves)))
    assert [made[first : first + 400].max() for first in (400, 2000, 5000)] == pytest.approx([1, 0.5, 0.5], abs=0.02)


def test_attack_and_release_are_lines(pattern):
    made = np.abs(wave(pattern(event("HapticContinuous", 0, duration=0.4, AttackTime=0.2, ReleaseTime=0.2))))
    assert len(made) == 4800
    loud = [made[round(8000 * at) - 60 : round(8000 * at) + 60].max() for at in (0.1, 0.3, 0.5)]
    assert loud == pytest.approx([0.5, 1.0, 0.5], abs=0.05)
    found = load(pattern(event("HapticContinuous", 0.0, duration=0.5)), scale=1.0, rate=1000.0)
    assert (found.rate, found.frames) == (1000.0, 500)


def test_a_transient_is_a_click_at_its_time(pattern):
    made = np.abs(wave(pattern(event("HapticTransient", 0.05, HapticIntensity=0.8), event("HapticTransient", 0.2))))
    assert not made[:400].any()
    assert 0.4 < made[400:480].max() <= 0.8
    assert made[800:1590].max() < 0.01
    assert made[1600:1700].max() > 0.5


def test_ignored_and_overlapping_events_are_reported(pattern):
    told = open_take(pattern(event("AudioCustom", 0.0), event("HapticTransient", 0.0)), scale=1.0).report
    assert any("1 events of sound" in line for line in told)
    assert any("80 to 230 Hz" in line for line in told)
    both = pattern(*[event("HapticContinuous", 0, duration=0.1, HapticIntensity=0.8)] * 2)
    assert any("together they reach 1.6 of full intensity" in text for text in open_take(both, scale=10.0).report)


def test_a_file_without_haptic_events_or_of_a_very_long_one_is_refused_before_rendering(pattern):
    for entries in ((), ({"Event": {"Time": 0, "EventType": "AudioContinuous"}},)):
        with pytest.raises(BrokenFileError, match="haptic event"):
            load(pattern(*entries), scale=1.0)
    with pytest.raises(BrokenFileError, match="up to 600 s"):
        load(pattern(event("HapticContinuous", 0.0, duration=1e9)), scale=1.0)


def clip(path, amplitude, frequency=None):
    envelopes = {"amplitude": amplitude} | ({"frequency": frequency} if frequency else {})
    content = {"version": {"major": 1, "minor": 0, "patch": 0}, "signals": {"continuous": {"envelopes": envelopes}}}
    path.write_text(json.dumps(content))
    return path


def test_a_clip_has_its_amplitude_and_frequency_over_time(tmp_path):
    amplitude = [{"time": 0, "amplitude": 0.5}, {"time": 1, "amplitude": 0.5}, {"time": 2, "amplitude": 1.0}]
    frequency = [{"time": 0, "frequency": 0.2}, {"time": 1, "frequency": 0.2}, {"time": 1.001, "frequency": 0.8}]
    samples = wave(clip(tmp_path / "a.haptic", amplitude, frequency))
    assert len(samples) == 16000
    assert frequency_of(samples[:8000]) == pytest.approx(110, abs=0.5)
    assert frequency_of(samples[8100:]) == pytest.approx(200, abs=0.5)
    assert np.abs(samples[:8000]).max() == pytest.approx(0.5, abs=0.01)
    assert np.abs(samples[11900:12100]).max() == pytest.approx(0.75, abs=0.02)


def test_an_emphasis_is_a_click_in_silence(tmp_path):
    amplitude = [
        {"time": 0, "amplitude": 0},
        {"time": 0.5, "amplitude": 0, "emphasis": {"amplitude": 0.6, "frequency": 1.0}},
        {"time": 1, "amplitude": 0},
    ]
    samples = wave(clip(tmp_path / "a.haptic", amplitude))
    assert not samples[:4000].any()
    assert 0.4 < np.abs(samples[4000:4100]).max() < 0.6
    assert np.abs(samples[4500:]).max() < 1e-3
    assert frequency_of(samples[4000:4400]) == pytest.approx(230, abs=5)


def test_a_clip_without_an_envelope_or_with_a_point_below_0_is_refused(tmp_path):
    empty = {"signals": {"continuous": {"envelopes": {"amplitude": []}}}}
    for content in ([], {"signals": {}}, empty, {"signals": None}):
        (tmp_path / "a.haptic").write_text(json.dumps(content))
        with pytest.raises(BrokenFileError, match=r"a\.haptic: expected"):
            open_take(tmp_path / "a.haptic")
    for value in (-0.5, float("nan")):
        with pytest.raises(BrokenFileError, match="points of amplitude"):
            wave(clip(tmp_path / "a.haptic", [{"time": 0, "amplitude": value}, {"time": 1, "amplitude": 1}]))


@pytest.mark.skipif("MIDAIR_HAPTICS_STUDIO" not in os.environ, reason="MIDAIR_HAPTICS_STUDIO names no checkout")
def test_the_clips_of_the_makers_are_read():
    found = sorted(Path(os.environ["MIDAIR_HAPTICS_STUDIO"]).rglob("*.haptic"))
    assert len(found) > 50
    for path in found:
        assert 0 < np.abs(wave(path)).max() <= 1, path
