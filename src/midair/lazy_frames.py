"""Frames that are read or worked out when somebody asks for them: however many there are, a stretch is in memory.

A `LazyFrames` stands where a noun holds an array: `Recording.samples`, `PressureFrames.pressure`, `Drive.phase` and the
others. What goes through it in `blocks` needs the memory of a block; NumPy takes it for the whole array.
"""

from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from threading import Lock
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.progress import passing

Array = NDArray[np.float64]
Stored = Literal["f4", "f8"]
"""Of what precision the numbers are that a reel reads: what is read of float32 fits into float32."""

BYTES = 2**21
"""Of a block, about: large enough that what a block costs besides its numbers does not count."""


class LazyFrames:
    """An array along frames of which nothing is kept.

    Parameters
    ----------
    read : callable
        Takes (first, last), gives the frames from `first` up to `last`, shape (last - first, ...), as float64.
    shape : tuple of int
        Of the whole: (frame, ...).
    stored : {"f4", "f8"}
        Whether float32 holds every number of it.
    """

    def __init__(self, read: Callable[[int, int], Array], shape: tuple[int, ...], *, stored: Stored = "f8") -> None:
        self._read, self.shape = read, tuple(int(length) for length in shape)
        self.stored: Stored = stored

    def __repr__(self) -> str:
        return f"<Reel {' x '.join(map(str, self.shape))}>"

    def __len__(self) -> int:
        return self.shape[0]

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """How many numbers there are."""
        return int(np.prod(self.shape, dtype=np.int64))

    @property
    def dtype(self) -> np.dtype[np.float64]:
        """Of what is read: float64."""
        return np.dtype(np.float64)

    @property
    def nbytes(self) -> int:
        """Of the whole, were it in memory."""
        return 8 * self.size

    def read(self, first: int, last: int) -> Array:
        """Frames from `first` up to `last`, shape (last - first, ...)."""
        return self._read(first, last)

    def __getitem__(self, key: Any) -> Any:
        """Frames from here to there as a reel, one frame or some as an array, and anything else of the whole array."""
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
            return self._some(np.arange(len(self))[key])
        return np.asarray(self)[key]

    def _some(self, frames: NDArray[np.intp]) -> Array:
        """Chosen frames; those that follow each other are read together, since a file is opened for each reading."""
        some, most = np.empty((len(frames), *self.shape[1:])), next(block_ranges(self.shape), (0, 1))[1]
        ends = [*(np.flatnonzero(np.diff(frames) != 1) + 1).tolist(), len(frames)]
        for begin, end in zip([0, *ends], ends, strict=False):
            for at in range(begin, end, most):
                # Each into its place: a stretch may be a view of a long segment, which it would keep.
                count = min(most, end - at)
                some[at : at + count] = self._read(int(frames[at]), int(frames[at]) + count)
        return some

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """The whole, in memory."""
        whole = np.empty(self.shape)
        first = 0
        for block in self.blocks():
            whole[first : first + len(block)] = block
            first += len(block)
        return whole if dtype is None else whole.astype(dtype)

    def blocks(self, size: int | None = None) -> Iterator[Array]:
        """The frames in order, `size` at a time; about two megabytes if None."""
        parts = (self._read(first, last) for first, last in block_ranges(self.shape, size))
        yield from passing(parts, len(self), weight=len)

    def mapped(self, function: Callable[[Array], Any], *, stored: Stored = "f8") -> "LazyFrames":
        """What `function` makes of every frame; it takes (frame, ...) and gives as many frames."""
        some = function(self._read(0, 1))
        return LazyFrames(lambda a, b: function(self._read(a, b)), (len(self), *some.shape[1:]), stored=stored)

    def followed(self, frames: int) -> "LazyFrames":
        """The same, followed by zeros so that there are `frames` of it at least."""

        def read(first: int, last: int) -> Array:
            there = self._read(min(first, len(self)), min(last, len(self)))
            return np.concatenate([there, np.zeros((last - first - len(there), *self.shape[1:]))])

        return LazyFrames(read, (max(frames, len(self)), *self.shape[1:]), stored=self.stored)

    def min(self, axis: Literal[0] | None = None) -> Any:
        """Least number, of all or along the frames (axis 0)."""
        return self.moments.least if axis == 0 else float(self.moments.least.min())

    def max(self, axis: Literal[0] | None = None) -> Any:
        """Greatest number, of all or along the frames (axis 0)."""
        return self.moments.greatest if axis == 0 else float(self.moments.greatest.max())

    @cached_property
    def moments(self) -> "Moments":
        """What one pass through all of it tells."""
        return Moments.of(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Moments:
    """What one pass along the frames tells of each channel.

    Attributes
    ----------
    least, greatest, mean, spread : ndarray, shape (...)
        Of each channel over all frames; the spread is its standard deviation.
    step : ndarray, shape (...)
        Rms of the difference of one frame and the next; 0 where there is one frame.
    first, last : ndarray, shape (...)
        Frames.
    """

    least: Array
    greatest: Array
    mean: Array
    spread: Array
    step: Array
    first: Array
    last: Array

    @property
    def largest(self) -> float:
        """Largest magnitude of all."""
        return float(np.maximum(self.greatest, -self.least).max())

    @classmethod
    def of(cls, x: "Array | LazyFrames") -> "Moments":
        """Of an array or a reel of at least one frame, block by block."""
        parts = blocks(x)
        block = next(parts)
        first, last, count = block[0], block[-1], len(block)
        least, greatest = block.min(axis=0), block.max(axis=0)
        # A power of two near the first numbers: squares of very large or small ones would leave the range of numbers.
        unit = 2.0 ** min(int(np.frexp(np.maximum(greatest, -least).max())[1]), 1023)
        mean, apart, steps = (block / unit).mean(axis=0), _apart(block / unit), _steps(block / unit)
        for block in parts:
            least, greatest = np.minimum(least, block.min(axis=0)), np.maximum(greatest, block.max(axis=0))
            part, total = block / unit, count + len(block)
            steps = steps + np.square(part[0] - last / unit) + _steps(part)
            # Two parts' mean and sum of squares make those of both: Chan, Golub & LeVeque, Am. Stat. 37 (1983).
            change = part.mean(axis=0) - mean
            apart = apart + _apart(part) + change**2 * (count * len(block) / total)
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
    """What one pass through an array or a reel tells; a reel keeps it."""
    return x.moments if isinstance(x, LazyFrames) else Moments.of(x)


def _apart(block: Array) -> Array:
    """Sum of the squared distances from the mean."""
    return np.asarray(block.var(axis=0) * len(block), np.float64)


def _steps(block: Array) -> Array:
    """Sum of the squared differences of one frame and the next."""
    return np.asarray(np.square(np.diff(block, axis=0)).sum(axis=0), np.float64)


def block_ranges(shape: tuple[int, ...], size: int | None = None) -> Iterator[tuple[int, int]]:
    """(first, last) of each block of `size` frames of an array of this shape; of about two megabytes if None."""
    row = 8 * int(np.prod(shape[1:], dtype=np.int64))
    step = size or max(1, BYTES // max(row, 1))
    yield from ((first, min(first + step, shape[0])) for first in range(0, shape[0], step))


def blocks(x: "NDArray[Any] | LazyFrames", size: int | None = None) -> Iterator[NDArray[Any]]:
    """The frames of an array or a reel in order, `size` at a time; about two megabytes if None."""
    if isinstance(x, LazyFrames):
        return x.blocks(size)
    return passing((x[first:last] for first, last in block_ranges(x.shape, size)), len(x), weight=len)


def read_frames(x: "NDArray[Any] | LazyFrames", first: int, last: int) -> NDArray[Any]:
    """Frames of an array or a reel from `first` up to `last`, in memory."""
    return x.read(first, last) if isinstance(x, LazyFrames) else x[first:last]


def as_lazy(x: "NDArray[Any] | LazyFrames") -> Any:
    """An array as a reel, so that what is made of it is made when it is read; a reel as it is."""
    return x if isinstance(x, LazyFrames) else LazyFrames(lambda first, last: x[first:last], x.shape)


def each_frame(x: Any, function: Callable[[Array], Any], *, exact: bool = False) -> Any:
    """What `function` makes of all frames: of an array at once, of a reel when they are read.

    Parameters
    ----------
    x : ndarray or Reel, shape (frame, ...)
        The frames.
    function : callable
        Takes and gives as many frames, each of which hangs on that frame of `x` alone.
    exact : bool
        Whether what fits into float32 still does after it.
    """
    return x.mapped(function, stored=x.stored if exact else "f8") if isinstance(x, LazyFrames) else function(x)


def concatenate_lazy(parts: "Sequence[NDArray[Any] | LazyFrames]") -> Any:
    """One after another: an array of arrays, a reel where one is a reel."""
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


def from_iterator(parts: Iterable[Array], shape: tuple[int, ...]) -> LazyFrames:
    """A reel of parts that come once, one after another, and must be read in that order.

    Parameters
    ----------
    parts : iterable of ndarray, shape (frame, ...)
        As many frames together as `shape` says.
    shape : tuple of int
        Of the whole.
    """
    coming, waiting, given = iter(parts), [np.zeros((0, *shape[1:]))], 0

    def read(first: int, last: int) -> Array:
        nonlocal given
        if first != given:
            raise InputError(f"reel: expected frame {given} to be read next, got frame {first}")
        while sum(map(len, waiting)) < last - first:
            waiting.append(next(coming))
        whole = np.concatenate(waiting)
        waiting[:], given = [whole[last - first :]], last
        return whole[: last - first]

    return LazyFrames(read, shape)


def cached_blocks(
    make: Callable[[int, int], Array], shape: tuple[int, ...], *, size: int, kept: int = 3, stored: Stored = "f8"
) -> LazyFrames:
    """A reel that is worked out in segments of `size` frames, the last few of which are kept.

    Segments lie where they lie: a frame is the same number whatever stretch of the reel is read.

    Parameters
    ----------
    make : callable
        Takes (first, last) of a segment; gives its frames.
    shape : tuple of int
        Of the whole.
    size : int
        Frames of a segment.
    kept : int
        How many segments stay in memory: who reads in stretches comes back to the last one.
    stored : {"f4", "f8"}
        As in `LazyFrames`.
    """
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
    """A reel of which the last blocks that were read stay in memory: for short stretches one after another."""
    if not isinstance(x, LazyFrames):
        return x
    return cached_blocks(x.read, x.shape, size=next(last for _, last in block_ranges(x.shape)), kept=2, stored=x.stored)
