"""A recording as an endless real-time source, for tests of live touch without a live sensor."""

import time

import numpy as np
from numpy.typing import NDArray

from midair.devices import Chunk, SensorDevice, Stream, StreamedSensor
from midair.errors import DeviceStateError
from midair.model import SensorWiring


class RepeatedSource:
    """Repeats `samples`, shape (frame, channel), in real time, in blocks of `block` frames as a converter does."""

    def __init__(self, samples: NDArray[np.float64], stream: Stream, *, block: int = 2) -> None:
        self._samples, self._stream, self._block = samples, stream, block
        self._begin = 0.0
        self._next = 0

    def open(self) -> Stream:
        """Return the stream."""
        return self._stream

    def start(self) -> None:
        """Start with the first frame now."""
        self._begin, self._next = time.monotonic(), 0

    def pull(self, wait: float) -> Chunk | None:
        """Return the next block when its last frame is due."""
        first, rate = self._next, self._stream.rate
        left = self._begin + (first + self._block) / rate - time.monotonic()
        if left > wait:
            time.sleep(wait)
            return None
        time.sleep(max(0.0, left))
        self._next += self._block
        at = np.arange(first, first + self._block) % len(self._samples)
        # Time stamp of the end of the frame.
        taken = self._begin + (first + 1) / rate
        return Chunk(samples=self._samples[at], first=first, device_time=first / rate, host_time=taken)

    def stop(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def describe(self) -> dict[str, str]:
        """Duration of the period."""
        return {"round": f"{len(self._samples) / self._stream.rate:g} s, repeated"}


def streamed(sensor: SensorDevice, *, longest: float = 30.0) -> StreamedSensor:
    """Return a live sensor; record an on-demand one (virtual or replayed) for `longest` seconds and repeat it.

    DeviceStateError if the sensor is neither.
    """
    if isinstance(sensor, StreamedSensor):
        return sensor
    if not sensor.on_demand:
        raise DeviceStateError(f"{sensor.name}: expected a live sensor, or one that can be repeated")
    with sensor:
        sensor.start()
        block = sensor.read(round(longest * sensor.rate))
    samples = np.asarray(block.samples).reshape(len(block.samples), -1)
    stream = Stream(channels=sensor.grid.count, rate=sensor.rate, unit=sensor.unit)
    wiring = SensorWiring(grid=sensor.grid, order=tuple(range(sensor.grid.count)), unit=sensor.unit)
    made = StreamedSensor(RepeatedSource(samples, stream), name=sensor.name, wire=lambda _: wiring)
    made.calibration, made.simulated = sensor.calibration, sensor.simulated
    return made
