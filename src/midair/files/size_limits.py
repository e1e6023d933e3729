"""Limits of memory for files that are read as a whole, and of their size after decompression."""

import zlib
from pathlib import Path

from midair import ram
from midair.errors import BrokenFileError, InputError

EXPANDED = 100
"""Maximum ratio of expanded to compressed size: recordings compress to a third, silence to a thousandth."""

EXPANDED_ANYWAY = 2**27
"""Expanded size that is always allowed, in bytes."""


def max_expanded_size(path: Path, *, anyway: int = EXPANDED_ANYWAY) -> int:
    """Maximum expanded size of a file, in bytes."""
    return max(EXPANDED * path.stat().st_size, anyway)


def check_expansion(path: Path, expanded: int, *, anyway: int = EXPANDED_ANYWAY) -> None:
    """Raise BrokenFileError if the expanded size is larger than that of any recording in a file of this size."""
    if expanded > max_expanded_size(path, anyway=anyway):
        size = path.stat().st_size
        raise BrokenFileError(
            f"{path}: expected expansion to at most {EXPANDED} times its {size} bytes, got {expanded} or more; "
            "if you trust it, write it without compression"
        )


def inflated(path: Path, packed: bytes, room: int) -> bytes:
    """Decompress a zlib stream to at most `room` bytes; raises BrokenFileError if it is larger or truncated."""
    stream = zlib.decompressobj()
    data = stream.decompress(packed, room + 1)
    if len(data) > room:
        check_expansion(path, max_expanded_size(path) + 1)
    if not stream.eof:
        raise BrokenFileError(f"{path}: expected a whole zlib stream, got the first {len(packed)} bytes of one")
    return data


def check_memory_for(needed: float, what: str, advice: str) -> None:
    """Raise InputError if fewer than `needed` bytes of memory are free; `what` and `advice` are for the message."""
    free = ram.available_memory()
    if free is not None and needed > free:
        raise InputError(
            f"{what}: expected {needed / 1e9:.3g} GB of free memory, because all of it is read at once, got "
            f"{free / 1e9:.3g} GB; {advice}"
        )
