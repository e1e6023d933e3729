"""The bytes of a file that HDF5 writes, on a disk that may fill up: HDF5 does not survive that, Python does."""

from io import FileIO
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing_extensions import Buffer


class RetryingFile(FileIO):
    """A new file that takes every byte without a word, and says at the end what the disk said.

    HDF5 that cannot write what it holds cannot close its file either, and may end the program. So nothing is refused
    while it writes; after the first refusal of the disk nothing more is written, and `check` raises it.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "w+")
        self._refused: OSError | None = None

    def write(self, data: "Buffer", /) -> int:
        """Write all of it, or remember why not."""
        view = memoryview(data).cast("B")
        left = view if self._refused is None else view[:0]
        try:
            while len(left):
                # The system may take a part of a large piece.
                left = left[super().write(left) or 0 :]
        except OSError as wrong:
            self._refused = wrong
        return len(view)

    def truncate(self, size: int | None = None, /) -> int:
        """Set the length, or remember why not."""
        try:
            return super().truncate(size)
        except OSError as wrong:
            self._refused = self._refused or wrong
            return size or 0

    def check(self) -> None:
        """Raise what the disk refused, if it did."""
        if self._refused is not None:
            raise self._refused
