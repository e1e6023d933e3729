from dataclasses import replace

import numpy as np
import pytest

from midair.calibration import calibrate
from midair.datasets import am_stimulus
from midair.devices import VirtualSensor, VirtualSkin
from midair.model import PressureFrames, Recording
from midair.physics.sensing import SensorModel

TIME = np.arange(8000) / 8000


def touched(frequency, amplitude=20.0):
    pressure = np.zeros((8000, 4, 4))
    pressure[:, 2, 1] = amplitude * (1 - np.cos(2 * np.pi * frequency * TIME)) / 2
    return PressureFrames(pressure=pressure, rate=8000.0)


@pytest.mark.parametrize("frequency", [40, 100, 300])
def test_calibration_gives_back_what_pressed_and_after_the_touch_the_sensor_is_quiet(frequency):
    """A sine of known amplitude through the sensor's model and back through its own calibration."""
    sensor = VirtualSensor(VirtualSkin(SensorModel().with_spread(seed=5)), touch=touched(frequency))
    with sensor:
        sensor.start()
        samples = sensor.read(1000).samples
        assert sensor.read(1000).samples[500:].std() < 0.01
    recording = Recording(samples=samples, rate=1000.0, sensor=sensor.grid)
    pressure = calibrate(recording, sensor.calibration).pressure[200:800, 2, 1]
    time = np.arange(200, 800) / 1000
    amplitude = 2 * np.abs(np.mean(pressure * np.exp(2j * np.pi * frequency * time)))
    assert amplitude == pytest.approx(10.0, rel=0.02)
    assert np.abs(samples[:, 0, 0]).max() < 0.01 * np.abs(samples[:, 2, 1]).max()


def test_a_long_recording_is_sensed_piece_by_piece(monkeypatch):
    """A modulated focus of 3 s in pieces of 1 s equals the whole one to the noise, across the borders too."""

    def samples(whole, seconds):
        monkeypatch.setattr("midair.devices.virtual.virtual_array.WHOLE", whole)
        model = replace(SensorModel(), noise=0.0)
        with VirtualSensor(VirtualSkin(model), touch=am_stimulus("i", duration=seconds, rate=8000.0)) as sensor:
            sensor.start()
            return np.concatenate([sensor.read(50).samples for _ in range(60)])

    whole, pieces = samples(20.0, 3.0), samples(1.0, 4.0)
    assert np.abs(whole[:2900] - pieces[:2900]).max() <= 2 * SensorModel().step
    assert whole.std() > 100 * SensorModel().step


def test_pressures_are_appended_in_order():
    skin = VirtualSkin(SensorModel())
    skin.touch(PressureFrames(pressure=np.full((3, 4, 4), 7.0), rate=8000.0))
    skin.press(np.full((2, skin.points.count), 5.0))
    # Sound that ends at the last point rings a little: 1 % of it at the next cell.
    np.testing.assert_allclose(skin.pressure(8)[:, 0, 0], [7, 7, 7, 5, 5, 0, 0, 0], rtol=1e-2)
    skin.clear()
    assert len(skin.pressure(0)) == 0
