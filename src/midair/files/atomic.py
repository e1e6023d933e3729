"""Files that are whole or not there, and parsers whose complaints become one clear line."""

import errno
import os
import secrets
import shutil
import stat
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Generator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

from midair.errors import BrokenFileError, FileError, MidairError, MissingFileError
from midair.files.file_locks import check_unclaimed

PARSER_FAILURES = (
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    NameError,
    OSError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What the parsers of other libraries raise on damaged bytes; found by the mutation tests."""

SYSTEM_FAILURES = frozenset(
    getattr(errno, name)
    for name in (
        *("EACCES", "EAGAIN", "EBUSY", "EDQUOT", "EIO", "EMFILE", "ENFILE", "ENODEV", "ENOENT", "ENOLCK", "ENOSPC"),
        *("ENOSYS", "ENOTCONN", "ENXIO", "EPERM", "EROFS", "ESTALE", "ETIMEDOUT", "ETXTBSY"),
    )
    if hasattr(errno, name)
)
"""What the system says when the fault is not in the file: of the disk, the network, the rights, the locks."""


def existing_file(path: str | os.PathLike[str], *, empty: bool = False) -> Path:
    """`path` as a Path after checking that a file is there, with something in it unless `empty`.

    Raises
    ------
    MissingFileError
        If nothing has that name.
    BrokenFileError
        If it is a folder, or empty, or must not be read.
    """
    file = Path(path)
    try:
        if not file.exists():
            raise MissingFileError(f"{file}: expected a file, found none; check the name")
        if file.is_dir():
            raise BrokenFileError(f"{file}: expected a file, got a folder; name a file in it")
        # A pipe or a device may never say anything, and never end: it is not even opened.
        if not stat.S_ISREG(file.stat().st_mode):
            raise BrokenFileError(f"{file}: expected a file, got a pipe or a device; write what it gives to a file")
        if file.stat().st_size == 0 and not empty:
            raise BrokenFileError(f"{file}: expected something in it, got an empty file; copy it again")
        with file.open("rb"):
            return file
    except MidairError:
        raise
    except (OSError, ValueError) as wrong:
        raise BrokenFileError(f"{file}: cannot be read: {reason(wrong)}") from wrong


_noting: ContextVar[list[Path] | None] = ContextVar("noting", default=None)


@contextmanager
def files_noted() -> Generator[list[Path]]:
    """Every file that comes to be inside, as it was named, in their order."""
    noted: list[Path] = []
    before = _noting.set(noted)
    try:
        yield noted
    finally:
        _noting.reset(before)


def note_file(path: str | os.PathLike[str]) -> None:
    """Say that a file is there, whole, to whoever notes it."""
    noted = _noting.get()
    if noted is not None and Path(path) not in noted:
        noted.append(Path(path))


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Generator[Path]:
    """A name beside `path` to write to; it becomes `path` when the block ends well and is removed when it does not.

    The bytes are on the disk (fsync) before the name changes (os.replace): whoever looks sees the old file or the new
    one, never half of either. A file that is being recorded is left alone.

    Raises
    ------
    MissingFileError
        If the folder does not exist.
    FileError
        If the file cannot be written, or some program is recording into it.
    """
    target = writable_path(path)
    check_unclaimed(target)
    partial = target.with_name(f".midair-{secrets.token_hex(4)}.part")
    try:
        partial.touch(exist_ok=False)
        yield partial
        _sync(partial)
        check_unclaimed(target)
        os.replace(partial, target)
        note_file(path)
    except MidairError:
        raise
    except (OSError, RuntimeError) as wrong:
        raise FileError(f"{target}: cannot be written: {reason(wrong)}") from wrong
    finally:
        # On a disk that refuses, the reason is on its way already.
        with suppress(OSError):
            partial.unlink(missing_ok=True)


def check_room(folder: Path, needed: int, path: str | os.PathLike[str]) -> None:
    """Raise FileError if the disk of a folder has fewer than `needed` bytes free for the file `path`."""
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise FileError(
            f"{path}: expected {needed / 1e6:.4g} MB free on the disk, got {free / 1e6:.4g} MB; make room, or write "
            "to another disk"
        )


@contextmanager
def whole_folder(path: str | os.PathLike[str]) -> Generator[Path]:
    """A folder beside `path` to fill; it becomes `path` when the block ends well and is removed when it does not.

    Parameters
    ----------
    path : str or PathLike
        A name that nothing has, or of an empty folder; folders above it are made.

    Raises
    ------
    FileError
        If something has the name, or the disk refuses.
    """
    target = Path(path).resolve()
    partial = target.with_name(f".midair-{secrets.token_hex(4)}.part")
    try:
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            raise FileError(f"{target}: expected a new folder, got one that holds something; choose another name")
        partial.mkdir(parents=True)
        yield partial
        for file in partial.rglob("*"):
            if file.is_file():
                _sync(file)
        if target.exists():
            target.rmdir()
        partial.rename(target)
        note_file(path)
    except MidairError:
        raise
    except (OSError, RuntimeError) as wrong:
        raise FileError(f"{target}: cannot be written: {reason(wrong)}") from wrong
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def writable_path(path: str | os.PathLike[str]) -> Path:
    """`path`, links followed, after checking that a file can have that name.

    Raises
    ------
    MissingFileError
        If the folder does not exist.
    BrokenFileError
        If the name is that of a folder.
    """
    try:
        target = Path(path).resolve()
        if not target.parent.is_dir():
            raise MissingFileError(f"{path}: expected the folder {target.parent} to be there; make it first")
        if target.is_dir():
            raise BrokenFileError(f"{path}: expected the name of a file, got that of a folder; name a file in it")
    except (OSError, ValueError) as wrong:
        if isinstance(wrong, MidairError):
            raise
        raise FileError(f"{path}: cannot be written: {reason(wrong)}") from wrong
    return target


@contextmanager
def refusing(path: Path | str, expected: str) -> Generator[None]:
    """Turn what a parser says about damaged bytes into one line that names the file.

    Errors of midair (a NaN, a wrong shape) keep their type, get the file's name if they lack it, and lose what cannot
    be printed: names in damaged files.

    Raises
    ------
    BrokenFileError
        If the block fails to read the file, or the system does not let it.
    FileError
        If what is in it does not fit into memory.
    MidairError
        The leaf that the block raised.
    """
    try:
        yield
    except MidairError as wrong:
        text = "".join(letter if letter.isprintable() else "?" for letter in str(wrong).replace("\n", " "))
        if text == str(wrong) and str(path) in text:
            raise
        raise type(wrong)(text if str(path) in text else f"{path}: {text}") from wrong
    except MemoryError as wrong:
        raise FileError(
            f"{path}: needs more memory than there is ({reason(wrong)}); cut it, or use a computer with more"
        ) from wrong
    except PARSER_FAILURES as wrong:
        if isinstance(wrong, OSError) and wrong.errno in SYSTEM_FAILURES:
            raise BrokenFileError(f"{path}: cannot be read: {os.strerror(wrong.errno or 0)}") from wrong
        raise BrokenFileError(
            f"{path}: expected {expected}, got a damaged or foreign file ({reason(wrong)})"
        ) from wrong


def reason(wrong: BaseException) -> str:
    """The first line of what an exception says, or its type when it says nothing."""
    if isinstance(wrong, OSError) and wrong.strerror:
        return wrong.strerror.splitlines()[0][:160]
    lines = str(wrong).strip().splitlines()
    return lines[0][:160] if lines else type(wrong).__name__


def _sync(path: Path) -> None:
    with path.open("rb+") as file:
        os.fsync(file.fileno())
