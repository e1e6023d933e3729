"""A recording played back as a sensor."""

import numpy as np

from midair.devices.interface import FrameBlock, SensorDevice
from midair.errors import DeviceStateError
from midair.model import Calibration, Recording


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
