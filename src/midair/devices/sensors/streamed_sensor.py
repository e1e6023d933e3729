"""A sensor whose channels are streamed: from the network, a sound card, a serial port or a converter."""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from midair.devices.interface import FrameBlock, SensorDevice
from midair.devices.sensors.sources import Chunk, Source, Stream
from midair.errors import DeviceError, DeviceStateError, InputError, MismatchError
from midair.model import Calibration, Recording, SensorWiring
from midair.validation import within


class Reader:
    """Buffers chunks of a started source up to `limit` bytes; beyond it the newest chunks are dropped.

    `pull` is called from the reader's thread only.
    """

    def __init__(self, source: Source, rate: float, *, limit: float) -> None:
        self._source, self._rate, self._limit = source, rate, limit
        self._waiting: deque[Chunk] = deque()
        self._held = 0
        self._failure: Exception | None = None
        self._ends = threading.Event()
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="midair source", daemon=True)
        self._thread.start()

    def take(self, wait: float) -> Chunk | None:
        """Return the oldest chunk, waiting up to `wait` seconds, or None; raises the source's error after its last
        chunk.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._failure, wait)
            if self._waiting:
                chunk = self._waiting.popleft()
                self._held -= chunk.samples.nbytes
                return chunk
            if self._failure is not None:
                raise self._failure
            return None

    def ready(self, wait: float) -> bool:
        """Wait up to `wait` seconds; True if `take` would return a chunk, or raise, at once."""
        if self._waiting:
            return True
        with self._changed:
            return bool(self._changed.wait_for(lambda: self._waiting or self._failure, wait))

    def stop(self) -> None:
        """End the thread; buffered chunks are discarded."""
        self._ends.set()
        self._thread.join(5.0)

    def _run(self) -> None:
        try:
            while not self._ends.is_set():
                # A short wait, so that `stop` is noticed even without data.
                chunk = self._source.pull(0.1)
                if chunk is not None:
                    for part in chunk.finite_parts(self._rate):
                        self._put(part)
        except Exception as wrong:  # noqa: BLE001  # the next call of `take` raises it
            with self._changed:
                self._failure = wrong
                self._changed.notify_all()

    def _put(self, chunk: Chunk) -> None:
        with self._changed:
            if self._held + chunk.samples.nbytes > self._limit:
                return
            self._waiting.append(chunk)
            self._held += chunk.samples.nbytes
            self._changed.notify_all()


class StreamedSensor(SensorDevice):
    """Returns the frames of a source as blocks of cells of the requested length.

    A thread reads the source continuously, so that `read` may be late by as much as `memory` holds: 64 MB are 20 s of
    16 channels at 48 kHz in float32, and 17 minutes at 1 kHz.

    `wire` returns the wiring for an opened stream; by default cells in the order of the channels, in the unit of the
    source or counts. `timeout` is the time without a frame after which the source counts as lost, in s. `memory` for
    unread frames is in bytes; frames that do not fit are lost, and counted.
    """

    def __init__(
        self,
        source: Source,
        *,
        name: str,
        wire: Callable[[Stream], SensorWiring] | None = None,
        timeout: float = 2.0,
        memory: float = 64e6,
    ) -> None:
        self.name, self.source, self.timeout = name, source, timeout
        self._wire, self._memory = wire or self._in_order, memory
        self._stream: Stream | None = None
        self._reader: Reader | None = None
        self._rest: Chunk | None = None
        self._next = 0
        self._scale = 1.0
        self._lost = 0

    def __getattr__(self, attribute: str) -> Any:
        """Raise a clear error for attributes that are known only once the source is open."""
        if attribute in ("rate", "grid", "unit"):
            raise DeviceStateError(f"{self.name}: expected open before reading its {attribute}")
        raise AttributeError(attribute)

    def open(self) -> None:
        """Open the source and read its channels and rate."""
        if self._stream is not None:
            return
        try:
            stream = self.source.open()
            wiring = self._wire(stream)
            if wiring.channels > stream.channels:
                raise MismatchError(
                    f"{self.name}: expected {wiring.channels} channels for {wiring.grid.rows} x {wiring.grid.columns} "
                    f"cells, got {stream.channels}; correct rows, columns and order in the sensor file"
                )
            scale = _scale(self.name, stream, wiring)
            clips = None if stream.full_scale is None else stream.full_scale * scale
            # The user's statement takes precedence over the source's.
            self.wiring = replace(wiring, full_scale=wiring.full_scale or clips)
            self.grid, self.rate, self.unit, self._scale = wiring.grid, stream.rate, wiring.unit, scale
            self.full_scale = self.wiring.full_scale
            # A power of two does not change the mantissa.
            self.stored = stream.stored if abs(np.frexp(scale)[0]) == 0.5 else "f8"
            if wiring.sensitivity is not None:
                self.calibration = Calibration.flat(wiring.grid, sensitivity=wiring.sensitivity, unit=wiring.unit)
        except BaseException:
            self.source.close()
            raise
        self._stream = stream

    def start(self) -> None:
        """Start sampling; a second start begins again at frame 0."""
        if self._stream is None:
            raise DeviceStateError(f"{self.name}: expected open before start")
        self.stop()
        self._rest, self._next, self._lost = None, 0, 0
        self.source.start()
        self._reader = Reader(self.source, self._stream.rate, limit=self._memory)

    def read(self, frames: int) -> FrameBlock:
        """Return the next `frames` frames, or fewer up to a gap or to the loss of the source."""
        if self._reader is None or self.wiring is None:
            raise DeviceStateError(f"{self.name}: expected start before read")
        within(frames, f"{self.name}: frames to read", 1)
        parts = self._parts(self._reader, frames)
        first, lost = parts[0], parts[0].first - self._next
        self._next = parts[-1].first + len(parts[-1])
        self._lost += lost
        samples = np.concatenate([part.samples for part in parts]).astype(np.float64) * self._scale
        return FrameBlock(
            samples=self.wiring.arrange(samples),
            first=first.first,
            device_time=first.device_time,
            host_time=first.host_time,
            overflow=lost > 0 or first.uncertain,
        )

    def ready(self, wait: float) -> bool:
        """Wait up to `wait` seconds; True if `read` would return a frame, or raise, at once."""
        if self._reader is None:
            raise DeviceStateError(f"{self.name}: expected start before read")
        return self._rest is not None or self._reader.ready(wait)

    def stop(self) -> None:
        """Stop sampling; no effect if not started."""
        reader, self._reader = self._reader, None
        if reader is not None:
            reader.stop()
            self.source.stop()

    def close(self) -> None:
        """Stop, and close the source."""
        self.stop()
        if self._stream is not None:
            self._stream = None
            self.source.close()

    def describe(self) -> dict[str, str]:
        """Information about the source, and the number of lost frames since start."""
        info = self.source.describe()
        if self._stream is not None:
            info |= {"channels": str(self._stream.channels), "rate": f"{self._stream.rate:g} Hz"}
        return {**info, "lost frames": str(self._lost)}

    def _parts(self, reader: Reader, frames: int) -> list[Chunk]:
        """Consecutive chunks, at least one."""
        parts: list[Chunk] = []
        while frames > 0:
            try:
                chunk = reader.take(self.timeout) if self._rest is None else self._rest
            except Exception:
                # Return the frames before a failure first; the next read raises it.
                if parts:
                    return parts
                raise
            self._rest = None
            if chunk is None and not parts:
                raise DeviceError(
                    f"{self.name}: expected frames, got none for {self.timeout:g} s; check that it is connected, "
                    "switched on and sending"
                )
            if chunk is None or (parts and (chunk.uncertain or chunk.first != parts[-1].first + len(parts[-1]))):
                self._rest = chunk
                return parts
            if len(chunk) > frames:
                self._rest = chunk.part(frames, len(chunk), self.rate)
                chunk = chunk.part(0, frames, self.rate)
            parts.append(chunk)
            frames -= len(chunk)
        return parts

    def _in_order(self, stream: Stream) -> SensorWiring:
        return SensorWiring.for_channels(stream.channels, name=self.name, unit=stream.unit or "count")


def _scale(name: str, stream: Stream, wiring: SensorWiring) -> float:
    """Factor from the source's numbers to the sensor's unit."""
    if stream.unit is not None:
        if stream.unit != wiring.unit:
            raise MismatchError(
                f"{name}: expected samples in {wiring.unit}, the source states {stream.unit}; set unit={stream.unit}"
            )
        return stream.scale
    if stream.full_scale is None or wiring.unit == "count":
        return 1.0
    if wiring.full_scale is None:
        raise InputError(
            f"{name}: expected full_scale for a unit of {wiring.unit}, the source reports only fractions of it; "
            f"set full_scale in {wiring.unit}, or unit=count"
        )
    return wiring.full_scale / stream.full_scale


class ReplaySensor(SensorDevice):
    """Returns the frames of a recording, then none."""

    on_demand = True

    def __init__(self, recording: Recording, *, calibration: Calibration | None = None, name: str = "replay") -> None:
        self.name, self.grid, self.rate, self.unit = name, recording.sensor, recording.rate, recording.unit
        self.calibration, self.simulated = calibration, recording.provenance.simulated
        self._recording = recording
        self._taken: int | None = None

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


class WrappedSensor(SensorDevice):
    """Passes everything on to another sensor; `wiring` reorders its cells, `paced` returns its frames in real time.

    The wiring, to simulate or to correct swapped wires, assigns the sensor's cells, row by row, to channels; its grid
    and name apply, its unit and scale do not, and the sensor's calibration is left out. A sensor whose time advances
    only when it is read (`on_demand`) can be paced.
    """

    def __init__(self, sensor: SensorDevice, wiring: SensorWiring | None = None, *, paced: bool = False) -> None:
        self._sensor, self._wiring, self._begin = sensor, wiring, 0.0
        self.name, self.rate, self.unit = sensor.name, sensor.rate, sensor.unit
        self.simulated, self.full_scale, self.stored = sensor.simulated, sensor.full_scale, sensor.stored
        self.on_demand = sensor.on_demand and not paced
        self.grid, self.wiring, self.calibration = sensor.grid, sensor.wiring, sensor.calibration
        if wiring is not None:
            self.grid, self.wiring, self.calibration = wiring.grid, wiring, None
        self._paced = paced

    def open(self) -> None:
        """Open the other sensor."""
        self._sensor.open()

    def start(self) -> None:
        """Start the other sensor; the time of the first frame of a paced one is now."""
        self._sensor.start()
        self._begin = time.monotonic()

    def read(self, frames: int) -> FrameBlock:
        """Return the sensor's next frames; of a paced one, once the time of the last of them has come."""
        block = self._sensor.read(frames)
        if self._wiring is not None:
            samples = np.asarray(block.samples, np.float64).reshape(len(block.samples), self._sensor.grid.count)
            block = replace(block, samples=self._wiring.arrange(samples))
        if not self._paced:
            return block
        first, end = block.first / self.rate, self._begin + (block.first + len(block.samples)) / self.rate
        time.sleep(max(0.0, end - time.monotonic()))
        return replace(block, device_time=first, host_time=self._begin + first)

    def stop(self) -> None:
        """Stop the other sensor."""
        self._sensor.stop()

    def close(self) -> None:
        """Close the other sensor."""
        self._sensor.close()

    def describe(self) -> dict[str, str]:
        """Description of the other sensor."""
        return self._sensor.describe()
