import time

import numpy as np
import pytest

from midair.devices import PacedSensor, RemappedSensor, ReplaySensor
from midair.errors import DeviceStateError
from midair.model import Provenance, Recording, SensorGrid, SensorWiring

TAKE = Recording(samples=np.random.default_rng(0).random((300, 4, 4)), rate=1000.0)


def test_frames_come_when_their_time_has_come_and_not_sooner():
    with PacedSensor(ReplaySensor(TAKE, name="replay:x")) as sensor:
        assert (sensor.name, sensor.rate, sensor.on_demand) == ("replay:x", 1000.0, False)
        sensor.start()
        begin = time.monotonic()
        for first in range(0, 300, 50):
            block = sensor.read(50)
            np.testing.assert_array_equal(block.samples, TAKE.samples[first : first + 50])
            assert time.monotonic() - begin >= (first + 50) / 1000 - 2e-3
            assert block.device_time == first / 1000
            assert abs(block.host_time - begin - first / 1000) < 1
        assert not len(sensor.read(50).samples), "it has ended"


def test_a_second_start_begins_again():
    with PacedSensor(ReplaySensor(TAKE)) as sensor:
        for _ in range(2):
            sensor.start()
            assert sensor.read(10).first == 0
            sensor.stop()


def test_cells_are_taken_in_the_other_order_and_the_name_is_the_wirings():
    samples = np.arange(3 * 16, dtype=float).reshape(3, 4, 4)
    wiring = SensorWiring(grid=SensorGrid(name="palm"), order=tuple(range(15, -1, -1)))
    with RemappedSensor(ReplaySensor(Recording(samples=samples, rate=500.0, unit="Pa")), wiring) as sensor:
        sensor.start()
        block = sensor.read(3)
    np.testing.assert_array_equal(block.samples, samples[:, ::-1, ::-1])
    assert (sensor.grid.name, sensor.rate, sensor.unit, sensor.wiring) == ("palm", 500.0, "Pa", wiring)
    # The calibration of another order would put every cell's response onto another cell.
    assert sensor.calibration is None


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
