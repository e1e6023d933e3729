"""Frames that wait on the disk, in a file without a name, which is gone with the program."""

import tempfile
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from midair.reel import Reel, blocks

Array = NDArray[np.float64]


class Spool:
    """Frames of one shape, appended and read again.

    Parameters
    ----------
    shape : int
        Lengths of a frame.
    """

    def __init__(self, *shape: int) -> None:
        self.shape = shape
        self.frames = 0
        self._bytes = 8 * int(np.prod(shape, dtype=np.int64))
        self._file = tempfile.TemporaryFile(prefix="midair-")  # noqa: SIM115, closed by close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, wrong: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        # A reel may be all that still holds it.
        self._file.close()

    def close(self) -> None:
        """Forget all frames."""
        self._file.close()

    def append(self, block: Array) -> None:
        """Put frames, shape (frame, ...), behind those that are there."""
        self._file.seek(self.frames * self._bytes)
        self._file.write(np.ascontiguousarray(block, np.float64).data)
        self.frames += len(block)

    def read(self, first: int, last: int) -> Array:
        """Frames from `first` up to `last`, shape (last - first, ...)."""
        self._file.seek(first * self._bytes)
        whole = np.frombuffer(self._file.read((last - first) * self._bytes), np.float64)
        return whole.reshape(-1, *self.shape)

    def reel(self, frames: int | None = None) -> Reel:
        """All frames that are there, or will be."""
        return Reel(self.read, (self.frames if frames is None else frames, *self.shape))


class Columns:
    """Numbers of every channel over all frames, channel after channel: written and read by either.

    Parameters
    ----------
    frames, channels : int
        How many there are.
    """

    def __init__(self, frames: int, channels: int) -> None:
        self.frames, self.channels = frames, channels
        self._file = tempfile.TemporaryFile(prefix="midair-")  # noqa: SIM115, as in `Spool`

    def __del__(self) -> None:
        self._file.close()

    def put(self, channel: int, first: int, values: Array) -> None:
        """Numbers of one channel from a frame on."""
        self._file.seek(8 * (channel * self.frames + first))
        self._file.write(np.ascontiguousarray(values, np.float64).data)

    def channel(self, number: int, first: int, last: int) -> Array:
        """Numbers of one channel from `first` up to `last`."""
        self._file.seek(8 * (number * self.frames + first))
        return np.frombuffer(self._file.read(8 * (last - first)), np.float64)

    def fill(self, x: "Array | Reel") -> Self:
        """All of an array or a reel of as many frames and channels."""
        first = 0
        for block in blocks(x):
            for channel, values in enumerate(block.reshape(len(block), -1).T):
                self.put(channel, first, values)
            first += len(block)
        return self

    def reel(self, *shape: int) -> Reel:
        """All frames, each in this shape."""

        def read(first: int, last: int) -> Array:
            parts = [self.channel(number, first, last) for number in range(self.channels)]
            return np.stack(parts, axis=1).reshape(-1, *shape)

        return Reel(read, (self.frames, *shape))
