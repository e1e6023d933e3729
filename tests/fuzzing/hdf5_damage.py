"""Damage to the structure of HDF5 whose checksums fit again, so that HDF5 believes what it reads.

Layout: HDF5 File Format Specification 3.0. Blocks of metadata begin with four letters and end with a checksum; those of
an object hold messages: dataspace, type, layout, filters, links, attributes.
"""

import struct
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from midair.files.native.hdf5_recovery import checksum

SIGNED = tuple(b"OHDR OCHK FRHP FHIB BTHD BTLF BTIN FAHD FADB EAHD EAIB EASB EADB".split())
"""Letters with which blocks of metadata begin."""
KINDS = tuple(range(0x17))
"""Kinds of messages."""
EDGES = (*range(10), 16, 31, 32, 33, 64, 127, 128, 255, 256, 1000, 65535, 2**31 - 1, 2**32 - 1, 2**63, 2**64 - 1)
"""Numbers at the edges of types and sizes."""


@dataclass(frozen=True)
class Block:
    """Of metadata: where it begins, where its checksum is, and where messages lie in it."""

    start: int
    end: int
    messages: tuple[tuple[int, int], ...] = ()


def hdf5(data: bytes, rng: np.random.Generator) -> bytes:
    """A few numbers of one or two blocks changed, checksums repaired."""
    blocks = blocks_of(data)
    spoilt = bytearray(data)
    if not blocks:
        return _old(spoilt, rng)
    for _ in range(int(rng.integers(1, 3))):
        block = blocks[int(rng.integers(len(blocks)))]
        for _ in range(int(rng.integers(1, 3))):
            if block.messages and rng.random() < 0.85:
                _message(spoilt, block.messages[int(rng.integers(len(block.messages)))], rng)
            else:
                _number(spoilt, int(rng.integers(block.start + 4, max(block.start + 5, block.end))), block.end, rng)
        spoilt[block.end : block.end + 4] = struct.pack("<I", checksum(bytes(spoilt[block.start : block.end])))
    return bytes(spoilt)


def _message(spoilt: bytearray, message: tuple[int, int], rng: np.random.Generator) -> None:
    """One message: its kind, its flags, its length, or the numbers in it."""
    head, body = message
    size = struct.unpack_from("<H", spoilt, head + 1)[0]
    match int(rng.integers(8)):
        case 0:
            spoilt[head] = KINDS[int(rng.integers(len(KINDS)))]
        case 1:
            struct.pack_into("<H", spoilt, head + 1, max(0, size + int(rng.integers(-8, 9))) % 65536)
        case 2:
            spoilt[head + 3] ^= 1 << int(rng.integers(8))
        case _:
            # What says how the rest is read stands first.
            reach = min(size, int(rng.choice([4, 8, 24, 64, 4096])))
            _number(spoilt, body + int(rng.integers(max(1, reach))), body + size, rng)


def _number(spoilt: bytearray, place: int, end: int, rng: np.random.Generator) -> None:
    size = int(rng.choice([1, 1, 2, 4, 8]))
    if place + size > min(end, len(spoilt)):
        size = 1
    if place + size > len(spoilt):
        return
    have = int.from_bytes(spoilt[place : place + size], "little")
    near = (have + 1, have - 1, have * 2, have ^ (1 << int(rng.integers(8 * size))), len(spoilt), len(spoilt) - 8)
    values = (*near, *EDGES)
    value = values[int(rng.integers(len(values)))] % 2 ** (8 * size)
    spoilt[place : place + size] = value.to_bytes(size, "little")


def _old(spoilt: bytearray, rng: np.random.Generator) -> bytes:
    """The layout before checksums: numbers near the letters that begin its blocks, or anywhere in the first pages."""
    places = [at for sign in (b"\x89HDF", b"TREE", b"HEAP", b"SNOD", b"GCOL") for at in _all(bytes(spoilt), sign)]
    for _ in range(int(rng.integers(1, 4))):
        if places and rng.random() < 0.5:
            at = places[int(rng.integers(len(places)))] + int(rng.integers(4, 96))
        else:
            at = int(rng.integers(len(spoilt)))
        _number(spoilt, min(at, len(spoilt) - 8), len(spoilt), rng)
    return bytes(spoilt)


@lru_cache(maxsize=32)
def blocks_of(data: bytes) -> tuple[Block, ...]:
    """Every block whose checksum is found."""
    found: list[Block] = []
    if data[8:9] in (b"\x02", b"\x03"):
        found.append(Block(0, 44))
    for sign in SIGNED:
        for start in _all(data, sign):
            block = _header(data, start) if sign == b"OHDR" else _searched(data, start, sign)
            if block is not None:
                found.append(block)
    return tuple(found)


def _all(data: bytes, sign: bytes) -> list[int]:
    places, at = [], data.find(sign)
    while at >= 0:
        places.append(at)
        at = data.find(sign, at + 1)
    return places


def _header(data: bytes, start: int) -> Block | None:
    """An object's header, version 2 (IV.A.1.b)."""
    flags = data[start + 5]
    place = start + 6 + 16 * bool(flags & 0x20) + 4 * bool(flags & 0x10)
    width = 1 << (flags & 3)
    length = int.from_bytes(data[place : place + width], "little")
    first = place + width
    return _sound(data, start, first + length, first, flags)


def _searched(data: bytes, start: int, sign: bytes) -> Block | None:
    """A block whose length stands elsewhere: the first place where a checksum fits."""
    reach = 1200 if sign in (b"OCHK", b"BTLF", b"FADB", b"EAIB", b"FHIB") else 200
    for end in range(start + 10, min(len(data) - 4, start + reach)):
        if struct.unpack_from("<I", data, end)[0] == checksum(data[start:end]):
            return _sound(data, start, end, start + 4 if sign == b"OCHK" else end, 0)
    return None


def _sound(data: bytes, start: int, end: int, first: int, flags: int) -> Block | None:
    if end + 4 > len(data) or struct.unpack_from("<I", data, end)[0] != checksum(data[start:end]):
        return None
    messages, head = [], first
    skip = 4 + 2 * bool(flags & 4)
    while head + skip <= end:
        size = struct.unpack_from("<H", data, head + 1)[0]
        messages.append((head, head + skip))
        head += skip + size
    return Block(start, end, tuple(messages))
