"""The chunks of a RIFF file: midair keeps its header in one of its own, which other programs skip.

Multimedia Programming Interface and Data Specifications 1.0 (IBM and Microsoft, 1991): a chunk is four letters, the
length of its content as a little-endian uint32, and the content, padded to an even length.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from midair.errors import BrokenFileError

CHUNK = b"mdar"
"""Letters of midair's chunk."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chunk:
    """Where one lies in a file: its letters, and start and length of its content in bytes."""

    letters: bytes
    start: int
    length: int


def chunks(path: Path) -> tuple[Chunk, ...]:
    """The chunks of a WAV, in order.

    Raises
    ------
    BrokenFileError
        If the file is no WAV, or shorter than its chunks say.
    """
    data = path.read_bytes()
    if data[:4] != b"RIFF" or data[8:12] != b"WAVE":
        raise BrokenFileError(f"{path}: expected a WAV, got a file that begins with {data[:12]!r}")
    return tuple(_walk(data, path))


def append_chunk(path: Path, content: bytes) -> None:
    """Put midair's chunk behind the others, and its length into that of the whole."""
    with path.open("rb+") as file:
        end = file.seek(0, 2)
        file.write(b"\0" * (end % 2) + CHUNK + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2))
        length = file.tell() - 8
        file.seek(4)
        file.write(struct.pack("<I", length))


def content(path: Path, chunk: Chunk) -> bytes:
    """What a chunk holds."""
    with path.open("rb") as file:
        file.seek(chunk.start)
        return file.read(chunk.length)


def _walk(data: bytes, path: Path) -> Iterator[Chunk]:
    place = 12
    while place + 8 <= len(data):
        letters, length = struct.unpack_from("<4sI", data, place)
        if place + 8 + length > len(data):
            raise BrokenFileError(
                f"{path}: expected {length} bytes in chunk {letters.decode('latin-1')!r}, got {len(data) - place - 8}; "
                "the file was cut or its header is wrong"
            )
        yield Chunk(letters=letters, start=place + 8, length=length)
        place += 8 + length + length % 2
