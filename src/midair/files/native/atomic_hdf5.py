"""What HDF5 takes for a file while a recording grows: it never meets a disk that refuses.

HDF5 does not survive a write that fails: it loses rows in silence, or takes the program with it. So what it writes is
kept here, in memory, until `commit` brings it to the disk. A commit writes the numbers first, then what points to them,
then what says how many there are; so a file whose program is killed at any moment, or whose disk refuses at any
moment, holds what the last whole commit left, and a reader beside the writer (SWMR) sees nothing unfinished.
"""

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

from midair.files.native.hdf5_recovery import LENGTH, flagged_block

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer, WriteableBuffer

_ORDER = (b"EADB", b"EASB", b"EAIB", b"EAHD", b"OCHK", b"OHDR")
"""First bytes of what points to numbers, in the order of writing (HDF5 File Format Specification 3.0, III.C, IV.A)."""


class AtomicHdf5File:
    """A file for h5py whose changes wait in memory until they are committed. Never raises while HDF5 writes.

    Parameters
    ----------
    handle : int
        Of the open file, to read and write; it stays the caller's.
    """

    def __init__(self, handle: int) -> None:
        self._handle = handle
        self._size = os.fstat(handle).st_size
        self._at = 0
        self._pending: dict[int, bytes] = {}

    def tell(self) -> int:
        """Where the next bytes are read or written."""
        return self._at

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go there."""
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._size}[whence]
        return self._at

    def readinto(self, buffer: "WriteableBuffer") -> int:
        """Read what the disk has, and over it what waits; zeros where neither has anything."""
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
        """The next bytes."""
        data = bytearray(count)
        self.readinto(data)
        return bytes(data)

    def write(self, data: "ReadableBuffer") -> int:
        """Keep bytes until the next commit."""
        new = bytes(data)
        # Of two writes at one place the later one counts, also in the order among others.
        old = self._pending.pop(self._at, b"")
        self._pending[self._at] = new + old[len(new) :]
        self._at += len(new)
        self._size = max(self._size, self._at)
        return len(new)

    def truncate(self, size: int) -> int:
        """Its length, from the next commit on."""
        self._size = size
        return size

    def flush(self) -> None:
        """NoArguments: `commit` is what counts."""

    def commit(self, *, closed: bool = False) -> None:
        """Bring everything to the disk; on an error the file there is what it was before, and all of this waits on.

        Parameters
        ----------
        closed : bool
            Whether nobody writes any more: then the file says so, and the bytes are on the disk itself (fsync).

        Raises
        ------
        OSError
            If the disk refuses.
        """
        for place, data in self._sorted(closed=closed):
            _write_all(self._handle, data, place)
        if closed:
            os.ftruncate(self._handle, self._size)
            os.fsync(self._handle)
        self._pending.clear()

    def _sorted(self, *, closed: bool) -> Iterator[tuple[int, bytes]]:
        """What waits, in the order in which a reader beside the writer may meet it; the superblock last."""
        # What lies behind the end was given up by HDF5.
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
