import numpy as np
import pytest

from midair.devices import VirtualSkin
from midair.errors import RateError, ShapeError
from midair.model import PressureFrames, SensorGrid
from midair.physics.sensing import SensorModel


def test_pressures_are_appended_in_order():
    skin = VirtualSkin(SensorModel())
    skin.touch(PressureFrames(pressure=np.full((3, 4, 4), 7.0), rate=8000.0))
    skin.press(np.full((2, skin.points.count), 5.0))
    # Sound that ends at the last point rings a little: 1 % of it at the next cell.
    np.testing.assert_allclose(skin.pressure(8)[:, 0, 0], [7, 7, 7, 5, 5, 0, 0, 0], rtol=1e-2)
    skin.clear()
    assert len(skin.pressure(0)) == 0


def test_a_stroke_of_another_rate_or_sensor_is_refused():
    skin = VirtualSkin(SensorModel())
    with pytest.raises(RateError, match="8000 Hz"):
        skin.touch(PressureFrames(pressure=np.ones((3, 4, 4)), rate=1000.0))
    with pytest.raises(ShapeError, match="cells"):
        skin.touch(PressureFrames(pressure=np.ones((3, 2, 2)), rate=8000.0, sensor=SensorGrid(rows=2, columns=2)))
