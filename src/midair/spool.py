"""Frames that wait on the disk, in a file without a name, which is gone with the program."""

import tempfile
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from midair.reel import Reel

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
