"""Files with the structure of MPEG's public reference software and known waves, and round trips of midair's own."""

import json

import numpy as np
import pytest

from midair.errors import BrokenFileError, InputError
from midair.files import load, open_take, save
from midair.model import Recording, SensorGrid


def band(kind, *keys, position=0, **more):
    effect = {
        "effect_type": "Basis",
        "position": position,
        "phase": 0.0,
        "base_signal": "Sine",
        "keyframes": list(keys),
    }
    limits = {"lower_frequency_limit": 0, "upper_frequency_limit": 1000}
    return {"band_type": kind, **limits, "effects": [effect | more]}


def key(at, amplitude=None, frequency=None):
    told = {"amplitude_modulation": amplitude, "frequency_modulation": frequency}
    return {"relative_position": at} | {name: value for name, value in told.items() if value is not None}


@pytest.fixture
def effect(tmp_path):
    def written(*channels):
        path = tmp_path / "effect.hjif"
        made = [
            {"id": n, "gain": gain, "mixing_weight": 1.0, "bands": bands} for n, (gain, bands) in enumerate(channels)
        ]
        path.write_text(json.dumps({"timescale": 1000, "perceptions": [{"id": 0, "channels": made}]}))
        return path

    return written


def waves(path, **more):
    found = load(path, scale=10.0, **more)
    return found.samples.reshape(found.frames, -1) / 10


def test_a_recording_is_read_as_it_was_written(tmp_path):
    samples = np.random.default_rng(0).standard_normal((200, 2, 2))
    samples -= np.median(samples, axis=0)
    sensor = SensorGrid(rows=2, columns=2)
    save(Recording(samples=samples, rate=1000.0, unit="Pa", sensor=sensor), tmp_path / "a.hjif")
    again = load(tmp_path / "a.hjif", scale=float(np.abs(samples).max()), sensor=sensor)
    assert again.rate == 1000
    np.testing.assert_allclose(again.samples, samples, atol=2e-4)


def test_a_vectorial_wave_has_the_frequency_and_the_level_of_its_keyframes(effect):
    made = waves(effect((0.5, [band("VectorialWave", key(0, 1.0, 100), key(1000, 1.0, 100), position=200)])))[:, 0]
    assert not made[:1590].any()
    assert made[1600:].max() == pytest.approx(0.5, abs=1e-3)
    rises = np.flatnonzero((made[1600:-1] < 0) & (made[1601:] >= 0))
    assert np.diff(rises).mean() == pytest.approx(80, abs=0.2)


@pytest.mark.parametrize(
    ("signal", "rms"), [("Sine", 0.707), ("Square", 1.0), ("Triangle", 0.577), ("SawToothUp", 0.577)]
)
def test_every_base_signal_has_its_power(signal, rms, effect):
    made = waves(effect((1.0, [band("VectorialWave", key(0, 1.0, 50), key(1000, 1.0, 50), base_signal=signal)])))
    assert np.sqrt((made[:8000] ** 2).mean()) == pytest.approx(rms, abs=0.01)
    assert abs(made[:8000].mean()) < 0.02


def test_curves_are_linear_and_bands_add_up(effect):
    curve = band("Curve", key(0, 0.0), key(100, 1.0), key(200, 0.0))
    made = waves(effect((1.0, [curve, curve]), (1.0, [curve])), sensor=SensorGrid(rows=1, columns=2))
    assert made[400] == pytest.approx([1.0, 0.5])
    assert made[1200] == pytest.approx([1.0, 0.5])


def test_transients_are_clicks(effect):
    made = np.abs(waves(effect((1.0, [band("Transient", key(50, 0.8, 200), key(300, 0.4, 200))]))))[:, 0]
    assert not made[:400].any()
    assert made[400:500].max() == pytest.approx(0.8 * np.exp(-1.25 / 8), abs=0.05)
    assert made[2400:2500].max() == pytest.approx(made[400:500].max() / 2, rel=1e-6)


def test_ignored_bands_are_reported_and_empty_files_refused(effect):
    curve = band("Curve", key(0, 1.0), key(100, 1.0))
    report = open_take(effect((1.0, [curve, band("WaveletWave")])), scale=1.0).report
    assert any("WaveletWave" in line for line in report)
    with pytest.raises(BrokenFileError, match="got bands of the kind WaveletWave"):
        load(effect((1.0, [band("WaveletWave")])), scale=1.0)


def test_an_effect_that_needs_too_much_memory_is_refused_before_rendering(effect):
    path = effect((1.0, [band("Curve", key(0, 1.0), key(500_000, 1.0))]))
    content = json.loads(path.read_text())
    content["perceptions"][0]["channels"][0]["frequency_sampling"] = 1e9
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=r"GB of free memory.*state a lower rate"):
        load(path, scale=1.0)
    assert load(path, scale=1.0, rate=100.0).frames == 50_001
