"""Sensors that replay a recording, or change the pace or the order of channels of another sensor."""

import time
from dataclasses import replace

import numpy as np

from midair.devices.interface import FrameBlock, SensorDevice
from midair.errors import DeviceStateError
from midair.model import Calibration, Recording, SensorWiring


class ReplaySensor(SensorDevice):
    """Returns the frames of a recording, then none."""

    on_demand = True

    def __init__(self, recording: Recording, *, calibration: Calibration | None = None, name: str = "replay") -> None:
        self.name, self.grid, self.rate, self.unit = name, recording.sensor, recording.rate, recording.unit
        self.calibration, self.simulated = calibration, recording.provenance.simulated
        self._recording = recording
        self._taken: int | None = None

    def open(self) -> None:
        """Do nothing: there is no device to open."""

    def start(self) -> None:
        """Start at the recording's first frame."""
        self._taken = 0

    def read(self, frames: int) -> FrameBlock:
        """Return the next frames, until the recording ends."""
        if self._taken is None:
            raise DeviceStateError("replay: expected start before read")
        first = self._taken
        samples: np.ndarray = self._recording.samples[first : first + frames]
        self._taken += len(samples)
        now = first / self.rate
        return FrameBlock(samples=samples, first=first, device_time=now, host_time=now)

    def stop(self) -> None:
        """Stop the replay; the next start begins at the first frame."""
        self._taken = None

    def close(self) -> None:
        """Do nothing: there is no device to close."""


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
