import numpy as np
import pytest

from midair.physics.lazy_sensing import channel_volts
from midair.physics.sensing import SensorModel, sense

# Steps of the converter far below the rounding of the sums.
FINE = SensorModel(bits=32, full_scale=1e-3, noise=0.0, delay=np.linspace(0, 3e-4, 16).reshape(4, 4)).with_spread(
    seed=3
)


@pytest.mark.parametrize(("steps", "over"), [(801, 8), (800, 8), (3, 8), (500, 1), (1000, 3)])
def test_each_channel_equals_the_result_in_memory(steps, over):
    pressure = 1e-3 * np.random.default_rng(steps).standard_normal((steps, 4, 4))
    whole = sense(FINE, pressure, 1000.0, oversample=over)
    for number in (0, 6, 15):
        cell = pressure.reshape(steps, -1)[:, number]
        volts = channel_volts(FINE, number, lambda first, cell=cell: cell[first::over], steps, 1000.0, oversample=over)
        np.testing.assert_allclose(volts, whole.reshape(len(whole), -1)[:, number], atol=FINE.step)
