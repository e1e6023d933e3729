"""How much a compressed file may hold: a megabyte of zeros' zeros must not become all of the memory."""

import zlib
from pathlib import Path

from midair.errors import BrokenFileError

EXPANDED = 100
"""Times its size that a file may expand to: recordings compress to a third, silence to a thousandth."""

EXPANDED_ANYWAY = 2**27
"""Bytes that any file may expand to."""


def room_of(path: Path, *, anyway: int = EXPANDED_ANYWAY) -> int:
    """Bytes that a file may expand to."""
    return max(EXPANDED * path.stat().st_size, anyway)


def check_expansion(path: Path, expanded: int, *, anyway: int = EXPANDED_ANYWAY) -> None:
    """Raise BrokenFileError if a file expands to more bytes than any recording of its size."""
    if expanded > room_of(path, anyway=anyway):
        size = path.stat().st_size
        raise BrokenFileError(
            f"{path}: expected what expands to at most {EXPANDED} times its {size} bytes, got {expanded} or more; "
            "if it is no trap, write it without compression"
        )


def inflated(path: Path, packed: bytes, room: int) -> bytes:
    """What a zlib stream of a file holds, as long as it fits into `room` bytes.

    Raises
    ------
    BrokenFileError
        If it does not, or was cut.
    """
    stream = zlib.decompressobj()
    data = stream.decompress(packed, room + 1)
    if len(data) > room:
        check_expansion(path, room_of(path) + 1)
    if not stream.eof:
        raise BrokenFileError(f"{path}: expected a whole zlib stream, got {len(packed)} bytes of one; it was cut")
    return data
