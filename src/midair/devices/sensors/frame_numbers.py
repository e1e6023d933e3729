"""Which frame is which, of a stream whose sender may leave some out: by a channel that counts, or by stamps. Pure."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from midair.devices.sensors.sources import Samples

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """Consecutive frames.

    Attributes
    ----------
    first : int
        Number of the first, from 0; those that never came count.
    samples : ndarray, shape (frame, channel)
        As they came.
    stamp : float
        Time of the first, by the sender's clock, in s.
    """

    first: int
    samples: Samples
    stamp: float


def runs(number: Numbers, samples: Samples, stamps: Array) -> Iterator[Run]:
    """Frames with their numbers as runs in which none is missing."""
    starts = [0, *(np.flatnonzero(np.diff(number) > 1) + 1), len(number)]
    for begin, end in pairwise(starts):
        if end > begin:
            yield Run(first=int(number[begin]), samples=samples[begin:end], stamp=float(stamps[begin]))


class CountedFrames:
    """Numbers by a counter of any number type, which may begin anywhere and begin again at 0 when it is full.

    Parameters
    ----------
    dtype : dtype
        Of the counter. A whole number of b bits is full at 2^b, a float32 at 2^24, from which it cannot count on. A
        float that goes on above rounds: it is read to within its precision, so that a shorter gap is not seen.
    """

    def __init__(self, dtype: "np.dtype[np.generic]") -> None:
        self._whole = np.issubdtype(dtype, np.integer)
        self._dtype = dtype
        self._full = 2.0 ** (8 * dtype.itemsize if self._whole else np.finfo(dtype.name).nmant + 1)
        self._offset: int | None = None
        self._next = 0

    @property
    def frames(self) -> int:
        """How many there were so far, with those that never came."""
        return self._next

    def number(self, counter: Array) -> Numbers | None:
        """Numbers of the next frames; None when the counter stands still, full: it says nothing from now on.

        Raises
        ------
        ValueError
            If it goes back.
        """
        if self._offset is None:
            self._offset = round(float(counter[0]))
        expected = np.arange(self._next, self._next + len(counter), dtype=np.int64)
        at = 0
        while True:
            ahead = self._ahead(counter[at:], expected[at:])
            off = np.flatnonzero(ahead)
            if not len(off):
                break
            at += int(off[0])
            if ahead[off[0]] < 0:
                if self._stands(counter[at:]):
                    return None
                raise ValueError("went back")
            expected[at:] += int(ahead[off[0]])
        self._next = int(expected[-1]) + 1
        return expected

    def _ahead(self, counter: Array, expected: Numbers) -> Array:
        """By how many frames the counter is ahead of what is expected; 0 where it may be what is expected."""
        ahead = counter - (expected + (self._offset or 0))
        turns = np.floor(ahead / self._full) if self._whole and self._full <= 2**16 else np.rint(ahead / self._full)
        ahead = np.rint(ahead - turns * self._full)
        if self._whole:
            return ahead
        precision = np.spacing(counter.astype(self._dtype)).astype(np.float64)
        return np.where(np.abs(ahead) <= np.where(precision > 1, precision / 2, 0), 0, ahead)

    def _stands(self, counter: Array) -> bool:
        """Whether it is a float that cannot count on."""
        return not self._whole and bool((counter == self._full).all())


class StampedFrames:
    """Numbers by the stamps of a sender that does not count: where they rise for good, frames never came.

    A stamp may be late, never early, as a sender stamps what it has. So the earliest of the last second say where
    stamps belong, and how far those of a twentieth of a second stray from it says what is a gap: three times that, and
    one frame and a half. Whether it is for good is seen `confirm` seconds later; until then frames wait here.

    Parameters
    ----------
    rate : float
        Frames per second, in Hz.
    first : int
        Number of the first frame.
    confirm : float
        How long stamps must be late to be so for good, in s.
    """

    def __init__(self, rate: float, *, first: int = 0, confirm: float = 0.3) -> None:
        self._rate, self._next = rate, first
        self._confirm = max(8, round(confirm * rate))
        self._part, self._parts = max(1, round(0.05 * rate)), 20
        self._earliest: list[float] = []  # of each twentieth of a second, newest last
        self._count = 0
        self._samples: list[Samples] = []
        self._stamps = np.zeros(0)

    @property
    def frames(self) -> int:
        """How many there were so far, with those that never came, without those that wait."""
        return self._next

    def add(self, samples: Samples, stamps: Array) -> Iterator[Run]:
        """Frames that came; those whose numbers are certain come out."""
        self._samples.append(samples)
        self._stamps = np.concatenate([self._stamps, stamps])
        yield from self._certain(ends=False)

    def rest(self) -> Iterator[Run]:
        """What waits, by what is known."""
        yield from self._certain(ends=True)

    def _certain(self, *, ends: bool) -> Iterator[Run]:
        while len(self._stamps):
            late = self._late() > self._limit()
            begin = int(late.argmax()) if late.any() else len(late)
            if begin:
                yield self._give(begin)
                continue
            seen = late[: self._confirm]
            if not seen.all():
                yield self._give(int(seen.argmin()))
            elif len(seen) == self._confirm:
                # A push that has the last frames before the gap is late, too, but less.
                behind = float(self._late()[self._confirm // 2 : self._confirm].min())
                before = int((self._late() >= behind - self._limit()).argmax())
                if before:
                    yield self._give(before)
                self._next += round(behind * self._rate)
            elif ends:
                yield self._give(len(seen))
            else:
                return

    def _late(self) -> Array:
        """How much later than where they belong the waiting stamps are, in s."""
        belongs = min(self._earliest) if self._earliest else float(self._stamps[0] - self._next / self._rate)
        return self._stamps - (self._next + np.arange(len(self._stamps))) / self._rate - belongs

    def _limit(self) -> float:
        least = 1.5 / self._rate
        if len(self._earliest) < self._parts:
            return max(least, 0.02)
        return max(least, 3 * (max(self._earliest) - min(self._earliest)))

    def _give(self, count: int) -> Run:
        samples = np.concatenate(self._samples)
        run = Run(first=self._next, samples=samples[:count], stamp=float(self._stamps[0]))
        self._learn(self._stamps[:count] - (self._next + np.arange(count)) / self._rate)
        self._samples, self._stamps = [samples[count:]], self._stamps[count:]
        self._next += count
        return run

    def _learn(self, places: Array) -> None:
        """Remember the earliest of each twentieth of a second, one second long."""
        while len(places):
            taken, places = places[: self._part - self._count], places[self._part - self._count :]
            if self._count == 0:
                self._earliest = [*self._earliest[1 - self._parts :], float(taken.min())]
            else:
                self._earliest[-1] = min(self._earliest[-1], float(taken.min()))
            self._count = (self._count + len(taken)) % self._part
