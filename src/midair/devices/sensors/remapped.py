"""A sensor whose channels are taken in another order."""

from dataclasses import replace

import numpy as np

from midair.devices.interface import FrameBlock, SensorDevice
from midair.model import SensorWiring


class RemappedSensor(SensorDevice):
    """Another sensor, cell k of which is channel k here: wires that were swapped, or that are put right again.

    Parameters
    ----------
    sensor : SensorDevice
        Its cells, row by row, are the channels.
    wiring : SensorWiring
        Which channel is which cell; its grid and name are this sensor's. Unit and scale stay the sensor's.
    """

    def __init__(self, sensor: SensorDevice, wiring: SensorWiring) -> None:
        self._sensor, self.wiring, self._order = sensor, wiring, wiring
        self.name, self.grid, self.rate, self.unit = sensor.name, wiring.grid, sensor.rate, sensor.unit
        self.simulated, self.full_scale, self.on_demand = sensor.simulated, sensor.full_scale, sensor.on_demand
        self.calibration, self.stored = None, sensor.stored

    def open(self) -> None:
        """Open the sensor."""
        self._sensor.open()

    def start(self) -> None:
        """Start the sensor."""
        self._sensor.start()

    def read(self, frames: int) -> FrameBlock:
        """The sensor's next frames, channels in the other order."""
        block = self._sensor.read(frames)
        samples = np.asarray(block.samples, np.float64).reshape(len(block.samples), self._sensor.grid.count)
        return replace(block, samples=self._order.arrange(samples))

    def stop(self) -> None:
        """Stop the sensor."""
        self._sensor.stop()

    def close(self) -> None:
        """Close the sensor."""
        self._sensor.close()

    def describe(self) -> dict[str, str]:
        """What the sensor says."""
        return self._sensor.describe()
