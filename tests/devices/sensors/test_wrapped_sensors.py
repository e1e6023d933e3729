import time

import numpy as np

from midair.devices import PacedSensor, RemappedSensor, ReplaySensor
from midair.model import Recording, SensorGrid, SensorWiring

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
