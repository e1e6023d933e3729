"""MPEG haptics: the curve of every cell is read back from the JSON, and losses are reported."""

import json

import numpy as np
import pytest

from midair.files import save
from midair.model import Provenance, Recording


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
