"""HDF5 files whose writer was killed or still runs, as if they had been closed.

Such a file carries a flag for which HDF5 refuses it to anyone but a reader beside a writer (SWMR), and that reader
tries damaged metadata again and again without end. So the file is read as it stands, and the flag is cleared in the
copy.
Layout of the superblock, version 3: HDF5 File Format Specification 3.0, section II.A.
"""

import struct
from pathlib import Path

_LENGTH = 48  # bytes of the superblock; the last 4 are the checksum of the others
_WORD = 0xFFFFFFFF


def is_unclosed(path: Path) -> bool:
    """Whether a file says that a writer has it open."""
    with path.open("rb") as file:
        block = file.read(_LENGTH)
    return _sound(block) and block[11] != 0


def closed_image(path: Path) -> bytes:
    """The bytes of an unclosed file with the flag cleared and the end where the bytes end."""
    data = path.read_bytes()
    block = bytearray(data[: _LENGTH - 4])
    block[11] = 0
    block[28:36] = struct.pack("<Q", len(data))
    return bytes(block) + struct.pack("<I", checksum(bytes(block))) + data[_LENGTH:]


def checksum(data: bytes) -> int:
    """Checksum of HDF5's metadata: B. Jenkins, lookup3, hashlittle with start 0 (2006), of one byte or more."""
    a = b = c = (0xDEADBEEF + len(data)) & _WORD
    words = struct.unpack(f"<{-(-len(data) // 12) * 3}I", data.ljust(-(-len(data) // 12) * 12, b"\0"))
    for i in range(0, len(words), 3):
        a, b, c = (a + words[i]) & _WORD, (b + words[i + 1]) & _WORD, (c + words[i + 2]) & _WORD
        if i + 3 < len(words):
            a, b, c = _mix(a, b, c)
    return _finish(a, b, c)


def _mix(a: int, b: int, c: int) -> tuple[int, int, int]:
    for turn in (4, 6, 8, 16, 19, 4):
        a = ((a - c) & _WORD) ^ _turned(c, turn)
        a, b, c = b, (c + b) & _WORD, a
    return a, b, c


def _finish(a: int, b: int, c: int) -> int:
    for turn in (14, 11, 25, 16, 4, 14, 24):
        c = ((c ^ b) - _turned(b, turn)) & _WORD
        a, b, c = b, c, a
    return b


def _turned(word: int, turn: int) -> int:
    return ((word << turn) | (word >> (32 - turn))) & _WORD


def _sound(block: bytes) -> bool:
    whole = len(block) == _LENGTH and block[:9] == b"\x89HDF\r\n\x1a\n\x03" and block[9:11] == b"\x08\x08"
    return whole and checksum(block[:-4]) == int.from_bytes(block[-4:], "little")
