import numpy as np

from midair.devices import RemappedSensor, ReplaySensor
from midair.model import Recording, SensorGrid, SensorWiring


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
