"""Temporary frames on disk, in an unnamed file that the system deletes when the program ends; frames that arrive."""

import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from threading import Condition
from typing import Any

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


class TempFrames:
    """Frames of one shape on disk, which can be appended and read."""

    def __init__(self, *shape: int, kind: DTypeLike = np.float64) -> None:
        self.shape, self.frames, self._kind = shape, 0, np.dtype(kind)
        self._row = self._kind.itemsize * int(np.prod(shape, dtype=np.int64))
        with _disk_errors():
            self._file = tempfile.TemporaryFile(prefix="midair-")  # noqa: SIM115

    def __del__(self) -> None:
        # Closing retries failed writes, whose data are no longer needed.
        with suppress(OSError, AttributeError):
            self._file.close()

    def append(self, block: NDArray[Any]) -> None:
        """Append frames, shape (frame, ...); raises FileError if the disk is full."""
        with _disk_errors():
            self._file.seek(self.frames * self._row)
            self._file.write(np.ascontiguousarray(block, self._kind).data)
            self._file.flush()
        self.frames += len(block)

    def read(self, first: int, last: int) -> Any:
        """Frames from `first` up to `last`, shape (last - first, ...), of their own type."""
        self._file.seek(first * self._row)
        return np.frombuffer(self._file.read((last - first) * self._row), self._kind).reshape(-1, *self.shape)

    def reel(self, frames: int = 0) -> LazyFrames:
        """All frames as lazy frames, followed by zeros up to `frames`."""

        def read(first: int, last: int) -> Any:
            there = self.read(min(first, self.frames), min(last, self.frames))
            return np.concatenate([there, np.zeros((last - first - len(there), *self.shape))])

        return LazyFrames(read, (max(frames, self.frames), *self.shape))


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
