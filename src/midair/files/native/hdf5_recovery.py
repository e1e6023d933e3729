"""Open HDF5 files whose writer was killed or still runs, as if they had been closed; output that survives disk errors.

Such a file has a flag that makes HDF5 reject any reader but an SWMR reader, and that one retries endlessly on damaged
metadata. The file is therefore read with the flag cleared in memory.
Layout of the superblock, version 3: HDF5 File Format Specification 3.0, section II.A.
"""

import struct
from io import BytesIO, FileIO
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, cast

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer
    from typing_extensions import Buffer


LARGE = 64_000_000
"""Size in bytes from which a file is not copied into memory."""

LENGTH = 48
"""Size of the superblock in bytes; the last 4 are the checksum of the others."""

_WRITTEN = 5  # consistency flags: open for writing (1), concurrent readers allowed (4, SWMR)
_WORD = 0xFFFFFFFF


def is_unclosed(path: Path) -> bool:
    """True if the flag of a file states that a writer has it open."""
    with path.open("rb") as file:
        block = file.read(LENGTH)
    return _is_valid(block) and block[11] != 0


def openable(path: Path) -> "Path | BinaryIO":
    """Argument for h5py: the path itself, or the file as if it had been closed."""
    return closed_file(path) if is_unclosed(path) else path


def closed_file(path: Path, *, large: int = LARGE) -> BinaryIO:
    """An unclosed file as if closed: a copy, which a growing file needs, or from `large` bytes on a view."""
    if path.stat().st_size < large:
        return BytesIO(closed_image(path))
    return cast("BinaryIO", _ClosedView(path))


def closed_image(path: Path) -> bytes:
    """Bytes of an unclosed file with the flag cleared and the end of file corrected."""
    data = path.read_bytes()
    return _closed_block(data[:LENGTH], len(data)) + data[LENGTH:]


class _ClosedView(FileIO):
    """A file whose superblock appears closed, with the length at the time of opening."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "r")
        self._block = _closed_block(self.read(LENGTH), path.stat().st_size)
        self.seek(0)

    def readinto(self, buffer: "WriteableBuffer", /) -> int:
        """Read at the current position."""
        at = self.tell()
        count = super().readinto(buffer) or 0
        if at < LENGTH:
            instead = self._block[at : at + count]
            memoryview(buffer).cast("B")[: len(instead)] = instead
        return count


def flagged_block(block: bytes, *, written: bool) -> bytes:
    """A superblock, and any data after it, with the flag for an open or a closed file."""
    return _flagged(block, _WRITTEN if written else 0) + block[LENGTH:]


def _closed_block(block: bytes, size: int) -> bytes:
    """The superblock with the flag cleared and the end of file at `size`."""
    # Bytes 28 to 35 hold the end of the file.
    return _flagged(block[:28] + struct.pack("<Q", size) + block[36:], 0)


def _flagged(block: bytes, flags: int) -> bytes:
    """The superblock with other consistency flags (byte 11)."""
    changed = block[:11] + bytes([flags]) + block[12 : LENGTH - 4]
    return changed + struct.pack("<I", checksum(changed))


def checksum(data: bytes) -> int:
    """Checksum of HDF5 metadata: B. Jenkins, lookup3, hashlittle with initial value 0 (2006); at least one byte."""
    a = b = c = (0xDEADBEEF + len(data)) & _WORD
    words = struct.unpack(f"<{-(-len(data) // 12) * 3}I", data.ljust(-(-len(data) // 12) * 12, b"\0"))
    for i in range(0, len(words), 3):
        a, b, c = (a + words[i]) & _WORD, (b + words[i + 1]) & _WORD, (c + words[i + 2]) & _WORD
        if i + 3 < len(words):
            a, b, c = _mix(a, b, c)
    return _finish(a, b, c)


def _mix(a: int, b: int, c: int) -> tuple[int, int, int]:
    for turn in (4, 6, 8, 16, 19, 4):
        a = ((a - c) & _WORD) ^ _rotated(c, turn)
        a, b, c = b, (c + b) & _WORD, a
    return a, b, c


def _finish(a: int, b: int, c: int) -> int:
    for turn in (14, 11, 25, 16, 4, 14, 24):
        c = ((c ^ b) - _rotated(b, turn)) & _WORD
        a, b, c = b, c, a
    return b


def _rotated(word: int, turn: int) -> int:
    return ((word << turn) | (word >> (32 - turn))) & _WORD


def _is_valid(block: bytes) -> bool:
    whole = len(block) == LENGTH and block[:9] == b"\x89HDF\r\n\x1a\n\x03" and block[9:11] == b"\x08\x08"
    return whole and checksum(block[:-4]) == int.from_bytes(block[-4:], "little")


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
