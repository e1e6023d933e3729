"""Lazy frames that another thread appends while they are read."""

from threading import Condition
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.streaming.lazy_frames import LazyFrames
from midair.streaming.temp_frames import TempFrames


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
