import numpy as np
import pytest

from midair.calibration import calibrate
from midair.devices import VirtualSensor, VirtualSkin
from midair.model import PressureFrames, Recording
from midair.physics.sensing import SensorModel
from midair.streaming import LazyFrames

TIME = np.arange(8000) / 8000


def touched(frequency, amplitude=20.0):
    pressure = np.zeros((8000, 4, 4))
    pressure[:, 2, 1] = amplitude * (1 - np.cos(2 * np.pi * frequency * TIME)) / 2
    return PressureFrames(pressure=pressure, rate=8000.0)


@pytest.mark.parametrize("frequency", [40, 100, 300])
def test_calibration_gives_back_what_pressed(frequency):
    """A sine of known amplitude through the sensor's model and back through its own calibration."""
    sensor = VirtualSensor(VirtualSkin(SensorModel().with_spread(seed=5)), touch=touched(frequency))
    with sensor:
        sensor.start()
        samples = sensor.read(1000).samples
    recording = Recording(samples=samples, rate=1000.0, sensor=sensor.grid)
    pressure = calibrate(recording, sensor.calibration).pressure[200:800, 2, 1]
    time = np.arange(200, 800) / 1000
    amplitude = 2 * np.abs(np.mean(pressure * np.exp(2j * np.pi * frequency * time)))
    assert amplitude == pytest.approx(10.0, rel=0.02)
    assert np.abs(samples[:, 0, 0]).max() < 0.01 * np.abs(samples[:, 2, 1]).max()


def test_reading_on_after_the_touch_gives_the_quiet_sensor():
    sensor = VirtualSensor(VirtualSkin(SensorModel()), touch=touched(100))
    with sensor:
        sensor.start()
        sensor.read(1000)
        late = sensor.read(1000).samples[500:]
    assert late.std() < 0.01


def test_a_long_take_waits_on_the_disk_and_is_the_same():
    heard = []
    for streamed in (False, True):
        sensor = VirtualSensor(VirtualSkin(SensorModel().with_spread(seed=5)), touch=touched(100))
        sensor.streamed = streamed
        with sensor:
            sensor.start()
            heard.append(sensor.read(1100).samples)
    assert isinstance(heard[1], LazyFrames)
    np.testing.assert_array_equal(*heard)
