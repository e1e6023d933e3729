"""Arrays whose frames are read or computed on access, so that only one block at a time is in memory.

A `LazyFrames` can replace an array in a data class: `AmplitudeFrames.amplitude`, `Drive.phase` and `Drive.level`.
Iterating over its `blocks` needs the memory of one block; NumPy functions convert it to a whole array.
"""

from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from threading import Lock
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.progress import report_progress

Stored = Literal["f4", "f8"]
"""Precision of the stored numbers of a recording."""

BYTES = 2**21
"""Approximate size of a block: large enough that the overhead per block is negligible."""


class LazyFrames:
    """A read-only array of `shape` (frame, ...) that keeps no frames in memory.

    `read` takes (first, last) and returns these frames as float64.
    """

    def __init__(self, read: Callable[[int, int], Array], shape: tuple[int, ...]) -> None:
        self._read, self.shape = read, tuple(int(length) for length in shape)

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
            return LazyFrames(lambda a, b: self._read(first + a, first + b), (max(0, last - first), *self.shape[1:]))
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

    def max(self) -> float:
        """Maximum of all numbers."""
        return max(float(block.max()) for block in self.blocks())


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


def each_frame(x: Any, function: Callable[[Array], Any]) -> Any:
    """Apply a function of single frames: to an array at once, to lazy frames when they are read."""
    if not isinstance(x, LazyFrames):
        return function(x)
    return LazyFrames(lambda a, b: function(x.read(a, b)), (len(x), *function(x.read(0, 1)).shape[1:]))


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

    return LazyFrames(read, (int(ends[-1]), *parts[0].shape[1:]))


def cached_blocks(make: Callable[[int, int], Array], shape: tuple[int, ...], *, size: int, kept: int = 2) -> LazyFrames:
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

    return LazyFrames(read, shape)
