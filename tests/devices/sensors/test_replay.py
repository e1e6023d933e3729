import numpy as np
import pytest

from midair.devices import ReplaySensor
from midair.errors import DeviceStateError
from midair.model import Provenance, Recording, SensorGrid

RECORDING = Recording(
    samples=np.arange(40.0).reshape(10, 2, 2),
    rate=500.0,
    unit="count",
    sensor=SensorGrid(rows=2, columns=2, name="palm"),
    provenance=Provenance(simulated=True),
)


def test_frames_come_in_order_until_there_are_none():
    with ReplaySensor(RECORDING) as sensor:
        sensor.start()
        blocks = [sensor.read(4) for _ in range(4)]
    assert [(block.first, len(block.samples)) for block in blocks] == [(0, 4), (4, 4), (8, 2), (10, 0)]
    assert [block.device_time for block in blocks] == [0, 0.008, 0.016, 0.02]
    np.testing.assert_array_equal(np.concatenate([block.samples for block in blocks]), RECORDING.samples)


def test_it_is_what_the_recording_is():
    sensor = ReplaySensor(RECORDING)
    assert (sensor.grid, sensor.rate, sensor.unit, sensor.simulated) == (RECORDING.sensor, 500.0, "count", True)
    assert sensor.on_demand


def test_it_begins_anew_at_each_start():
    sensor = ReplaySensor(RECORDING)
    with pytest.raises(DeviceStateError, match="start before read"):
        sensor.read(1)
    sensor.start()
    sensor.read(7)
    sensor.start()
    assert sensor.read(1).first == 0
    sensor.stop()
    with pytest.raises(DeviceStateError, match="start before read"):
        sensor.read(1)
