"""MPEG haptics: the curve of every cell is read back from the JSON, and losses are reported."""

import json

import numpy as np
import pytest

from midair.errors import BrokenFileError, InputError
from midair.files import load, open_take, save
from midair.model import Provenance, Recording, SensorGrid


@pytest.fixture
def exported(tmp_path):
    def to(recording):
        lost = save(recording, tmp_path / "a.hjif")
        return json.loads((tmp_path / "a.hjif").read_text(encoding="ascii")), lost

    return to


def curves(plain):
    """Ticks and values of each channel, as interpreted by a reader of the standard."""
    for channel in plain["perceptions"][0]["channels"]:
        (band,) = channel["bands"]
        assert (band["band_type"], band["curve_type"]) == ("Curve", "Linear")
        (effect,) = band["effects"]
        frames = effect["keyframes"]
        yield [frame["relative_position"] for frame in frames], [frame["amplitude_modulation"] for frame in frames]


def test_every_cell_is_a_curve_of_its_own(exported):
    samples = np.random.default_rng(0).normal(size=(50, 4, 4))
    plain, lost = exported(Recording(samples=samples, rate=1000, unit="Pa"))
    change = samples - np.median(samples, axis=0)
    peak = np.abs(change).max()
    assert plain["timescale"] == 1000
    channels = plain["perceptions"][0]["channels"]
    assert [channel["id"] for channel in channels] == list(range(16))
    for channel, (ticks, values) in enumerate(curves(plain)):
        assert ticks == list(range(50))
        np.testing.assert_allclose(np.array(values) * peak, change.reshape(50, 16)[:, channel], atol=peak / 32767)
    assert max(max(map(abs, values)) for _, values in curves(plain)) == 1
    assert channels[5]["description"] == "row 1, column 1: x -5.5 mm, y -5.5 mm"
    assert [loss.what for loss in lost] == ["scale", "sensor", "provenance", "band"]
    assert f"{peak:.6g} Pa" in str(lost[0])


def test_ticks_are_microseconds_for_fractional_rates(exported):
    plain, lost = exported(Recording(samples=np.eye(4)[None].repeat(7, 0) * np.arange(7)[:, None, None], rate=1000 / 3))
    assert plain["timescale"] == 1_000_000
    ticks, _ = next(curves(plain))
    assert ticks == [0, 3000, 6000, 9000, 12000, 15000, 18000]
    assert "rate" in [loss.what for loss in lost]


def test_simulated_data_is_marked_and_silence_is_silent(exported):
    silent = Recording(samples=np.zeros((3, 4, 4)), rate=10, provenance=Provenance(simulated=True))
    plain, _ = exported(silent)
    assert plain["description"].startswith("SIMULATED")
    assert all((ticks, values) == ([0, 2], [0, 0]) for ticks, values in curves(plain))


def test_runs_of_one_value_need_only_their_ends(exported):
    wave = np.array([0, 0, 0, 0, 4, 4, 4, 1, 0, 0, 0, 0, 0], float)
    plain, _ = exported(Recording(samples=np.broadcast_to(wave[:, None, None], (13, 4, 4)), rate=100))
    for ticks, values in curves(plain):
        assert ticks == [0, 3, 4, 6, 7, 8, 12]
        np.testing.assert_allclose(4 * np.interp(np.arange(13), ticks, values), wave, atol=4 / 32767)


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
