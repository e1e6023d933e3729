from dataclasses import replace

import numpy as np
import pytest

from midair.calibration import measure_calibration, measure_tone, scale_of_drop, scale_of_tone, scale_to_tone
from midair.calibration.measure.referenced_take import noise_signal
from midair.errors import BandError, InputError, MismatchError
from midair.model import Recording, SensorGrid
from midair.physics import channel_response


def pistonphone(bench, seed, *, rms=10.0, frequency=250.0, duration=8.0):
    time = np.arange(round(1000 * duration)) / 1000
    return bench.recordings(np.sqrt(2) * rms * np.sin(2 * np.pi * frequency * time), number=seed)[0]


@pytest.mark.long
def test_a_pistonphone_blind(bench):
    """114 dB, 250 Hz, slightly off: all channels are within the stated uncertainty for most seeds."""
    inside = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        lab = bench(seed)
        error = 0.005 * rng.standard_normal()
        said = pistonphone(lab, seed, rms=10.02 * (1 + error), frequency=250.3)
        found = measure_tone(said, frequency=250.0, pressure=10.02, uncertainty=0.005)
        assert found.frequency[0] == pytest.approx(250.3, abs=1e-3)
        ratio = np.abs(found.response) / np.abs(channel_response(lab.model, found.frequency))
        assert ratio == pytest.approx(np.full((1, 4, 4), 1 + error), rel=1e-3)
        inside.append(np.abs(ratio - 1) < 2 * found.measurement.magnitude_uncertainty)
        assert found.measurement.magnitude_uncertainty == pytest.approx(np.full((1, 4, 4), 0.005), rel=0.02)
    assert np.mean(inside) > 0.8


def test_the_scatter_of_a_weak_tone_is_as_stated(bench, blind_model):
    scores = []
    for seed in range(4):
        lab = bench(seed, model=blind_model(seed, noise=2e-3))
        found = measure_tone(pistonphone(lab, seed, rms=0.5), frequency=250.0, pressure=0.5)
        true = np.abs(channel_response(lab.model, found.frequency))
        scores.append((np.abs(found.response) / true - 1) / found.measurement.magnitude_uncertainty)
    assert (np.abs(scores) < 2).mean() == pytest.approx(0.954, abs=0.08)
    assert np.median(found.noise) == pytest.approx(2e-3, rel=0.05)


def test_phases_are_those_between_channels(bench):
    lab = bench(3)
    found = measure_tone(pistonphone(lab, 0), frequency=250.0, pressure=10.0)
    true = np.angle(channel_response(lab.model, found.frequency))[0]
    apart = np.angle(found.response)[0] - true
    assert apart - apart.mean() == pytest.approx(np.zeros((4, 4)), abs=2e-3)


def test_a_response_is_scaled_to_a_tone(bench, covered):
    """A response from a reference that is 25 % wrong with this uncertainty, scaled by a tone of 1 %."""
    lab = bench(5, reference_error=-0.2, reference_uncertainty=0.15)
    shape = measure_calibration([lab.take(noise_signal(10, 13, rng=np.random.default_rng(5)))])
    tone = measure_tone(pistonphone(lab, 0), frequency=250.0, pressure=10.0, uncertainty=0.01)
    found = scale_to_tone(shape, tone)
    true = np.abs(channel_response(lab.model, shape.frequency))
    band = (shape.frequency >= 20) & (shape.frequency <= 470)
    assert np.median(np.abs(shape.response) / true) == pytest.approx(1.25, rel=0.01)
    assert np.abs(found.response)[band] / true[band] == pytest.approx(np.ones((band.sum(), 4, 4)), rel=0.01)
    assert np.median(found.measurement.magnitude_uncertainty) == pytest.approx(0.01, rel=0.05)
    assert covered(found, lab.model)[0] == 1
    assert found.provenance.steps[-1].stage == "anchor"
    assert np.angle(found.response) == pytest.approx(np.angle(shape.response))


