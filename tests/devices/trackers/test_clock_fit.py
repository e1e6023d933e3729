import numpy as np
import pytest

from midair.devices.trackers.tracker import ClockFit


@pytest.mark.parametrize("drift", [0.0, 1e-4, -1e-4])
def test_a_clock_that_drifts_is_followed_below_delays_that_vary(drift):
    rng = np.random.default_rng(3)
    true = np.arange(0, 60, 1 / 110)
    stamps = 5000 + true * (1 + drift)
    fit, error = ClockFit(), []
    for at, stamp in zip(true, stamps, strict=True):
        fit.add(stamp, at + 2e-3 + rng.exponential(5e-3))
        error.append(fit.time(stamp) - at - 2e-3)
    settled = np.array(error[110 * 10 :])
    assert np.abs(settled).max() < 1e-3
    assert settled.std() < 3e-4


def test_stamps_of_the_clock_of_this_computer_stay():
    fit = ClockFit()
    for at in np.arange(100.0, 101, 0.01):
        fit.add(at - 0.03, at)
        assert fit.time(at - 0.03) == at - 0.03
