"""What long work calls as it goes on."""

from typing import Protocol


class Progress(Protocol):
    """Called with how much is done, and how much there is in all: frames, batches or tasks."""

    def __call__(self, done: int, total: int, /) -> None:
        """Done, and in all."""
        ...
