"""Atomic writing and locks of files and folders, and conversion of parser errors into one clear message."""

import os
import secrets
import shutil
import warnings
from collections.abc import Generator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from errno import EACCES, EAGAIN, EINVAL, ENOLCK, ENOSYS, ENOTSUP, EOPNOTSUPP
from functools import cache
from pathlib import Path

from rich.filesize import decimal

from midair.errors import BrokenFileError, DeviceStateError, FileError, MidairError, MissingFileError, did_you_mean

try:
    import fcntl
except ImportError:  # Windows, where an open file cannot be replaced anyway
    fcntl = None


class NoLocksWarning(UserWarning):
    """A file system without locks, on which two programs could write to the same file unnoticed."""


_NO_LOCKS = (ENOLCK, ENOTSUP, EOPNOTSUPP, ENOSYS, EINVAL)


def lock_or_raise(handle: int, refusal: str) -> None:
    """Lock an open file or folder until the handle is closed or the process ends.

    On a disk without locks it issues a `NoLocksWarning` and continues. Raises DeviceStateError with the message
    `refusal` if another program holds the lock, and FileError if the lock fails for any other reason.
    """
    if not _locked(handle, refusal.partition(":")[0]):
        raise DeviceStateError(refusal)


def lock_recording(handle: int, path: Path, *, shared: bool = False) -> None:
    """Lock the open file of a recording like `lock_or_raise`; raises FileError if a program is recording into it."""
    if not _locked(handle, path, shared=shared):
        raise FileError(f"{path}: a program is recording into it; wait until it has ended, or end it")


def check_not_recording(path: Path) -> None:
    """Raise FileError if a program is recording into a file that is to be replaced or removed."""
    # Without read permission, the following operation raises the error.
    with suppress(PermissionError):
        if path.is_file():
            with path.open("rb") as file:
                lock_recording(file.fileno(), path, shared=True)


