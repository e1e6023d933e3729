"""Frame numbers of a stream with gaps, from a counter channel or from time stamps."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.devices.sensors.sources import Samples
from midair.errors import RateError
from midair.recordings import typical_period

Numbers = NDArray[np.int64]


JUMP = 0.2
"""Smallest step of time stamps, in s, that counts as a jump of the sender's clock rather than as a delay."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """Consecutive frames: number of the first one, including lost frames, and its sender time in s."""

    first: int
    samples: Samples
    stamp: float
    jump: float = 0.0
    """Step of the sender's clock before the first frame, in s, that `SteadyStamps` has removed."""


def runs(number: Numbers, samples: Samples, stamps: Array) -> Iterator[Run]:
    """Split numbered frames into runs without a gap."""
    starts = [0, *(np.flatnonzero(np.diff(number) > 1) + 1), len(number)]
    for begin, end in pairwise(starts):
        if end > begin:
            yield Run(first=int(number[begin]), samples=samples[begin:end], stamp=float(stamps[begin]))


class CountedFrames:
    """Frame numbers from a counter that may start anywhere: an integer of b bits wraps at 2^b.

    A float32 is exact below 2^24, a double below 2^53; it may wrap to 0 there.
    """

    def __init__(self, dtype: "np.dtype[np.generic]") -> None:
        self._whole = np.issubdtype(dtype, np.integer)
        self._full = 2.0 ** (8 * dtype.itemsize if self._whole else np.finfo(dtype.name).nmant + 1)
        self._last: float | None = None
        self.frames = 0
        """Number of frames so far, including lost ones."""

    def number(self, counter: Array) -> Numbers | None:
        """Numbers of the next frames; None once a float counter is no longer exact, ValueError if it decreases."""
        if not self._whole and counter.max() >= self._full:
            return None
        steps = np.diff(counter, prepend=counter[0] - 1 if self._last is None else self._last) % self._full
        # A counter of a byte or two wraps so often that a gap may be longer than half of its range.
        if not steps.all() or (self._full > 2**16 and steps.max() > self._full / 2):
            raise ValueError("went back")
        self._last = float(counter[-1])
        numbers = self.frames - 1 + np.cumsum(steps).astype(np.int64)
        self.frames = int(numbers[-1]) + 1
        return numbers


class SteadyStamps:
    """Removes jumps of the sender's clock from the stamps of numbered runs, and counts them; `rate` in Hz."""

    def __init__(self, rate: float) -> None:
        self.jumps, self.last = 0, 0.0
        self._rate, self._shift = rate, 0.0
        self._origin: float | None = None

    def steady(self, run: Run) -> Run:
        """Return the run with its stamp on the sender's first clock."""
        origin = run.stamp - self._shift - run.first / self._rate
        step = 0.0 if self._origin is None else origin - self._origin
        if abs(step) < JUMP:
            self._origin, step = origin, 0.0
        else:
            self._shift += step
            self.jumps, self.last = self.jumps + 1, step
        return replace(run, stamp=run.stamp - self._shift, jump=step)


