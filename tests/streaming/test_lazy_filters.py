import numpy as np
import pytest

from midair import dsp
from midair.calibration.inverse import default_taps, inverse_response
from midair.model import SensorGrid
from midair.physics import SensorModel, calibration_of
from midair.streaming import LazyFrames

RNG = np.random.default_rng(0)
X = RNG.standard_normal((60_000, 2, 2)) + 0.01 * RNG.standard_normal((60_000, 2, 2)).cumsum(axis=0)


@pytest.fixture(autouse=True)
def _many_segments(monkeypatch):
    monkeypatch.setattr("midair.streaming.lazy_filters.BYTES", 2**17)  # 4096 frames


def reel_of(x):
    return LazyFrames(lambda first, last: x[first:last], x.shape)


@pytest.mark.parametrize(("rate", "band"), [(1000.0, (20, 470)), (8000.0, (20, 470)), (1000.0, (5, 400))])
def test_a_sensor_is_undone_to_thirty_millionths(rate, band):
    # The response of the inverse after one reach, four periods of its narrowest edge, is -90 dB of the peak.
    calibration = calibration_of(SensorModel(grid=SensorGrid(rows=2, columns=2)))
    edges = dsp.band_edges(band, rate)
    reach = 2 * default_taps(rate, edges) / rate

    def undo(frequency):
        return inverse_response(calibration, frequency, band, edges=edges)

    want = dsp.filter_response(X, rate, undo, reach=reach)
    made = np.asarray(dsp.filter_response(reel_of(X), rate, undo, reach=reach))
    assert np.abs(made - want).max() < 3e-5 * np.abs(want).max()


@pytest.mark.parametrize("frames", [1, 30, 900])
def test_short_and_constant_lazy_frames_equal_arrays(frames):
    def halved(frequency):
        return np.full((len(frequency), 1, 1), 0.5)

    x = X[:frames] + 3
    made = np.asarray(dsp.filter_response(reel_of(x), 1000, halved, reach=0.1))
    np.testing.assert_allclose(made, x / 2, atol=1e-12)