def _locked(handle: int, what: Path | str, *, shared: bool = False) -> bool:
    if fcntl is None:
        return True
    with disk_errors(what, "locked"):
        try:
            fcntl.flock(handle, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except OSError as wrong:
            if wrong.errno not in (EAGAIN, EACCES, *_NO_LOCKS):
                raise
            if wrong.errno not in _NO_LOCKS:
                return False
            _warn_once(
                f"this disk has no locks ({wrong.strerror}): make sure that no two programs write to the same file"
            )
    return True


@cache
def _warn_once(text: str) -> None:
    # Python's own "once" starts again whenever a library changes the warning filters.
    warnings.warn(text, NoLocksWarning, stacklevel=1)


@contextmanager
def disk_errors(path: Path | str | os.PathLike[str], act: str, *more: type[Exception]) -> Generator[None]:
    """Raise errors of the system and of HDF5, and `more`, as FileError; `act` is what failed, such as "written"."""
    try:
        yield
    except MidairError:
        raise
    except (OSError, RuntimeError, *more) as wrong:
        raise (BrokenFileError if act == "read" else FileError)(f"{path}: cannot be {act}: {reason(wrong)}") from wrong


def existing_file(path: str | os.PathLike[str], *, empty: bool = False) -> Path:
    """Return `path` as a Path if it is a readable regular file, not empty unless `empty`; otherwise raise FileError."""
    file = Path(path)
    with disk_errors(file, "read", ValueError):
        if not file.exists():
            near = did_you_mean(file.name, (each.name for each in file.parent.glob("*")))
            raise MissingFileError(f"{file}: no such file{near or '; check the name'}")
        if file.is_dir():
            raise BrokenFileError(f"{file}: expected a file, got a folder; name a file in it")
        # Reading a pipe or a device may block or never end.
        if not file.is_file():
            raise BrokenFileError(f"{file}: expected a file, got a pipe or a device; write its output to a file")
        if file.stat().st_size == 0 and not empty:
            raise BrokenFileError(f"{file}: expected a file with content, got an empty file; copy it again")
        with file.open("rb"):
            return file


_noting: ContextVar[list[Path] | None] = ContextVar("noting", default=None)


@contextmanager
def collect_written_files() -> Generator[list[Path]]:
    """Collect the path of every file that is written inside the block, in order."""
    noted: list[Path] = []
    before = _noting.set(noted)
    try:
        yield noted
    finally:
        _noting.reset(before)


@contextmanager
def atomic_file(path: str | os.PathLike[str], *, recording: bool = False) -> Generator[Path]:
    """Write a file atomically: yields a temporary name beside `path`, which replaces `path` if the block succeeds.

    The data are on the disk (fsync) before the file is renamed (os.replace): other programs see the old file or the new
    one, never a part. A file that is being recorded is replaced only with `recording`, by its recorder. On failure the
    temporary file is deleted. Raises MissingFileError if the folder does not exist; FileError if the file cannot be
    written, or a program is recording into it.
    """
    target = writable_path(path)
    if not recording:
        check_not_recording(target)
    with _beside(target, path) as partial:
        partial.touch(exist_ok=False)
        yield partial
        sync(partial)
        if not recording:
            check_not_recording(target)
        os.replace(partial, target)


@contextmanager
def _beside(target: Path, named: str | os.PathLike[str]) -> Generator[Path]:
    """A temporary name beside `target`, which the block replaces; what is left of it is removed."""
    partial = target.with_name(f".midair-{secrets.token_hex(4)}.part")
    try:
        with disk_errors(target, "written"):
            yield partial
        noted = _noting.get()
        if noted is not None and Path(named) not in noted:
            noted.append(Path(named))
    finally:
        # If the disk fails, the reason has been raised already.
        with suppress(OSError):
            shutil.rmtree(partial, ignore_errors=True) if partial.is_dir() else partial.unlink(missing_ok=True)


def write_file(path: str | os.PathLike[str], content: str | bytes, *, private: bool = False) -> None:
    """Write bytes, or text in UTF-8, as `atomic_file` does; only the owner can read a `private` file."""
    with atomic_file(path) as partial:
        if private:
            partial.chmod(0o600)
        partial.write_bytes(content if isinstance(content, bytes) else content.encode())


def check_disk_space(folder: Path, needed: int, path: str | os.PathLike[str]) -> None:
    """Raise FileError if the disk of a folder has fewer than `needed` bytes free for the file `path`."""
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise FileError(f"{path}: needs {decimal(needed)} on the disk, {decimal(free)} are free; use another")


@contextmanager
def atomic_folder(path: str | os.PathLike[str]) -> Generator[Path]:
    """Write a folder atomically: yields a temporary folder, which is renamed to `path` if the block succeeds.

    `path` must be new or an empty folder; parent folders are created. Raises FileError if `path` exists and is not an
    empty folder, or cannot be written.
    """
    target = Path(path).resolve()
    with _beside(target, path) as partial:
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            raise FileError(f"{target}: expected a new folder, got one that is not empty; choose another name")
        partial.mkdir(parents=True)
        yield partial
        for file in partial.rglob("*"):
            if file.is_file():
                sync(file)
        if target.exists():
            target.rmdir()
        partial.rename(target)


def writable_path(path: str | os.PathLike[str]) -> Path:
    """Return `path` with links resolved, if a file can have that name.

    Raises MissingFileError without a folder, FileError if it is read-only, BrokenFileError for the name of a folder.
    """
    with disk_errors(path, "written", ValueError):
        target = Path(path).resolve()
        if not target.parent.is_dir():
            raise MissingFileError(f"{path}: expected the folder {target.parent}, found none; create it first")
        if target.is_dir():
            raise BrokenFileError(f"{path}: expected the name of a file, got that of a folder; name a file in it")
        if not os.access(target.parent, os.W_OK):
            raise FileError(f"{path}: cannot be written: the folder is read-only; use another one")
        return target


@contextmanager
def parse_errors(path: str | os.PathLike[str], expected: str) -> Generator[None]:
    """Convert errors of a parser into one message that names the file; `expected` completes "expected ...".

    Errors of midair (a NaN, a wrong shape) get the file's name if they lack it, and lose unprintable characters, which
    can come from names in damaged files. Raises BrokenFileError if the file cannot be parsed or read,
    FileError if its content does not fit into memory.
    """
    try:
        yield
    except MidairError as wrong:
        first = wrong
        while first.args and isinstance(first.args[0], MidairError):
            first = first.args[0]
        said = "".join(letter if letter.isprintable() else "?" for letter in str(first.args[0]).replace("\n", " "))
        first.args = (said if str(path) in said else f"{path}: {said}",)
        raise
    except MemoryError as wrong:
        raise FileError(
            f"{path}: needs more memory than available ({reason(wrong)}); cut it, or use a computer with more"
        ) from wrong
    except Exception as wrong:
        # A parser that seeks to a wrong place gets EINVAL: the file is damaged, not the disk.
        if isinstance(wrong, OSError) and wrong.errno not in (None, EINVAL):
            raise BrokenFileError(f"{path}: cannot be read: {os.strerror(wrong.errno)}") from wrong
        raise BrokenFileError(
            f"{path}: expected {expected}, got a damaged or foreign file ({reason(wrong)})"
        ) from wrong


def reason(wrong: BaseException) -> str:
    """First line of an exception's message, or its type if it has none."""
    said = wrong.strerror if isinstance(wrong, OSError) and wrong.strerror else str(wrong)
    return (said.strip().splitlines() or [type(wrong).__name__])[0][:160]


def sync(path: Path) -> None:
    """Wait until a file is on the disk."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())
