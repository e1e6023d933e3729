"""A recording as a source that never ends, at the pace of this computer's clock: what a live mode is tried out with."""

import time

import numpy as np
from numpy.typing import NDArray

from midair.devices import Chunk, SensorDevice, Stream, StreamedSensor
from midair.errors import DeviceStateError
from midair.model import SensorWiring


class RepeatedSource:
    """Gives frames again and again, a few at a time, when they are due: as a converter does.

    Parameters
    ----------
    samples : ndarray, shape (frame, channel)
        Of one round.
    stream : Stream
        What it is.
    block : int
        Frames in a piece.
    """

    def __init__(self, samples: NDArray[np.float64], stream: Stream, *, block: int = 2) -> None:
        self._samples, self._stream, self._block = samples, stream, block
        self._begin = 0.0
        self._next = 0

    def open(self) -> Stream:
        """Nothing to take hold of."""
        return self._stream

    def start(self) -> None:
        """The first frame is taken now."""
        self._begin, self._next = time.monotonic(), 0

    def pull(self, wait: float) -> Chunk | None:
        """The next piece when its last frame was taken."""
        first, rate = self._next, self._stream.rate
        left = self._begin + (first + self._block) / rate - time.monotonic()
        if left > wait:
            time.sleep(wait)
            return None
        time.sleep(max(0.0, left))
        self._next += self._block
        at = np.arange(first, first + self._block) % len(self._samples)
        # The moment of its end: it stands for the time up to there.
        taken = self._begin + (first + 1) / rate
        return Chunk(samples=self._samples[at], first=first, device_time=first / rate, host_time=taken)

    def stop(self) -> None:
        """Nothing to stop."""

    def close(self) -> None:
        """Nothing to let go of."""

    def describe(self) -> dict[str, str]:
        """How long a round is."""
        return {"round": f"{len(self._samples) / self._stream.rate:g} s, repeated"}


def streamed(sensor: SensorDevice, *, longest: float = 30.0) -> StreamedSensor:
    """A live sensor as it is; one whose time is its own, virtual or replayed, once felt and then repeated for ever.

    Parameters
    ----------
    sensor : SensorDevice
        Not open.
    longest : float
        Of a round, in s.

    Raises
    ------
    DeviceStateError
        If it is neither.
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
