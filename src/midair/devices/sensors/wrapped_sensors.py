"""Sensors that change the frames of another sensor: their pace, or the order of their channels."""

import time
from dataclasses import replace

import numpy as np

from midair.devices.interface import FrameBlock, SensorDevice
from midair.model import SensorWiring


class _WrappedSensor(SensorDevice):
    """Passes everything on to another sensor."""

    def __init__(self, sensor: SensorDevice) -> None:
        self._sensor = sensor
        self.name, self.grid, self.rate, self.unit = sensor.name, sensor.grid, sensor.rate, sensor.unit
        self.simulated, self.full_scale, self.stored = sensor.simulated, sensor.full_scale, sensor.stored

    def open(self) -> None:
        """Open the other sensor."""
        self._sensor.open()

    def start(self) -> None:
        """Start the other sensor."""
        self._sensor.start()

    def stop(self) -> None:
        """Stop the other sensor."""
        self._sensor.stop()

    def close(self) -> None:
        """Close the other sensor."""
        self._sensor.close()

    def describe(self) -> dict[str, str]:
        """Description of the other sensor."""
        return self._sensor.describe()


class PacedSensor(_WrappedSensor):
    """Returns the frames of another sensor, whose time advances only when it is read (`on_demand`), in real time."""

    def __init__(self, sensor: SensorDevice) -> None:
        super().__init__(sensor)
        self.calibration, self.wiring = sensor.calibration, sensor.wiring
        self._begin = 0.0

    def start(self) -> None:
        """Start the other sensor; the time of its first frame is now."""
        super().start()
        self._begin = time.monotonic()

    def read(self, frames: int) -> FrameBlock:
        """Return the next frames, once the time of the last of them has come."""
        block = self._sensor.read(frames)
        end = self._begin + (block.first + len(block.samples)) / self.rate
        time.sleep(max(0.0, end - time.monotonic()))
        first = block.first / self.rate
        return replace(block, device_time=first, host_time=self._begin + first)


class RemappedSensor(_WrappedSensor):
    """A sensor with reordered channels, to simulate or to correct swapped wires.

    `wiring` assigns the sensor's cells, row by row, to channels; its grid and name apply, its unit and scale do not.
    """

    def __init__(self, sensor: SensorDevice, wiring: SensorWiring) -> None:
        super().__init__(sensor)
        self.grid, self.wiring, self._order, self.on_demand = wiring.grid, wiring, wiring, sensor.on_demand

    def read(self, frames: int) -> FrameBlock:
        """Return the sensor's next frames with reordered channels."""
        block = self._sensor.read(frames)
        samples = np.asarray(block.samples, np.float64).reshape(len(block.samples), self._sensor.grid.count)
        return replace(block, samples=self._order.arrange(samples))
