"""Frames that wait on the disk, in a file without a name, which is gone with the program."""

import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import IO, Self

import numpy as np
from numpy.typing import NDArray

from midair.errors import FileError
from midair.lazy_frames import LazyFrames, blocks

Array = NDArray[np.float64]


@contextmanager
def _on_disk() -> Generator[None]:
    """What the disk refuses is one line that names the folder: nobody chose this file, and it has no name."""
    try:
        yield
    except OSError as wrong:
        raise FileError(
            f"{tempfile.gettempdir()}: expected room for frames that wait there while it works, got: {wrong.strerror}; "
            "make room, or set TMPDIR to a folder on another disk"
        ) from wrong


def _nameless() -> IO[bytes]:
    with _on_disk():
        return tempfile.TemporaryFile(prefix="midair-")


def _write(file: IO[bytes], at: int, block: Array) -> None:
    with _on_disk():
        file.seek(at)
        file.write(np.ascontiguousarray(block, np.float64).data)
        file.flush()


def _forget(file: IO[bytes]) -> None:
    # What could not be written is tried once more by closing, and is wanted no longer.
    with suppress(OSError):
        file.close()


class TempFrames:
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
        self._file = _nameless()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, wrong: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        # A reel may be all that still holds it.
        self.close()

    def close(self) -> None:
        """Forget all frames."""
        _forget(self._file)

    def append(self, block: Array) -> None:
        """Put frames, shape (frame, ...), behind those that are there.

        Raises
        ------
        FileError
            If the disk does not take them.
        """
        _write(self._file, self.frames * self._bytes, block)
        self.frames += len(block)

    def read(self, first: int, last: int) -> Array:
        """Frames from `first` up to `last`, shape (last - first, ...)."""
        self._file.seek(first * self._bytes)
        whole = np.frombuffer(self._file.read((last - first) * self._bytes), np.float64)
        return whole.reshape(-1, *self.shape)

    def reel(self, frames: int | None = None) -> LazyFrames:
        """All frames that are there, or will be."""
        return LazyFrames(self.read, (self.frames if frames is None else frames, *self.shape))


class TempChannels:
    """Numbers of every channel over all frames, channel after channel: written and read by either.

    Parameters
    ----------
    frames, channels : int
        How many there are.
    """

    def __init__(self, frames: int, channels: int) -> None:
        self.frames, self.channels = frames, channels
        self._file = _nameless()

    def __del__(self) -> None:
        _forget(self._file)

    def put(self, channel: int, first: int, values: Array) -> None:
        """Numbers of one channel from a frame on.

        Raises
        ------
        FileError
            If the disk does not take them.
        """
        _write(self._file, 8 * (channel * self.frames + first), values)

    def channel(self, number: int, first: int, last: int) -> Array:
        """Numbers of one channel from `first` up to `last`."""
        self._file.seek(8 * (number * self.frames + first))
        return np.frombuffer(self._file.read(8 * (last - first)), np.float64)

    def fill(self, x: "Array | LazyFrames") -> Self:
        """All of an array or a reel of as many frames and channels."""
        first = 0
        for block in blocks(x):
            for channel, values in enumerate(block.reshape(len(block), -1).T):
                self.put(channel, first, values)
            first += len(block)
        return self

    def reel(self, *shape: int) -> LazyFrames:
        """All frames, each in this shape."""

        def read(first: int, last: int) -> Array:
            parts = [self.channel(number, first, last) for number in range(self.channels)]
            return np.stack(parts, axis=1).reshape(-1, *shape)

        return LazyFrames(read, (self.frames, *shape))
