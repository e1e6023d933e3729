"""A source at a lower rate, behind an anti-aliasing filter."""

from collections import deque
from collections.abc import Iterator
from dataclasses import replace

from midair.devices.sensors.decimator import CENTRE, Decimator, Polyphase
from midair.devices.sensors.sources import Chunk, Source, Stream
from midair.errors import DeviceStateError


class Decimated:
    """A source at a higher rate behind an anti-aliasing filter of linear phase (`Polyphase`); `rate` of the output in
    Hz.

    Both times of a chunk are corrected for the filter's delay; a frame arrives `delay` later than without the filter:
    64 ms at 1 kHz. Frame 0 is the first one with a full filter. The filter is refilled after a gap, so that a gap
    becomes at least 128 frames and every frame consists of measured data only. A source that already has the rate is
    passed on.
    """

    def __init__(self, source: Source, rate: float) -> None:
        self._source, self._rate = source, rate
        self._filter: Polyphase | None = None
        self._stream: Stream | None = None
        self._decimator: Decimator | None = None
        self._expected, self._begin, self._given = 0, 0, 0
        self._waiting: deque[Chunk] = deque()

    def open(self) -> Stream:
        """Open the source and design the filter."""
        self._stream = self._source.open()
        if self._stream.rate != self._rate:
            self._filter = Polyphase.between(self._stream.rate, self._rate)
        return replace(self._stream, rate=self._rate)

    def start(self) -> None:
        """Start with an empty filter."""
        self._decimator = None
        self._waiting.clear()
        self._source.start()

    def pull(self, wait: float) -> Chunk | None:
        """Return the next filtered chunk."""
        if not self._waiting:
            chunk = self._source.pull(wait)
            if chunk is not None:
                self._waiting.extend(self._filtered(chunk))
        return self._waiting.popleft() if self._waiting else None

    def stop(self) -> None:
        """Stop the source."""
        self._source.stop()

    def close(self) -> None:
        """Close the source."""
        self._source.close()

    def describe(self) -> dict[str, str]:
        """Description of the source and the filter."""
        said = self._source.describe()
        if self._stream is not None and self._filter is not None:
            said |= {"native rate": f"{self._stream.rate:g} Hz", "filter delay": f"{1e3 * self._filter.delay:g} ms"}
        return said

    def _filtered(self, chunk: Chunk) -> Iterator[Chunk]:
        if self._stream is None:
            raise DeviceStateError("decimated source: expected open first")
        if self._filter is None:
            yield chunk
            return
        rate = self._stream.rate
        for part in chunk.finite_parts(rate):
            decimator = self._continued(part, self._filter)
            # After a gap the filter waits for the start of a run, so that output frames keep their time grid.
            out = decimator.push(part.samples[max(0, self._begin - part.first) :])
            if len(out):
                # Frames of the source from the part's first frame to the centre of the filter.
                later = (self._given + CENTRE) * self._filter.length / self._filter.count - part.first
                yield Chunk(
                    samples=out,
                    first=self._given,
                    device_time=part.device_time + later / rate,
                    host_time=part.host_time + later / rate,
                )
                self._given += len(out)

    def _continued(self, part: Chunk, polyphase: Polyphase) -> Decimator:
        """The current filter, or after a gap an empty one that begins with the next whole run."""
        if self._decimator is None or part.first != self._expected:
            self._decimator = Decimator(polyphase, part.samples.shape[1])
            runs = -(-part.first // polyphase.length)
            self._begin, self._given = runs * polyphase.length, runs * polyphase.count
        self._expected = part.first + len(part)
        return self._decimator
