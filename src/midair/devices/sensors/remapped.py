"""A sensor with its channels in another order."""

from dataclasses import replace

import numpy as np

from midair.devices.interface import FrameBlock, SensorDevice
from midair.model import SensorWiring


class RemappedSensor(SensorDevice):
    """A sensor with reordered channels, to simulate or to correct swapped wires.

    Parameters
    ----------
    wiring : SensorWiring
        Assignment of the sensor's cells, row by row, to channels; its grid and name apply, its unit and scale do not.
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
        """Return the sensor's next frames with reordered channels."""
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
        """Description of the sensor."""
        return self._sensor.describe()
