"""Limits of memory for files that are read as a whole, and of their size after decompression."""

from pathlib import Path

from rich.filesize import decimal

from midair import ram
from midair.errors import BrokenFileError, InputError

EXPANDED = 100
"""Maximum ratio of expanded to compressed size: recordings compress to a third, silence to a thousandth."""

EXPANDED_ANYWAY = 2**27
"""Expanded size that is always allowed, in bytes."""


def check_expansion(path: Path, expanded: int, *, anyway: int = EXPANDED_ANYWAY) -> None:
    """Raise BrokenFileError if the expanded size is larger than that of any recording in a file of this size."""
    size = path.stat().st_size
    if expanded > max(EXPANDED * size, anyway):
        raise BrokenFileError(
            f"{path}: expected expansion to at most {EXPANDED} times its {size} bytes, got {expanded} or more; "
            "if you trust it, write it without compression"
        )


def check_memory_for(needed: float, what: str, advice: str) -> None:
    """Raise InputError if fewer than `needed` bytes of memory are free; `what` and `advice` are for the message."""
    free = ram.available_memory()
    if free is not None and needed > free:
        raise InputError(
            f"{what}: expected {decimal(int(needed))} of free memory, because all of it is read at once, got "
            f"{decimal(free)}; {advice}"
        )
