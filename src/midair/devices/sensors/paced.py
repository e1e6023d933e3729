"""A sensor with its own time, such as a replayed file, at the pace of this computer's clock."""

import time
from dataclasses import replace

from midair.devices.interface import FrameBlock, SensorDevice


class PacedSensor(SensorDevice):
    """Returns the frames of another sensor, whose time advances only when it is read (`on_demand`), in real time."""

    def __init__(self, sensor: SensorDevice) -> None:
        self._sensor = sensor
        self.name, self.grid, self.rate, self.unit = sensor.name, sensor.grid, sensor.rate, sensor.unit
        self.calibration, self.simulated, self.full_scale = sensor.calibration, sensor.simulated, sensor.full_scale
        self.wiring, self.stored = sensor.wiring, sensor.stored
        self._begin = 0.0

    def open(self) -> None:
        """Open the other sensor."""
        self._sensor.open()

    def start(self) -> None:
        """Start the other sensor; the time of its first frame is now."""
        self._sensor.start()
        self._begin = time.monotonic()

    def read(self, frames: int) -> FrameBlock:
        """Return the next frames, once the time of the last of them has come."""
        block = self._sensor.read(frames)
        end = self._begin + (block.first + len(block.samples)) / self.rate
        time.sleep(max(0.0, end - time.monotonic()))
        first = block.first / self.rate
        return replace(block, device_time=first, host_time=self._begin + first)

    def stop(self) -> None:
        """Stop the other sensor."""
        self._sensor.stop()

    def close(self) -> None:
        """Close the other sensor."""
        self._sensor.close()
