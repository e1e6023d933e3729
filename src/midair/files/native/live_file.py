"""File of a running recording: complete commits of HDF5, a name of its own, and a lock until it is closed.

HDF5 does not handle failed writes: it loses rows without an error, or crashes. Its writes are therefore kept in memory
until `commit` writes them to the disk: first the data, then the metadata that point to them, then the metadata with
their number. If the program is killed or the disk fails at any time, the file contains the last complete commit, and a
concurrent reader (SWMR) never sees an unfinished one.
"""

import os
import secrets
import shutil
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from midair.errors import FileError
from midair.files.atomic import acquire_for_writing, reason
from midair.files.native.hdf5 import LAYOUT
from midair.files.native.hdf5_recovery import LENGTH, flagged_block

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer, WriteableBuffer


_BINARY = getattr(os, "O_BINARY", 0)


class LiveFile:
    """A new HDF5 file with initial content `image` and growing datasets; only complete commits are on the disk."""

    def __init__(self, path: Path, image: bytes) -> None:
        import h5py

        with _new_name(path) as partial:
            partial.write_bytes(flagged_block(image, written=True))
        self.path = path
        try:
            self._handle = os.open(path, os.O_RDWR | _BINARY)
        except OSError as wrong:
            raise FileError(f"{path}: cannot be written: {reason(wrong)}") from wrong
        acquire_for_writing(self._handle, path)
        self._bytes = AtomicHdf5File(self._handle)
        self.file = h5py.File(self._bytes, "r+", libver=LAYOUT)

    def commit(self) -> None:
        """Write all changes to the disk; after an OSError the file still has its previous content."""
        self.file.flush()
        self._bytes.commit()

    def close(self) -> None:
        """Close the file and flush it to the device; FileError if another program renamed, replaced or removed it."""
        try:
            self.file.close()
            self._bytes.commit(closed=True)
            self._check_name()
        finally:
            os.close(self._handle)

    def _check_name(self) -> None:
        """Check that the path still refers to this file; an unlinked file is saved under a new name."""
        mine = os.fstat(self._handle)
        if self.path.exists() and os.path.samestat(mine, self.path.stat()):
            return
        if mine.st_nlink:
            raise FileError(f"{self.path}: the file was renamed during the recording; it is complete")
        rescued = self.path.with_name(f"{self.path.stem}-rescued-{secrets.token_hex(2)}{self.path.suffix}")
        os.lseek(self._handle, 0, os.SEEK_SET)
        with os.fdopen(os.dup(self._handle), "rb") as source, rescued.open("xb") as target:
            shutil.copyfileobj(source, target)
        raise FileError(
            f"{self.path}: the file was replaced or removed during the recording; the recording is in {rescued}"
        )


@contextmanager
def _new_name(path: Path) -> Generator[Path]:
    """Yield a temporary name, which becomes `path` if the block succeeds, so that a file of that name can be opened."""
    partial = path.with_name(f".midair-{secrets.token_hex(4)}.part")
    try:
        if path.exists():
            raise FileExistsError
        yield partial
        try:
            # Without replacing another file: creating a hard link fails if the name exists, renaming does not.
            os.link(partial, path)
        except FileExistsError:
            raise
        except OSError:  # a disk without links: create an empty file of that name, then replace it
            path.touch(exist_ok=False)
            os.replace(partial, path)
    except FileExistsError as wrong:
        raise FileError(f"{path}: the file exists already; record under another name") from wrong
    except OSError as wrong:
        raise FileError(f"{path}: cannot be written: {reason(wrong)}") from wrong
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)


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
        """Write all buffered data, with `closed` to the device; after an OSError the file is unchanged for readers."""
        # HDF5 has discarded data beyond the end. The order is safe for a concurrent reader; the superblock is last.
        inside = [(place, data) for place, data in self._pending.items() if 0 < place < self._size]
        for place, data in sorted(inside, key=lambda each: _ORDER.index(each[1][:4]) if each[1][:4] in _ORDER else -1):
            self._write_all(data, place)
        if closed or 0 in self._pending:
            os.lseek(self._handle, 0, os.SEEK_SET)
            block = self._pending.get(0) or os.read(self._handle, LENGTH)
            self._write_all(flagged_block(block, written=not closed), 0)
        if closed:
            os.ftruncate(self._handle, self._size)
            os.fsync(self._handle)
        self._pending.clear()

    def _write_all(self, data: bytes, place: int) -> None:
        os.lseek(self._handle, place, os.SEEK_SET)
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(self._handle, rest) :]
