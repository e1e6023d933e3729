"""Temporary frames on disk, in an unnamed file that the system deletes when the program ends; frames that arrive."""

import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from threading import Condition
from typing import IO, Any, Self

import numpy as np
from numpy.typing import DTypeLike, NDArray

from midair.errors import FileError
from midair.streaming.lazy_frames import LazyFrames


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


class _Numbers:
    """Numbers of one type in an unnamed file."""

    def __init__(self, kind: DTypeLike = np.float64) -> None:
        self._file, self._kind = _unnamed_file(), np.dtype(kind)

    def __del__(self) -> None:
        # Lazy frames may hold the last reference to it.
        self.close()

    def close(self) -> None:
        """Delete all frames."""
        # Closing retries failed writes, whose data are no longer needed.
        with suppress(OSError):
            self._file.close()

    def _write(self, at: int, block: NDArray[Any]) -> None:
        with _disk_errors():
            self._file.seek(self._kind.itemsize * at)
            self._file.write(np.ascontiguousarray(block, self._kind).data)
            self._file.flush()

    def _read(self, at: int, count: int) -> Any:
        self._file.seek(self._kind.itemsize * at)
        return np.frombuffer(self._file.read(self._kind.itemsize * count), self._kind)


class TempFrames(_Numbers):
    """Frames of one shape on disk, which can be appended and read."""

    def __init__(self, *shape: int, kind: DTypeLike = np.float64) -> None:
        super().__init__(kind)
        self.shape, self.frames, self._size = shape, 0, int(np.prod(shape, dtype=np.int64))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def append(self, block: NDArray[Any]) -> None:
        """Append frames, shape (frame, ...); raises FileError if the disk is full."""
        self._write(self.frames * self._size, block)
        self.frames += len(block)

    def read(self, first: int, last: int) -> Any:
        """Frames from `first` up to `last`, shape (last - first, ...), of their own type."""
        return self._read(first * self._size, (last - first) * self._size).reshape(-1, *self.shape)

    def reel(self, frames: int | None = None) -> LazyFrames:
        """All frames as lazy frames; `frames` if more will be appended."""
        return LazyFrames(self.read, (self.frames if frames is None else frames, *self.shape))


class ArrivingFrames(LazyFrames):
    """Lazy frames of `shape` that come in order and are kept in a temporary file; a read waits for its frames.

    They are kept as bytes, of which `steps` are 1, or as they are if `steps` is None.
    """

    def __init__(self, shape: tuple[int, ...], *, steps: float | None = None) -> None:
        super().__init__(self._arrived, shape)
        self._spool = TempFrames(*shape[1:], kind=np.float64 if steps is None else np.uint8)
        self._steps, self._news, self._error = steps, Condition(), list[BaseException]()

    @property
    def there(self) -> int:
        """Number of frames that have come; raises the error of `fail`."""
        if self._error:
            raise self._error[0]
        return self._spool.frames

    def append(self, block: NDArray[Any]) -> None:
        """Append frames, as bytes if they are kept so."""
        with self._news:
            self._spool.append(block)
            self._news.notify_all()

    def fail(self, error: BaseException) -> None:
        """End with an error, which every later read raises."""
        with self._news:
            self._error.append(error)
            self._news.notify_all()

    def kept(self, frames: int) -> LazyFrames:
        """The first frames, all of which have come; they can be read also after an error."""
        return LazyFrames(self._kept, (frames, *self.shape[1:]))

    def _arrived(self, first: int, last: int) -> NDArray[np.float64]:
        with self._news:
            self._news.wait_for(lambda: self.there >= last)
        return self._kept(first, last)

    def _kept(self, first: int, last: int) -> NDArray[np.float64]:
        with self._news:
            read = self._spool.read(first, last)
        return read if self._steps is None else read / self._steps
