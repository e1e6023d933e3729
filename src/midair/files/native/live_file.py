"""File of a running recording, which has its name only when it can be opened, and is locked until it is closed."""

import os
import secrets
import shutil
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from midair.errors import FileError
from midair.files.atomic import reason
from midair.files.file_locks import acquire_for_writing
from midair.files.native.atomic_hdf5 import AtomicHdf5File
from midair.files.native.hdf5 import LAYOUT
from midair.files.native.hdf5_recovery import flagged_block

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
        _take_name(partial, path)
    except FileExistsError as wrong:
        raise FileError(f"{path}: the file exists already; record under another name") from wrong
    except OSError as wrong:
        raise FileError(f"{path}: cannot be written: {reason(wrong)}") from wrong
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)


def _take_name(partial: Path, path: Path) -> None:
    """Rename a file without replacing another: creating a hard link fails if the name exists, renaming does not."""
    try:
        os.link(partial, path)
    except FileExistsError:
        raise
    except OSError:  # a disk without links: create an empty file of that name, then replace it
        path.touch(exist_ok=False)
        os.replace(partial, path)
