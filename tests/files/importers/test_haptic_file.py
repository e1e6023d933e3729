"""Clips of Meta Haptics Studio: envelopes as written, and a wave with the stated amplitude, frequency and clicks."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from midair.errors import BrokenFileError
from midair.files import open_take


def clip(path, amplitude, frequency=None):
    envelopes = {"amplitude": amplitude} | ({"frequency": frequency} if frequency else {})
    content = {"version": {"major": 1, "minor": 0, "patch": 0}, "signals": {"continuous": {"envelopes": envelopes}}}
    path.write_text(json.dumps(content))
    return path


def wave(path):
    recording = open_take(path, scale=1.0).recording
    return np.asarray(recording.samples).ravel(), recording.rate


def strongest(samples, rate):
    power = np.abs(np.fft.rfft(samples * np.hanning(len(samples)), 8 * len(samples)))
    return power.argmax() * rate / (8 * len(samples))


def test_a_clip_has_its_amplitude_and_frequency_over_time(tmp_path):
    amplitude = [{"time": 0, "amplitude": 0.5}, {"time": 1, "amplitude": 0.5}, {"time": 2, "amplitude": 1.0}]
    frequency = [{"time": 0, "frequency": 0.2}, {"time": 1, "frequency": 0.2}, {"time": 1.001, "frequency": 0.8}]
    samples, rate = wave(clip(tmp_path / "a.haptic", amplitude, frequency))
    assert (rate, len(samples)) == (8000, 16000)
    assert strongest(samples[:8000], rate) == pytest.approx(110, abs=0.5)
    assert strongest(samples[8100:], rate) == pytest.approx(200, abs=0.5)
    assert np.abs(samples[:8000]).max() == pytest.approx(0.5, abs=0.01)
    assert np.abs(samples[11900:12100]).max() == pytest.approx(0.75, abs=0.02)


def test_an_emphasis_is_a_click_in_silence(tmp_path):
    amplitude = [
        {"time": 0, "amplitude": 0},
        {"time": 0.5, "amplitude": 0, "emphasis": {"amplitude": 0.6, "frequency": 1.0}},
        {"time": 1, "amplitude": 0},
    ]
    samples, rate = wave(clip(tmp_path / "a.haptic", amplitude))
    assert not samples[:4000].any()
    assert 0.4 < np.abs(samples[4000:4100]).max() < 0.6
    assert np.abs(samples[4500:]).max() < 1e-3
    assert strongest(samples[4000:4400], rate) == pytest.approx(230, abs=5)


@pytest.mark.parametrize(
    "content", [[], {"signals": {}}, {"signals": {"continuous": {"envelopes": {"amplitude": []}}}}, {"signals": None}]
)
def test_a_clip_without_an_envelope_is_refused(content, tmp_path):
    (tmp_path / "a.haptic").write_text(json.dumps(content))
    with pytest.raises(BrokenFileError, match=r"a\.haptic: expected"):
        open_take(tmp_path / "a.haptic")


@pytest.mark.parametrize("value", [-0.5, float("nan")])
def test_points_are_numbers_from_0_on(value, tmp_path):
    with pytest.raises(BrokenFileError, match="points of amplitude"):
        wave(clip(tmp_path / "a.haptic", [{"time": 0, "amplitude": value}, {"time": 1, "amplitude": 1}]))


@pytest.mark.skipif("MIDAIR_HAPTICS_STUDIO" not in os.environ, reason="MIDAIR_HAPTICS_STUDIO names no checkout")
def test_the_clips_of_the_makers_are_read():
    found = sorted(Path(os.environ["MIDAIR_HAPTICS_STUDIO"]).rglob("*.haptic"))
    assert len(found) > 50
    for path in found:
        samples, _ = wave(path)
        assert 0 < np.abs(samples).max() <= 1, path
