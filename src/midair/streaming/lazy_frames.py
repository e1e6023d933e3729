"""Arrays whose frames are read or computed on access, so that only one block at a time is in memory.

A `LazyFrames` can replace an array in a data class: `Recording.samples`, `PressureFrames.pressure`, `Drive.phase` and
others. Iterating over its `blocks` needs the memory of one block; NumPy functions convert it to a whole array.
"""

from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from threading import Lock
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError
from midair.progress import report_progress

Stored = Literal["f4", "f8"]
"""Precision of the stored numbers: values read from float32 fit into float32."""

BYTES = 2**21
"""Approximate size of a block: large enough that the overhead per block is negligible."""


class LazyFrames:
    """A read-only array of `shape` (frame, ...) that keeps no frames in memory.

    `read` takes (first, last) and returns these frames as float64; `stored` is "f4" if float32 holds every number
    exactly.
    """

    def __init__(self, read: Callable[[int, int], Array], shape: tuple[int, ...], *, stored: Stored = "f8") -> None:
        self._read, self.shape = read, tuple(int(length) for length in shape)
        self.stored: Stored = stored

    def __repr__(self) -> str:
        return f"<LazyFrames {' x '.join(map(str, self.shape))}>"

    def __len__(self) -> int:
        return self.shape[0]

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Total number of elements."""
        return int(np.prod(self.shape, dtype=np.int64))

    @property
    def dtype(self) -> np.dtype[np.float64]:
        """Type of the frames that `read` returns."""
        return np.dtype(np.float64)

    @property
    def nbytes(self) -> int:
        """Size of the whole array in memory."""
        return 8 * self.size

    def read(self, first: int, last: int) -> Array:
        """Frames from `first` up to `last`, shape (last - first, ...)."""
        return self._read(first, last)

    def __getitem__(self, key: Any) -> Any:
        """A slice without step gives lazy frames; frame indices give an array; any other key reads the whole array."""
        if isinstance(key, slice) and key.step in (None, 1):
            first, last, _ = key.indices(len(self))
            if (first, last) == (0, len(self)):
                return self
            return LazyFrames(
                lambda a, b: self._read(first + a, first + b),
                (max(0, last - first), *self.shape[1:]),
                stored=self.stored,
            )
        if isinstance(key, int | np.integer):
            frame = range(len(self))[int(key)]
            return self._read(frame, frame + 1)[0]
        if isinstance(key, np.ndarray) and key.ndim == 1:
            frames = np.arange(len(self))[key]
            some, most = np.empty((len(frames), *self.shape[1:])), next(block_ranges(self.shape), (0, 1))[1]
            ends = [*(np.flatnonzero(np.diff(frames) != 1) + 1).tolist(), len(frames)]
            for begin, end in zip([0, *ends], ends, strict=False):
                for at in range(begin, end, most):
                    # Copied into place: a view would keep its whole segment in memory.
                    count = min(most, end - at)
                    some[at : at + count] = self._read(int(frames[at]), int(frames[at]) + count)
            return some
        return np.asarray(self)[key]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Read the whole array into memory."""
        whole = np.empty(self.shape)
        first = 0
        for block in self.blocks():
            whole[first : first + len(block)] = block
            first += len(block)
        return whole if dtype is None else whole.astype(dtype)

    def blocks(self, size: int | None = None) -> Iterator[Array]:
        """Iterate over the frames, `size` at a time; about 2 MB if None."""
        parts = (self._read(first, last) for first, last in block_ranges(self.shape, size))
        yield from report_progress(parts, len(self), weight=len)

    def mapped(self, function: Callable[[Array], Any], *, stored: Stored = "f8") -> "LazyFrames":
        """Lazy frames of `function`, which takes (frame, ...) and returns as many frames."""
        some = function(self._read(0, 1))
        return LazyFrames(lambda a, b: function(self._read(a, b)), (len(self), *some.shape[1:]), stored=stored)

    def followed(self, frames: int) -> "LazyFrames":
        """Lazy frames padded at the end with zeros to at least `frames` frames."""

        def read(first: int, last: int) -> Array:
            there = self._read(min(first, len(self)), min(last, len(self)))
            return np.concatenate([there, np.zeros((last - first - len(there), *self.shape[1:]))])

        return LazyFrames(read, (max(frames, len(self)), *self.shape[1:]), stored=self.stored)

    def min(self, axis: Literal[0] | None = None) -> Any:
        """Minimum of all numbers, or along the frames (axis 0)."""
        return self.moments.least if axis == 0 else float(self.moments.least.min())

    def max(self, axis: Literal[0] | None = None) -> Any:
        """Maximum of all numbers, or along the frames (axis 0)."""
        return self.moments.greatest if axis == 0 else float(self.moments.greatest.max())

    @cached_property
    def moments(self) -> "Moments":
        """Statistics of each channel from one pass along the frames, cached."""
        return Moments.of(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Moments:
    """Statistics of each channel from one pass along the frames; each array has shape (...)."""

    least: Array
    greatest: Array
    mean: Array
    spread: Array
    """Standard deviation."""
    step: Array
    """Rms difference between successive frames; 0 for a single frame."""
    first: Array
    """First frame."""
    last: Array
    """Last frame."""

    @property
    def largest(self) -> float:
        """Largest magnitude of all channels."""
        return float(np.maximum(self.greatest, -self.least).max())

    @classmethod
    def of(cls, x: "Array | LazyFrames") -> "Moments":
        """Compute the statistics of an array or lazy frames, at least one frame, block by block."""
        parts = blocks(x)
        block = next(parts)
        first, last, count = block[0], block[-1], len(block)
        least, greatest = block.min(axis=0), block.max(axis=0)
        # Scaled by a power of two, because squares of very large or small numbers overflow or underflow.
        unit = 2.0 ** min(int(np.frexp(np.maximum(greatest, -least).max())[1]), 1023)
        mean, apart, steps = (
            (block / unit).mean(axis=0),
            _squared_deviations(block / unit),
            _squared_steps(block / unit),
        )
        for block in parts:
            least, greatest = np.minimum(least, block.min(axis=0)), np.maximum(greatest, block.max(axis=0))
            part, total = block / unit, count + len(block)
            steps = steps + np.square(part[0] - last / unit) + _squared_steps(part)
            # Update of mean and sum of squares: Chan, Golub & LeVeque, Am. Stat. 37 (1983).
            change = part.mean(axis=0) - mean
            apart = apart + _squared_deviations(part) + change**2 * (count * len(block) / total)
            mean, count, last = mean + change * (len(block) / total), total, block[-1]
        return cls(
            least=least,
            greatest=greatest,
            mean=mean * unit,
            spread=np.sqrt(apart / count) * unit,
            step=np.sqrt(steps / max(count - 1, 1)) * unit,
            first=first,
            last=last,
        )


def moments(x: "Array | LazyFrames") -> Moments:
    """Statistics from one pass through an array or lazy frames; lazy frames cache them."""
    return x.moments if isinstance(x, LazyFrames) else Moments.of(x)


def _squared_deviations(block: Array) -> Array:
    return np.asarray(block.var(axis=0) * len(block), np.float64)


def _squared_steps(block: Array) -> Array:
    """Sum of squared differences between successive frames."""
    return np.asarray(np.square(np.diff(block, axis=0)).sum(axis=0), np.float64)


def block_ranges(shape: tuple[int, ...], size: int | None = None) -> Iterator[tuple[int, int]]:
    """Yield (first, last) for each block of `size` frames of an array of this shape; about 2 MB each if None."""
    row = 8 * int(np.prod(shape[1:], dtype=np.int64))
    step = size or max(1, BYTES // max(row, 1))
    yield from ((first, min(first + step, shape[0])) for first in range(0, shape[0], step))


def blocks(x: "NDArray[Any] | LazyFrames", size: int | None = None) -> Iterator[NDArray[Any]]:
    """Iterate over the frames of an array or lazy frames, `size` at a time; about 2 MB if None."""
    if isinstance(x, LazyFrames):
        return x.blocks(size)
    return report_progress((x[first:last] for first, last in block_ranges(x.shape, size)), len(x), weight=len)


def read_frames(x: "NDArray[Any] | LazyFrames", first: int, last: int) -> NDArray[Any]:
    """Frames of an array or lazy frames from `first` up to `last`, in memory."""
    return x.read(first, last) if isinstance(x, LazyFrames) else x[first:last]


def as_lazy(x: "NDArray[Any] | LazyFrames") -> Any:
    """An array as lazy frames, so that functions of it are computed when read; lazy frames unchanged."""
    return x if isinstance(x, LazyFrames) else LazyFrames(lambda first, last: x[first:last], x.shape)


def each_frame(x: Any, function: Callable[[Array], Any], *, exact: bool = False) -> Any:
    """Apply a function of single frames: to an array at once, to lazy frames when they are read.

    Set `exact` if its results still fit into float32 where the input does.
    """
    return x.mapped(function, stored=x.stored if exact else "f8") if isinstance(x, LazyFrames) else function(x)


def concatenate_lazy(parts: "Sequence[NDArray[Any] | LazyFrames]") -> Any:
    """Concatenate along the frames: an array if all parts are arrays, otherwise lazy frames."""
    if not any(isinstance(part, LazyFrames) for part in parts):
        return np.concatenate(parts)
    ends = np.cumsum([len(part) for part in parts])

    def read(first: int, last: int) -> Array:
        inside = [
            read_frames(part, max(0, first - begin), min(len(part), last - begin))
            for part, begin in zip(parts, [0, *ends[:-1].tolist()], strict=True)
            if first < begin + len(part) and begin < last
        ]
        return np.concatenate([*inside, np.zeros((0, *parts[0].shape[1:]))])

    single = all(isinstance(part, LazyFrames) and part.stored == "f4" for part in parts)
    return LazyFrames(read, (int(ends[-1]), *parts[0].shape[1:]), stored="f4" if single else "f8")


def from_iterator(parts: Iterable[NDArray[Any]], shape: tuple[int, ...], *, stored: Stored = "f8") -> LazyFrames:
    """Lazy frames of an iterator of blocks; they must be read once and in order. `shape` is the total shape."""
    coming, given = iter(parts), 0
    waiting: list[NDArray[Any]] = []

    def read(first: int, last: int) -> Array:
        nonlocal given
        if first != given:
            raise InputError(f"lazy frames: expected frame {given} to be read next, got frame {first}")
        while sum(map(len, waiting)) < last - first:
            waiting.append(next(coming))
        whole = np.concatenate(waiting)
        waiting[:], given = [whole[last - first :]], last
        return whole[: last - first]

    return LazyFrames(read, shape, stored=stored)


def cached_blocks(
    make: Callable[[int, int], Array], shape: tuple[int, ...], *, size: int, kept: int = 3, stored: Stored = "f8"
) -> LazyFrames:
    """Lazy frames from `make(first, last)` in fixed segments of `size` frames, of which `kept` stay in memory."""
    held: OrderedDict[int, Array] = OrderedDict()
    lock = Lock()

    def segment(number: int) -> Array:
        with lock:
            if number not in held:
                held[number] = make(number * size, min((number + 1) * size, shape[0]))
                while len(held) > kept:
                    held.popitem(last=False)
            held.move_to_end(number)
            return held[number]

    def read(first: int, last: int) -> Array:
        if last <= first:
            return np.zeros((0, *shape[1:]))
        numbers = range(first // size, (last - 1) // size + 1)
        parts = [segment(n)[max(0, first - n * size) : last - n * size] for n in numbers]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    return LazyFrames(read, shape, stored=stored)


def with_cache(x: "NDArray[Any] | LazyFrames") -> Any:
    """Lazy frames whose last two blocks stay in memory, for short reads one after another; arrays unchanged."""
    if not isinstance(x, LazyFrames):
        return x
    return cached_blocks(x.read, x.shape, size=next(last for _, last in block_ranges(x.shape)), kept=2, stored=x.stored)


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
