"""Chunks of WAV files (RIFF, RF64, Wave64); midair stores its header in a chunk that other programs skip.

RIFF: Multimedia Programming Interface and Data Specifications 1.0 (IBM and Microsoft, 1991): a chunk is four letters,
the length of its content as a little-endian uint32, and the content, padded to an even length. RF64 (ITU-R BS.2088): as
RIFF, but lengths of 2^32 - 1 refer to 64-bit lengths in the first chunk, ds64. Wave64 (Sony, 2003): letters are GUIDs
that begin with the four letters, lengths are uint64 and include the 24 bytes before the content, padding is to 8 bytes.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from midair.errors import BrokenFileError

CHUNK = b"mdar"
"""Letters of midair's chunk."""

_LONG = 0xFFFFFFFF
_WAVE64 = b"riff\x2e\x91\xcf\x11\xa5\xd6\x28\xdb\x04\xc1\x00\x00"


@dataclass(frozen=True, slots=True, kw_only=True)
class RiffChunk:
    """Letters of a chunk, and start and length of its content in bytes."""

    letters: bytes
    start: int
    length: int


def chunks(path: Path) -> tuple[RiffChunk, ...]:
    """The chunks of a WAV, RF64 or Wave64 file, in order; raises BrokenFileError if it is another file or truncated."""
    size = path.stat().st_size
    with path.open("rb") as file:
        start = file.read(40)
        if start[:16] == _WAVE64 and start[24:28] == b"wave":
            walk = _walk_wave64
        elif start[:4] in (b"RIFF", b"RF64") and start[8:12] == b"WAVE":
            walk = _walk_riff
        else:
            raise BrokenFileError(f"{path}: expected a WAV, got a file that begins with {start[:12]!r}")
        found: list[RiffChunk] = []
        for chunk in walk(file, size):
            if chunk.length < 0 or chunk.start + chunk.length > size:
                raise BrokenFileError(
                    f"{path}: expected {chunk.length} bytes in chunk {chunk.letters.decode('latin-1')!r}, got "
                    f"{size - chunk.start}; the file is truncated or its header is wrong"
                )
            found.append(chunk)
    return tuple(found)


def append_chunk(path: Path, content: bytes) -> None:
    """Append midair's chunk to a RIFF file and update the length of the file."""
    with path.open("rb+") as file:
        end = file.seek(0, 2)
        # Chunks start at even positions.
        file.write(b"\0" * (end % 2) + CHUNK + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2))
        length = file.tell() - 8
        file.seek(4)
        file.write(struct.pack("<I", length))


def content(path: Path, chunk: RiffChunk) -> bytes:
    """Content of a chunk."""
    with path.open("rb") as file:
        file.seek(chunk.start)
        return file.read(chunk.length)


def _numbers_at(file: BinaryIO, place: int, layout: str) -> tuple[Any, ...]:
    file.seek(place)
    return struct.unpack(layout, file.read(struct.calcsize(layout)))


def _walk_riff(file: BinaryIO, size: int) -> Iterator[RiffChunk]:
    place, long = 12, 0
    while place + 8 <= size:
        letters, length = _numbers_at(file, place, "<4sI")
        if letters == b"ds64" and length >= 16 and place + 24 <= size:
            (long,) = _numbers_at(file, place + 16, "<Q")
        if letters == b"data" and length == _LONG and long:
            length = long
        yield RiffChunk(letters=letters, start=place + 8, length=length)
        place += 8 + length + length % 2


def _walk_wave64(file: BinaryIO, size: int) -> Iterator[RiffChunk]:
    place = 40
    while place + 24 <= size:
        letters, length = _numbers_at(file, place, "<4s12xQ")
        yield RiffChunk(letters=letters, start=place + 24, length=length - 24)
        place += -(-length // 8) * 8