class StatedRate:
    """Refuses a sender whose stamps contradict its `rate` (Hz).

    Stamps too far apart are seen after 0.2 s of frames. Too close ones are after 2 s, because a burst looks like them.
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._stamps: Array | None = np.zeros(0)
        self._enough = 0.2  # s

    def check(self, stamps: Array) -> None:
        """Add stamps (s) of further frames; RateError if their typical distance contradicts the rate."""
        if self._stamps is None:
            return
        self._stamps = np.concatenate([self._stamps, stamps])
        if len(self._stamps) < self._enough * self._rate or np.count_nonzero(np.diff(self._stamps)) < 8:
            return
        measured, settled = 1 / typical_period(self._stamps), self._enough == 2
        if measured < 0.75 * self._rate or (settled and measured > 1.5 * self._rate):
            raise RateError(
                f"lsl: expected stamps {1e3 / self._rate:.4g} ms apart at the stated {self._rate:g} Hz, "
                f"got {1e3 / measured:.4g} ms; correct the rate of the sender"
            )
        self._stamps, self._enough = (None if settled else self._stamps), 2.0


class StampedFrames:
    """Frame numbers from time stamps without a counter: a lasting increase of the delay means lost frames.

    A stamp may be late but never early. The earliest stamps of the last second define the time grid; their spread over
    blocks of 1/20 s, times three and at least 1.5 frames, is the threshold for a gap. A gap is confirmed `confirm`
    seconds later; until then frames are held back. Stamps that become early for good, or late although their frames
    arrive as fast as before, show a jump of the sender's clock: no frames are missing then.
    """

    def __init__(self, rate: float, *, first: int = 0, confirm: float = 0.3) -> None:
        self._rate, self.frames = rate, first
        """`frames`: number of frames so far, including lost ones, without those that are held back."""
        self._confirm = max(8, round(confirm * rate))
        self._part, self._parts = max(1, round(0.05 * rate)), 20
        self._earliest: list[float] = []  # per block of 1/20 s, newest last
        self._soonest: list[float] = []  # shortest time from stamp to arrival, likewise
        self._count = 0
        self._samples: list[Samples] = []
        self._stamps = self._delays = np.zeros(0)

    def add(self, samples: Samples, stamps: Array, *, arrived: float = np.nan) -> Iterator[Run]:
        """Add frames and yield those whose numbers are certain; `arrived` is a time on the clock of the stamps."""
        self._samples.append(samples)
        self._stamps = np.concatenate([self._stamps, stamps])
        self._delays = np.concatenate([self._delays, arrived - stamps])
        yield from self._certain(ends=False)

    def rest(self) -> Iterator[Run]:
        """Yield the frames that are held back, with their most likely numbers."""
        yield from self._certain(ends=True)

    def _certain(self, *, ends: bool) -> Iterator[Run]:
        while len(self._stamps):
            off = self._off(self._late())
            begin = int(off.argmax()) if off.any() else len(off)
            if begin:
                yield self._release_run(begin)
                continue
            seen = off[: self._confirm]
            if not seen.all():
                yield self._release_run(int(seen.argmin()))
            elif len(seen) == self._confirm:
                half = slice(self._confirm // 2, self._confirm)
                behind = float(self._late()[half].min())
                # A jump, since after lost frames none arrives faster than before.
                delay = float(self._delays[half].min())
                if behind < 0 or (behind > JUMP and min(self._soonest) - delay > behind / 2):
                    self._earliest = [each + behind for each in self._earliest]
                    self._soonest = [each - behind for each in self._soonest]
                    continue
                # A packet with the last frames before the gap is late as well, but less.
                before = int((self._late() >= behind - self._limit()).argmax())
                if before:
                    yield self._release_run(before)
                self.frames += round(behind * self._rate)
            elif ends:
                yield self._release_run(len(seen))
            else:
                return

    def _late(self) -> Array:
        """Delay of the held stamps relative to the time grid, in s."""
        belongs = min(self._earliest) if self._earliest else float(self._stamps[0] - self.frames / self._rate)
        return self._stamps - (self.frames + np.arange(len(self._stamps))) / self._rate - belongs

    def _off(self, late: Array) -> NDArray[np.bool_]:
        """Frames off the time grid: late, or, once it has settled, early."""
        early = len(self._earliest) == self._parts
        return (late > self._limit()) | (early & (late < -self._limit()))

    def _limit(self) -> float:
        least = 1.5 / self._rate
        if len(self._earliest) < self._parts:
            return max(least, 0.02)
        return max(least, 3 * (max(self._earliest) - min(self._earliest)))

    def _release_run(self, count: int) -> Run:
        samples = np.concatenate(self._samples)
        run = Run(first=self.frames, samples=samples[:count], stamp=float(self._stamps[0]))
        late = self._late()[:count]
        places = self._stamps[:count] - (self.frames + np.arange(count)) / self._rate
        # Single stamps that are wrong move neither the grid nor the shortest delay.
        early, off = self._off(np.minimum(late, 0)), self._off(late)
        self._update_grid(np.where(early, places - late, places), np.where(off, np.inf, self._delays[:count]))
        self._samples, self._stamps, self._delays = [samples[count:]], self._stamps[count:], self._delays[count:]
        self.frames += count
        return run

    def _update_grid(self, places: Array, delays: Array) -> None:
        """Store the earliest place and the shortest delay of each block of 1/20 s, over one second."""
        while len(places):
            size = self._part - self._count
            for kept, new in ((self._earliest, places[:size]), (self._soonest, delays[:size])):
                if self._count == 0:
                    kept.append(float(new.min()))
                    del kept[: -self._parts]
                else:
                    kept[-1] = min(kept[-1], float(new.min()))
            self._count = (self._count + len(places[:size])) % self._part
            places, delays = places[size:], delays[size:]
