"""Temporary frames on disk, in an unnamed file that the system deletes when the program ends."""

import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import IO, Literal, Self

import numpy as np

from midair.array_types import Array
from midair.errors import FileError
from midair.streaming.lazy_frames import LazyFrames, blocks


@contextmanager
def _disk_errors() -> Generator[None]:
    """Turn a disk error into one that names the folder, because the file has no name."""
    try:
        yield
    except OSError as wrong:
        raise FileError(
            f"{tempfile.gettempdir()}: expected disk space for temporary frames, got: {wrong.strerror}; "
            "free some space, or set TMPDIR to a folder on another disk"
        ) from wrong


def _unnamed_file() -> IO[bytes]:
    with _disk_errors():
        return tempfile.TemporaryFile(prefix="midair-")


def _write(file: IO[bytes], at: int, block: Array, dtype: str = "f8") -> None:
    with _disk_errors():
        file.seek(at)
        file.write(np.ascontiguousarray(block, dtype).data)
        file.flush()


def _close(file: IO[bytes]) -> None:
    # Closing retries failed writes, whose data are no longer needed.
    with suppress(OSError):
        file.close()


class TempFrames:
    """Frames of one shape on disk, float64 or bytes ("u1"), which can be appended and read."""

    def __init__(self, *shape: int, dtype: Literal["f8", "u1"] = "f8") -> None:
        self.shape = shape
        self.frames = 0
        self._dtype = dtype
        self._bytes = np.dtype(dtype).itemsize * int(np.prod(shape, dtype=np.int64))
        self._file = _unnamed_file()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, wrong: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        # Lazy frames may hold the last reference to it.
        self.close()

    def close(self) -> None:
        """Delete all frames."""
        _close(self._file)

    def append(self, block: Array) -> None:
        """Append frames, shape (frame, ...); raises FileError if the disk is full."""
        _write(self._file, self.frames * self._bytes, block, self._dtype)
        self.frames += len(block)

    def read(self, first: int, last: int) -> Array:
        """Frames from `first` up to `last`, shape (last - first, ...)."""
        self._file.seek(first * self._bytes)
        whole = np.frombuffer(self._file.read((last - first) * self._bytes), self._dtype)
        return whole.reshape(-1, *self.shape)

    def reel(self, frames: int | None = None) -> LazyFrames:
        """All frames as lazy frames; `frames` if more will be appended."""
        return LazyFrames(self.read, (self.frames if frames is None else frames, *self.shape))


class TempChannels:
    """Values of every channel over all frames, stored channel by channel, written and read by channel or by frame."""

    def __init__(self, frames: int, channels: int) -> None:
        self.frames, self.channels = frames, channels
        self._file = _unnamed_file()

    def __del__(self) -> None:
        _close(self._file)

    def put(self, channel: int, first: int, values: Array) -> None:
        """Write values of one channel from frame `first` on; raises FileError if the disk is full."""
        _write(self._file, 8 * (channel * self.frames + first), values)

    def channel(self, number: int, first: int, last: int) -> Array:
        """Values of one channel from frame `first` up to `last`."""
        self._file.seek(8 * (number * self.frames + first))
        return np.frombuffer(self._file.read(8 * (last - first)), np.float64)

    def fill(self, x: "Array | LazyFrames") -> Self:
        """Write a whole array or lazy frames with the same numbers of frames and channels."""
        first = 0
        for block in blocks(x):
            for channel, values in enumerate(block.reshape(len(block), -1).T):
                self.put(channel, first, values)
            first += len(block)
        return self

    def reel(self, *shape: int) -> LazyFrames:
        """All frames as lazy frames, each reshaped to `shape`."""

        def read(first: int, last: int) -> Array:
            parts = [self.channel(number, first, last) for number in range(self.channels)]
            return np.stack(parts, axis=1).reshape(-1, *shape)

        return LazyFrames(read, (self.frames, *shape))
