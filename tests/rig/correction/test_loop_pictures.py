import numpy as np
import pytest

from midair.model import Drive, PressureFrames, SensorGrid, TransducerArray
from midair.rig.correction.loop_pictures import _level_text, strongest_channels


def touched(channels, sensor):
    """Pressure on these channels, the harder the later in the list."""
    pressure = np.zeros((50, sensor.count))
    for loudness, channel in enumerate(channels, 1):
        pressure[:, channel] = loudness * np.sin(np.arange(50))
    return PressureFrames(pressure=pressure.reshape(50, *sensor.shape), rate=1000.0, band=(20.0, 400.0), sensor=sensor)


@pytest.mark.parametrize("channels", [[5, 0, 9, 1], [3, 7]])
def test_the_channels_that_were_pressed_hardest_are_shown(channels):
    found = strongest_channels(touched(channels, SensorGrid()))
    assert set(channels) <= set(found)
    assert found == sorted(found)


def test_a_small_sensor_has_fewer():
    assert strongest_channels(touched([1], SensorGrid(rows=1, columns=2))) == [0, 1]


@pytest.mark.parametrize(("level", "words"), [(0.7, "all have the same level"), ((0.2, 0.5), "0.20 to 0.50 of full")])
def test_the_caption_of_the_array_states_its_levels(level, words):
    array = TransducerArray.autd3()
    levels = np.resize(np.atleast_1d(level), (3, array.count))
    drive = Drive(phase=np.zeros((3, array.count)), level=levels, rate=1000.0, array=array)
    assert words in _level_text(drive, 1)
