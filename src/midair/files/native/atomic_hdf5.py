"""In-memory buffer between HDF5 and the disk while a recording grows, so that HDF5 never meets a disk error.

HDF5 does not handle failed writes: it loses rows without an error, or crashes. Its writes are therefore kept in memory
until `commit` writes them to the disk: first the data, then the metadata that point to them, then the metadata with
their number. If the program is killed or the disk fails at any time, the file contains the last complete commit, and a
concurrent reader (SWMR) never sees an unfinished one.
"""

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

from midair.files.native.hdf5_recovery import LENGTH, flagged_block

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer, WriteableBuffer

_ORDER = (b"EADB", b"EASB", b"EAIB", b"EAHD", b"OCHK", b"OHDR")
"""Signatures of metadata blocks in the order of writing (HDF5 File Format Specification 3.0, III.C, IV.A)."""


class AtomicHdf5File:
    """A file object for h5py that buffers changes until `commit` and never raises an error while HDF5 writes."""

    def __init__(self, handle: int) -> None:
        self._handle = handle
        self._size = os.fstat(handle).st_size
        self._at = 0
        self._pending: dict[int, bytes] = {}

    def tell(self) -> int:
        """Current position."""
        return self._at

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Set the position."""
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._size}[whence]
        return self._at

    def readinto(self, buffer: "WriteableBuffer") -> int:
        """Read from the disk, overlaid with buffered data; zeros beyond both."""
        view = memoryview(buffer).cast("B")
        os.lseek(self._handle, self._at, os.SEEK_SET)
        stored = os.read(self._handle, len(view))
        view[:] = stored.ljust(len(view), b"\0")
        for place, data in self._pending.items():
            begin, end = max(place, self._at), min(place + len(data), self._at + len(view))
            if begin < end:
                view[begin - self._at : end - self._at] = data[begin - place : end - place]
        self._at += len(view)
        return len(view)

    def read(self, count: int) -> bytes:
        """Read the next `count` bytes."""
        data = bytearray(count)
        self.readinto(data)
        return bytes(data)

    def write(self, data: "ReadableBuffer") -> int:
        """Buffer data until the next commit."""
        new = bytes(data)
        # A second write at the same place replaces the first and takes its later position in the order.
        old = self._pending.pop(self._at, b"")
        self._pending[self._at] = new + old[len(new) :]
        self._at += len(new)
        self._size = max(self._size, self._at)
        return len(new)

    def truncate(self, size: int) -> int:
        """Set the length, effective at the next commit."""
        self._size = size
        return size

    def flush(self) -> None:
        """Do nothing; only `commit` writes."""

    def commit(self, *, closed: bool = False) -> None:
        """Write all buffered data, and with `closed` mark the file as closed and flush it to the device (fsync).

        After an OSError the file is unchanged for readers, and the data stay in the buffer.
        """
        for place, data in self._sorted(closed=closed):
            _write_all(self._handle, data, place)
        if closed:
            os.ftruncate(self._handle, self._size)
            os.fsync(self._handle)
        self._pending.clear()

    def _sorted(self, *, closed: bool) -> Iterator[tuple[int, bytes]]:
        """Buffered data in an order that is safe for a concurrent reader; the superblock last."""
        # HDF5 has discarded data beyond the end.
        inside = [(place, data) for place, data in self._pending.items() if 0 < place < self._size]
        yield from sorted(inside, key=lambda item: _rank(item[1]))
        if closed or 0 in self._pending:
            yield 0, flagged_block(self._pending.get(0) or self._stored_block(), written=not closed)

    def _stored_block(self) -> bytes:
        os.lseek(self._handle, 0, os.SEEK_SET)
        return os.read(self._handle, LENGTH)


def _rank(data: bytes) -> int:
    return _ORDER.index(data[:4]) if data[:4] in _ORDER else -1


def _write_all(handle: int, data: bytes, place: int) -> None:
    os.lseek(handle, place, os.SEEK_SET)
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(handle, rest) :]
