"""The file of a recording that runs: it has its name once it can be opened, and is claimed until it is closed."""

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
    """An HDF5 file in which rows can grow, and in which nothing is on the disk that is not whole.

    Parameters
    ----------
    path : Path
        The file to make.
    image : bytes
        What it holds at first.

    Raises
    ------
    FileError
        If the name is taken, or the disk refuses.
    """

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
        """Bring what was written to the disk; on an error it holds what it held before.

        Raises
        ------
        OSError
            If the disk refuses.
        """
        self.file.flush()
        self._bytes.commit()

    def close(self) -> None:
        """Close the file in order, on the disk itself.

        Raises
        ------
        OSError
            If the disk refuses; then it holds what it held before, like the file of a program that was killed.
        FileError
            If somebody gave the name to another file, or removed it.
        """
        try:
            self.file.close()
            self._bytes.commit(closed=True)
            self._check_name()
        finally:
            os.close(self._handle)

    def _check_name(self) -> None:
        """That the name still leads here; what lost its last name gets a new one."""
        mine = os.fstat(self._handle)
        if self.path.exists() and os.path.samestat(mine, self.path.stat()):
            return
        if mine.st_nlink:
            raise FileError(f"{self.path}: somebody renamed the file while it was recorded; all of it is there")
        rescued = self.path.with_name(f"{self.path.stem}-rescued-{secrets.token_hex(2)}{self.path.suffix}")
        os.lseek(self._handle, 0, os.SEEK_SET)
        with os.fdopen(os.dup(self._handle), "rb") as source, rescued.open("xb") as target:
            shutil.copyfileobj(source, target)
        raise FileError(
            f"{self.path}: somebody replaced or removed the file while it was recorded; the recording is in {rescued}"
        )


@contextmanager
def _new_name(path: Path) -> Generator[Path]:
    """A name beside `path` to write to, which becomes `path` when the block ends well, unless somebody has that name.

    So a file with the recording's name is one that opens, however early the program is killed.
    """
    partial = path.with_name(f".midair-{secrets.token_hex(4)}.part")
    try:
        if path.exists():
            raise FileExistsError
        yield partial
        _take_name(partial, path)
    except FileExistsError as wrong:
        raise FileError(f"{path}: a file is there already; record under another name") from wrong
    except OSError as wrong:
        raise FileError(f"{path}: cannot be written: {reason(wrong)}") from wrong
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)


def _take_name(partial: Path, path: Path) -> None:
    """Give a file its name; a link fails where the name is taken, which a change of name does not."""
    try:
        os.link(partial, path)
    except FileExistsError:
        raise
    except OSError:  # a disk without links: claim the name, then replace what claims it
        path.touch(exist_ok=False)
        os.replace(partial, path)
