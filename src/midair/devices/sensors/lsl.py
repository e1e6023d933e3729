"""Sensors that send streams of the Lab Streaming Layer; needs the extra `lsl`.

LSL uses TCP: frames are lost in transmission only if the connection is lost, which is an error here. Frames that the
sender omits are counted exactly if it sends a counter channel (option `counter`); otherwise they are inferred from the
time stamps, as accurately as the sender stamps. A jump of the sender's clock is removed from the times and reported.
"""

import time
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import pylsl
from numpy.typing import NDArray
from pylsl.util import LostError, TimeoutError

from midair.devices.liblsl import quiet_liblsl
from midair.devices.sensors.frame_numbers import CountedFrames, Run, StampedFrames, StatedRate, SteadyStamps, runs
from midair.devices.sensors.sources import Chunk, Samples, SensorOptions, Stream, above_zero, opened
from midair.errors import DeviceError, InputError, RateError, UnitError
from midair.model import known_unit


class LslSource:
    """A stream on this network, selected by name.

    `source_id` selects one of several streams of that name. `counter` is the channel that counts frames, from 0, which
    is removed from the data. `search` limits the time to find the stream, and then to connect to it, in s.
    """

    def __init__(
        self, name: str, *, source_id: str | None = None, counter: int | None = None, search: float = 5.0
    ) -> None:
        self._name, self._source_id, self._counter, self._search = name, source_id, counter, search
        self._inlet: pylsl.StreamInlet | None = None
        self._rate, self._correction = 1.0, 0.0
        self._counted: CountedFrames | None = None
        self._full = False  # the counter is no longer exact
        self._stamped, self._steady = StampedFrames(1.0), SteadyStamps(1.0)
        self._waiting: deque[Chunk] = deque()
        self._stated = StatedRate(1.0)
        self._host_name = ""

    def open(self) -> Stream:
        """Find the stream and connect to its sender."""
        quiet_liblsl()
        found = self._find()
        # No recovery: it would silently continue with another run of the sender.
        # Original stamps: smoothed ones hide missing frames.
        self._inlet = pylsl.StreamInlet(
            found, max_buflen=60, recover=False, processing_flags=pylsl.proc_threadsafe, as_numpy=True
        )
        try:
            info = self._inlet.info(timeout=self._search)
            # This takes up to a second; `start` must be fast, since an array may wait for it.
            self._inlet.open_stream(timeout=self._search)
            self._correction = self._inlet.time_correction(timeout=self._search)
        except (LostError, TimeoutError) as wrong:
            raise self._lost() from wrong
        if info.channel_format() == pylsl.cf_string:
            raise DeviceError(f"lsl: expected numbers from {self._name!r}, got text; select another stream")
        self._rate, channels = float(info.nominal_srate()), int(info.channel_count())
        if self._rate <= 0:
            raise RateError(
                f"lsl: expected a regular rate of {self._name!r}, got none; select a stream of samples, not of events"
            )
        if self._counter is not None:
            if not 0 <= self._counter < channels:
                raise InputError(f"lsl: expected a counter among channels 0 to {channels - 1}, got {self._counter}")
            channels -= 1
        self._host_name = str(info.hostname())
        stated = info.get_channel_units() or []
        units = {known_unit(name or "") for at, name in enumerate(stated) if at != self._counter}
        if len(units) > 1 and any(factor != 1 for _, factor in units):
            named = ", ".join(sorted({name or "none" for name in stated}))
            raise UnitError(
                f"lsl: expected one unit in all channels of {self._name!r}, got {named}; correct the sender"
            )
        unit, scale = units.pop() if len(units) == 1 else (None, 1.0)
        stored = "f4" if info.channel_format() in (pylsl.cf_float32, pylsl.cf_int16, pylsl.cf_int8) else "f8"
        return Stream(channels=channels, rate=self._rate, unit=unit, scale=scale, stored=stored)

    def start(self) -> None:
        """Subscribe to the stream, or discard the data received so far."""
        inlet = opened(self._inlet, "lsl")
        try:
            inlet.open_stream(timeout=self._search)
            self._correction = inlet.time_correction(timeout=self._search)
        except (LostError, TimeoutError) as wrong:
            raise self._lost() from wrong
        inlet.flush()
        self._counted, self._full = None, False
        self._stamped, self._steady = StampedFrames(self._rate), SteadyStamps(self._rate)
        self._waiting.clear()
        self._stated = StatedRate(self._rate)

    def pull(self, wait: float) -> Chunk | None:
        """Return received frames; host times are the sender's stamps converted to this computer's clock."""
        if self._waiting:
            return self._waiting.popleft()
        inlet = opened(self._inlet, "lsl")
        try:
            # Without `min_samples` a pull with a time limit would wait for all 4096 samples.
            samples, stamps = inlet.pull_chunk(timeout=wait, max_samples=4096, min_samples=1)
            with suppress(TimeoutError):  # no newer one yet
                self._correction = inlet.time_correction(timeout=1e-3)
        except LostError as wrong:
            self._enqueue(self._stamped.rest())
            if not self._waiting:
                raise self._lost() from wrong
        else:
            if len(stamps):
                self._enqueue(self._runs(np.array(samples), np.asarray(stamps, np.float64)))
        return self._waiting.popleft() if self._waiting else None

    def stop(self) -> None:
        """Unsubscribe from the stream; its sender continues."""
        if self._inlet is not None:
            self._inlet.close_stream()

    def close(self) -> None:
        """Disconnect from the sender."""
        self._inlet = None

    def describe(self) -> dict[str, str]:
        """Sender, library version, and the method that detects gaps."""
        by = "its stamps" if self._counter is None else "its counter"
        by = "its counter, and since that is full its stamps" if self._full else by
        info = {"sender": self._host_name, "liblsl": str(pylsl.library_version()), "gaps found by": by}
        jumps = self._steady.jumps
        return info | ({"jumps of its stamps": f"{jumps}, the last by {self._steady.last:+.3g} s"} if jumps else {})

    def _find(self) -> pylsl.StreamInfo:
        source = "" if self._source_id is None else f" and source_id='{self._source_id}'"
        found = pylsl.resolve_bypred(f"name='{self._name}'{source}", 1, self._search)
        if not found:
            others = sorted({each.name() for each in pylsl.resolve_streams(1.0)}) or ["none"]
            raise DeviceError(
                f"lsl: expected a stream called {self._name!r}, found none in {self._search:g} s; start its sender "
                f"in the same network. Streams found: {', '.join(others)}"
            )
        if len(found) > 1:
            names = ", ".join(sorted(each.source_id() or "none" for each in found))
            raise DeviceError(
                f"lsl: expected one stream called {self._name!r}, found {len(found)}; select by ?source_id=: {names}"
            )
        return found[0]

    def _runs(self, samples: Samples, stamps: NDArray[np.float64]) -> Iterator[Run]:
        """Frames with known numbers, in runs without a gap; the first one since start is 0."""
        self._stated.check(stamps)
        arrived = pylsl.local_clock() - self._correction
        if self._counter is None:
            yield from self._stamped.add(samples, stamps, arrived=arrived)
            return
        counter, samples = samples[:, self._counter], np.delete(samples, self._counter, axis=1)
        number = None if self._full else self._count(counter)
        self._full = number is None
        if number is None:
            yield from self._stamped.add(samples, stamps, arrived=arrived)
        else:
            yield from runs(number, samples, stamps)

    def _count(self, counter: Samples) -> NDArray[np.int64] | None:
        """Frame numbers from the counter; None once it is not exact, after which the stamps are used."""
        if self._counted is None:
            self._counted = CountedFrames(counter.dtype)
        try:
            number = self._counted.number(counter.astype(np.float64))
        except ValueError as wrong:
            raise DeviceError(
                f"lsl: expected an increasing counter from {self._name!r}, it decreased; the sender restarted"
            ) from wrong
        if number is None:
            self._stamped = StampedFrames(self._rate, first=self._counted.frames)
        return number

    def _enqueue(self, found: Iterable[Run]) -> None:
        # Both clocks are monotonic with the same rate; only their origins differ.
        offset = time.monotonic() - pylsl.local_clock() + self._correction
        for run in map(self._steady.steady, found):
            self._waiting.append(
                Chunk(
                    samples=run.samples,
                    first=run.first,
                    device_time=run.first / self._rate,
                    host_time=run.stamp + offset,
                    uncertain=run.jump != 0,
                )
            )

    def _lost(self) -> DeviceError:
        return DeviceError(f"lsl: lost the sender of {self._name!r}; make sure that it runs, then start again")


@dataclass(frozen=True, kw_only=True)
class LslSensor(SensorOptions):
    """Kind ``lsl:NAME``; further options as in `LslSource`."""

    package = "pylsl"
    source_id: str | None = None
    counter: int | None = None
    search: float = above_zero(5.0, "Longest time to find the stream.", "s")

    def source(self, place: str) -> LslSource:
        """Stream of a name."""
        return LslSource(place, source_id=self.source_id, counter=self.counter, search=self.search)

    @classmethod
    def available(cls) -> str:
        """Version of the library."""
        return f"liblsl {pylsl.library_version()}; streams are looked for when one is opened"