def test_bad_tones_are_refused(bench):
    said = pistonphone(bench(0), 0, duration=1.0)
    for changes, error, says in (
        ({"frequency": 600.0}, BandError, "below 500 Hz, half the rate, got 600 Hz"),
        ({"frequency": 20.0}, BandError, "2 s or more for 10 segments"),
        ({"pressure": 0.0}, InputError, "pressure of the tone"),
        ({"frequency": 100.0}, InputError, "tone: expected a steady tone near 100 Hz"),
    ):
        with pytest.raises(error, match=says):
            measure_tone(said, **({"frequency": 250.0, "pressure": 10.0} | changes))


def test_a_tone_of_another_sensor_is_refused(bench):
    lab = bench(0)
    shape = measure_calibration([lab.take(noise_signal(10, 8, rng=np.random.default_rng(0)))])
    tone = measure_tone(pistonphone(lab, 0), frequency=250.0, pressure=10.0)
    other = replace(tone, sensor=SensorGrid(name="another"))
    with pytest.raises(MismatchError, match="one bin of sensor 'sensor' in V, got 1 bins of 'another'"):
        scale_to_tone(shape, other)
    with pytest.raises(MismatchError, match="expected one bin"):
        scale_to_tone(shape, shape)
    with pytest.raises(BandError, match="tone: expected one within"):
        scale_to_tone(shape, replace(tone, frequency=np.array([499.9])))


def test_silence_is_rejected():
    quiet = Recording(samples=np.zeros((4000, 4, 4)), rate=1000.0)
    with pytest.raises(InputError, match="tone: expected a steady tone near"):
        measure_tone(quiet, frequency=250.0, pressure=10.0)


RATE = 8000.0
TIME = np.arange(4000) / RATE


@pytest.mark.parametrize("hertz", [250.0, 1000.0, 997.3])
@pytest.mark.parametrize(("level", "peak"), [(94.0, np.sqrt(2) * 1.0024), (114.0, np.sqrt(2) * 10.024)])
def test_scale_of_a_tone_of_known_level(hertz, level, peak):
    """94 dB are 1.0024 Pa rms; the file has a 40th of the pressure, some noise and an offset."""
    noise = 1e-3 * np.random.default_rng(0).standard_normal(len(TIME))
    pressure = peak * np.sin(2 * np.pi * hertz * TIME + 0.3)
    found = scale_of_tone(pressure / 40 + noise + 0.2, RATE, level=level)
    assert found.scale == pytest.approx(40, rel=2e-3)
    assert f"A tone of {round(hertz / 2) * 2:g} Hz at {level:g} dB" in found.words


@pytest.mark.parametrize("wrong", [np.random.default_rng(1).standard_normal(4000), np.zeros(4000)])
def test_other_signals_than_a_tone_are_rejected(wrong):
    with pytest.raises(InputError, match="expected a tone"):
        scale_of_tone(wrong, RATE)


@pytest.mark.parametrize("sign", [1, -1])
def test_scale_of_a_falling_weight(sign):
    """A half sine of 4 ms whose integral is the momentum over the area, by hand: 2 g from 50 mm on 10 mm."""
    impulse = 2e-3 * np.sqrt(2 * 9.81 * 50e-3) / (np.pi * 25e-6)
    assert impulse == pytest.approx(25.2, rel=1e-2)
    blow = np.where(abs(TIME - 0.2) < 2e-3, np.cos((TIME - 0.2) * np.pi / 4e-3), 0.0)
    pressure = impulse / (4e-3 * 2 / np.pi) * blow
    noise = 1e-4 * np.random.default_rng(0).standard_normal(len(TIME))
    found = scale_of_drop(sign * pressure / 1e5 + noise, RATE, mass=2e-3, height=50e-3, diameter=10e-3)
    assert found.scale == pytest.approx(1e5, rel=0.01)
    assert "bounced" in found.words


@pytest.mark.parametrize(
    ("samples", "words"),
    [(np.random.default_rng(1).standard_normal(4000), "twenty times the noise"), (np.eye(1, 4000, 77)[0], "4 frames")],
)
def test_a_recording_without_an_impact_is_rejected(samples, words):
    with pytest.raises(InputError, match=words):
        scale_of_drop(samples, RATE, mass=2e-3, height=50e-3, diameter=10e-3)
