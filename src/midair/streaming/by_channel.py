"""Single channels of frames that do not fit into memory: their values in turn, and their exact medians."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.streaming.lazy_frames import LazyFrames, blocks, moments

_BINS = 2**14
_FEW = 2**16
"""Maximum number of values of one channel that are kept and sorted."""


def channels(x: "NDArray[Any] | LazyFrames") -> Iterator[Array]:
    """Yield each channel, shape (frame,), in the order of the other axes; lazy frames are read once per channel."""
    for number in range(int(np.prod(x.shape[1:], dtype=np.int64))):
        whole, first = np.empty(len(x)), 0
        for block in blocks(x):
            whole[first : first + len(block)] = block.reshape(len(block), -1)[:, number]
            first += len(block)
        yield whole


def medians(x: "NDArray[Any] | LazyFrames") -> Array:
    """Median of each channel along the frames, shape (...), bit-identical to `numpy.median`.

    Lazy frames are read three or four times: for the range, for counts in bins, and for the values in the median's bin.
    """
    if not isinstance(x, LazyFrames):
        return np.asarray(np.median(x, axis=0), np.float64)
    found = moments(x)
    ends = zip(found.least.ravel(), found.greatest.ravel(), strict=True)
    middles = [_MedianSearch(len(x), float(low), float(high)) for low, high in ends]
    while waiting := [(channel, each) for channel, each in enumerate(middles) if each.value is None]:
        for block in x.blocks():
            values = block.reshape(len(block), -1)
            for channel, each in waiting:
                each.look(values[:, channel])
        for _, each in waiting:
            each.conclude()
    return np.array([each.value for each in middles], np.float64).reshape(x.shape[1:])


class _MedianSearch:
    """Median of values that are read several times: it lies between `low` and `high`; `below` values are smaller."""

    def __init__(self, count: int, low: float, high: float) -> None:
        self.ranks = ((count - 1) // 2, count // 2)
        self.value: float | None = None
        self._narrow(low, high, 0)

    def look(self, values: Array) -> None:
        """Process a block: count it in the first pass; in the second, collect the values in the two median bins."""
        # Contiguous copy: the values of one channel are strided in memory.
        inside = np.ascontiguousarray(values)
        inside = inside[(inside >= self.low) & (inside <= self.high)]
        # Halves, because high - low may overflow; the mapping stays monotonic.
        share = (inside / 2 - self.low / 2) / (self.high / 2 - self.low / 2)
        part = np.minimum((share * _BINS).astype(np.int64), _BINS - 1)
        if self._parts is None:
            self._counts += np.bincount(part, minlength=_BINS)
        elif self._few:
            self._held.append(inside[(part == self._parts[0]) | (part == self._parts[1])])
        else:
            for side, number in enumerate(self._parts):
                if len(there := inside[part == number]):
                    least, greatest = self._ends[side]
                    self._ends[side] = (min(least, float(there.min())), max(greatest, float(there.max())))

    def conclude(self) -> None:
        """Evaluate one pass."""
        if self._parts is None:
            reached = self.below + np.cumsum(self._counts)
            first, last = (int(np.searchsorted(reached, rank, side="right")) for rank in self.ranks)
            self._parts, self._before = (first, last), int(reached[first] - self._counts[first])
            self._few = self._counts[first] + self._counts[last] <= _FEW
        elif self._few:
            held = np.sort(np.concatenate(self._held))
            self.value = float(np.mean([held[rank - self._before] for rank in self.ranks]))
        elif self._parts[0] != self._parts[1]:
            self.value = float(np.mean([self._ends[0][1], self._ends[1][0]]))
        else:
            self._narrow(*self._ends[0], self._before)

    def _narrow(self, low: float, high: float, below: int) -> None:
        self.low, self.high, self.below = low, high, below
        self._counts, self._before, self._few = np.zeros(_BINS, np.int64), 0, False
        self._parts: tuple[int, int] | None = None
        self._held: list[Array] = []
        self._ends = [(np.inf, -np.inf), (np.inf, -np.inf)]
        if low == high:
            self.value = low
