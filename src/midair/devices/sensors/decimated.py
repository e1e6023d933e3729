"""A source at a lower rate, behind a streaming anti-aliasing filter: linear phase, bounded memory, no aliases."""

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.array_types import Array
from midair.devices.sensors.sources import Chunk, Source, Stream
from midair.errors import DeviceStateError, RateError
from midair.validation import positive

CENTRE = 64
"""Output frames from the filter's first coefficient to its centre."""

RATIO_MAX = 1000
"""Largest denominator of the ratio of the rates that counts as exact."""


class Decimator:
    """A linear-phase low-pass filter from `rate` down to `new_rate`, both in Hz, block by block.

    Windowed sinc with a Kaiser window, beta = 8 (Oppenheim and Schafer, Discrete-Time Signal Processing, 7.6), as in
    `midair.dsp.resample`: flat to 0.1 % up to 94 % of half the new rate (470 of 500 Hz), 0.5 at half the new rate,
    -80 dB from 106 % of it on. `length` input frames become `count` output frames; `delay` is the time from an output
    frame to the last input frame that it needs, 64 frames of the new rate, in s. Raises RateError unless the ratio of
    the rates is a simple fraction below 1.
    """

    def __init__(self, rate: float, new_rate: float) -> None:
        ratio = Fraction(positive(new_rate, "rate", "Hz") / positive(rate, "rate", "Hz")).limit_denominator(RATIO_MAX)
        self.count, self.length, self.delay = ratio.numerator, ratio.denominator, CENTRE / new_rate
        if ratio >= 1 or ratio == 0 or abs(self.count * rate - self.length * new_rate) > 1e-6 * new_rate * self.length:
            raise RateError(
                f"rate: expected one below {rate:g} Hz whose ratio to it is a fraction up to {RATIO_MAX}, "
                f"got {new_rate:g} Hz; leave the rate out to use the source's own"
            )
        half = CENTRE * self.length
        # Times `count`: at the interpolated rate only one frame in `count` is not zero.
        fir = self.count * np.asarray(
            scipy.signal.firwin(2 * half + 1, 1 / self.length, window=("kaiser", 8.0)), np.float64
        )
        # In steps of the interpolated rate, input i lies at count * i and output j at (CENTRE + j) * length.
        span = (2 * half + (self.count - 1) * self.length) // self.count + 1
        place = self.count * np.arange(span) - self.length * np.arange(self.count)[:, None]
        self._weights = np.where((place >= 0) & (place <= 2 * half), fir[np.clip(place, 0, 2 * half)], 0.0)
        self.restart()

    def restart(self) -> None:
        """Empty the filter."""
        self._held: Array | None = None

    def push(self, samples: NDArray[np.floating]) -> Array:
        """Add input frames, shape (frame, channel), and return the output frames that are now complete, perhaps none.

        Output frame k lies at input frame (64 + k) * rate / new_rate; earlier ones would need frames before the first
        input.
        """
        held = samples if self._held is None else np.concatenate([self._held, samples])
        span = self._weights.shape[1]
        runs = max(0, (len(held) - span) // self.length + 1)
        # A view would keep all previous input in memory.
        self._held = np.array(held[runs * self.length :], np.float64)
        if not runs:
            return np.zeros((0, held.shape[1]))
        windows = np.lib.stride_tricks.sliding_window_view(held, span, axis=0)[: runs * self.length : self.length]
        return np.matmul(windows, self._weights.T).transpose(0, 2, 1).reshape(-1, held.shape[1])


class Decimated:
    """A source at a higher rate behind a `Decimator`; `rate` of the output in Hz.

    Both times of a chunk are corrected for the filter's delay; a frame arrives `delay` later than without the filter:
    64 ms at 1 kHz. Frame 0 is the first one with a full filter. The filter is refilled after a gap, so that a gap
    becomes at least 128 frames and every frame consists of measured data only. A source that already has the rate is
    passed on.
    """

    def __init__(self, source: Source, rate: float) -> None:
        self._source, self._rate = source, rate
        self._stream: Stream | None = None
        self._decimator: Decimator | None = None
        self._expected, self._begin, self._given = -1, 0, 0
        self._waiting: deque[Chunk] = deque()

    def open(self) -> Stream:
        """Open the source and design the filter."""
        self._stream = self._source.open()
        if self._stream.rate != self._rate:
            self._decimator = Decimator(self._stream.rate, self._rate)
        return replace(self._stream, rate=self._rate)

    def start(self) -> None:
        """Start with an empty filter."""
        self._expected = -1
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
        info = self._source.describe()
        if self._stream is not None and self._decimator is not None:
            info |= {"native rate": f"{self._stream.rate:g} Hz", "filter delay": f"{1e3 * self._decimator.delay:g} ms"}
        return info

    def _filtered(self, chunk: Chunk) -> Iterator[Chunk]:
        if self._stream is None:
            raise DeviceStateError("decimated source: expected open first")
        if (decimator := self._decimator) is None:
            yield chunk
            return
        rate = self._stream.rate
        for part in chunk.finite_parts(rate):
            # After a gap an empty filter begins with the next whole run.
            if part.first != self._expected:
                decimator.restart()
                runs = -(-part.first // decimator.length)
                self._begin, self._given = runs * decimator.length, runs * decimator.count
            self._expected = part.first + len(part)
            # After a gap the filter waits for the start of a run, so that output frames keep their time grid.
            out = decimator.push(part.samples[max(0, self._begin - part.first) :])
            if len(out):
                # Frames of the source from the part's first frame to the centre of the filter.
                later = (self._given + CENTRE) * decimator.length / decimator.count - part.first
                yield Chunk(
                    samples=out,
                    first=self._given,
                    device_time=part.device_time + later / rate,
                    host_time=part.host_time + later / rate,
                    uncertain=part.uncertain,
                )
                self._given += len(out)
