"""Output file for HDF5 that postpones disk errors, because HDF5 crashes on them."""

from io import FileIO
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing_extensions import Buffer


class RetryingFile(FileIO):
    """A new file that accepts all data but writes nothing after the first disk error, which `check` raises."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "w+")
        self._refused: OSError | None = None

    def write(self, data: "Buffer", /) -> int:
        """Write all data, or store the error."""
        view = memoryview(data).cast("B")
        left = view if self._refused is None else view[:0]
        try:
            while len(left):
                # The system may write only a part of a large block.
                left = left[super().write(left) or 0 :]
        except OSError as wrong:
            self._refused = wrong
        return len(view)

    def truncate(self, size: int | None = None, /) -> int:
        """Set the length, or store the error."""
        try:
            return super().truncate(size)
        except OSError as wrong:
            self._refused = self._refused or wrong
            return size or 0

    def check(self) -> None:
        """Raise the first disk error, if any."""
        if self._refused is not None:
            raise self._refused
