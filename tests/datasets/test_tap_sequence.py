import numpy as np
import pytest

from midair.datasets import taps
from midair.errors import InputError
from midair.model import SensorGrid


def test_each_cell_is_tapped_in_its_own_second():
    made = taps(every=1.0, quiet=1.0, peak=30.0, spread=0.25, rate=1000.0)
    assert made.provenance.simulated
    cells = made.pressure.reshape(len(made.pressure), 16)
    assert not cells[:1000].any()
    seconds = cells[1000:17_000].reshape(16, 1000, 16).max(axis=1)
    np.testing.assert_array_equal(seconds.argmax(axis=1), np.arange(16))
    own = np.diag(seconds)
    assert 10 <= own.min() < own.max() <= 30
    assert seconds[0, 1] == seconds[0, 4] == pytest.approx(0.25 * own[0])
    assert seconds[0, 5] == pytest.approx(0.0625 * own[0])
    assert seconds[0, 15] == 0


def test_a_tap_is_a_half_sine_of_20_ms():
    made = taps(sensor=SensorGrid(rows=1, columns=1), rate=8000.0, seed=3)
    push = made.pressure[:, 0, 0]
    (pressed,) = np.nonzero(push)
    assert np.ptp(pressed) + 1 == 159, "160 steps, of which the first is 0"
    np.testing.assert_allclose(push[pressed], push.max() * np.sin(np.pi * np.arange(1, 160) / 160))


def test_the_seed_determines_the_taps():
    np.testing.assert_array_equal(taps(seed=1).pressure, taps(seed=1).pressure)
    assert (taps(seed=1).pressure != taps(seed=2).pressure).any()


@pytest.mark.parametrize("wrong", [{"every": 0.0}, {"rate": -1.0}, {"peak": 0.0}])
def test_invalid_taps_are_refused(wrong):
    with pytest.raises(InputError):
        taps(**wrong)
