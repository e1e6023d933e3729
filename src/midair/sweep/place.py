"""Where a sweep is stored: a folder, or a prefix of an object store that fsspec reaches."""

import os
import secrets
import shutil
import sys
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from midair.errors import BrokenFileError, FileError, InputError, MidairError, MissingExtraError
from midair.files import hold_open, refusing, writable_path


class SweepPlace(Protocol):
    """A place that one sweep has for itself."""

    @property
    def name(self) -> str:
        """The same place, as another process would name it."""
        ...

    def exists(self) -> bool:
        """Whether anything is there."""
        ...

    def create(self, fill: Callable[[Any], None]) -> None:
        """Let `fill` make a Zarr group there, or go on with making it: it is given the place as Zarr names it."""
        ...

    def group(self, mode: str) -> Any:
        """The Zarr group that is there."""
        ...

    def chunks(self, array: str) -> set[tuple[int, int]]:
        """Row and column of every chunk of an array that was written; one listing, however many there could be."""
        ...

    def alone(self) -> Any:
        """Keep other commands out, where the place can."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepFolder:
    """A folder of this machine, or of a disk that machines share."""

    path: Path

    def __str__(self) -> str:
        return str(self.path)

    @property
    def name(self) -> str:
        """Absolute."""
        return str(self.path.resolve())

    def exists(self) -> bool:
        """Whether anything has this name."""
        return self.path.exists()

    def create(self, fill: Callable[[Any], None]) -> None:
        """Make the store beside `path` and rename it when it is whole.

        Raises
        ------
        FileError
            If the disk refuses.
        """
        path = writable_path(self.path)
        partial = path.with_name(f".midair-{secrets.token_hex(4)}.part")
        try:
            fill(str(partial))
            with suppress(OSError):  # another program was first: its store is checked like any other
                partial.rename(path)
        except MidairError:
            raise
        except OSError as wrong:
            # Not by the name that it has until it is whole.
            raise FileError(f"{self}: cannot be written: {wrong.strerror or wrong}") from wrong
        finally:
            shutil.rmtree(partial, ignore_errors=True)

    def group(self, mode: str) -> Any:
        """The Zarr group in this folder."""
        if not self.path.is_dir():
            raise BrokenFileError(f"{self}: expected a sweep, which is a folder, got a file; use another name")
        with refusing(self.path, "a sweep of midair"):
            return zarr().open_group(self.path, mode=mode, zarr_format=3, use_consolidated=False)

    def chunks(self, array: str) -> set[tuple[int, int]]:
        """From the names of the files."""
        return _numbers(file.relative_to(self.path).parts for file in (self.path / array / "c").glob("*/*"))

    @contextmanager
    def alone(self) -> Generator[None]:
        """Hold the folder where the system can; the lock goes with the process, however it dies."""
        if sys.platform == "win32":  # which opens no folders
            yield
            return
        held = os.open(self.path, os.O_RDONLY)
        try:
            hold_open(held, f"{self}: another program is writing to this sweep; wait for it")
            yield
        finally:
            os.close(held)


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepBucket:
    """A prefix in an object store, such as s3://bucket/all.zarr, with the rights that fsspec finds by itself.

    Object stores know no locks and no renaming. Two commands may write to one sweep: both write the same, since a task
    has objects of its own and comes out the same whoever does it.
    """

    url: str

    def __str__(self) -> str:
        return self.url

    @property
    def name(self) -> str:
        """The address as it was typed."""
        return self.url

    def exists(self) -> bool:
        """Whether anything has this prefix."""
        with self._reached() as (files, root):
            return bool(files.exists(root))

    def create(self, fill: Callable[[Any], None]) -> None:
        """Make the store in place; `fill` goes on where it was interrupted."""
        with self._reached():
            fill(self.url)

    def group(self, mode: str) -> Any:
        """The Zarr group of this prefix."""
        with self._reached(), refusing(self.url, "a sweep of midair"):
            return zarr().open_group(self.url, mode=mode, zarr_format=3, use_consolidated=False)

    def chunks(self, array: str) -> set[tuple[int, int]]:
        """From the names of the objects."""
        with self._reached() as (files, root):
            return _numbers(name.removeprefix(root).strip("/").split("/") for name in files.find(f"{root}/{array}/c"))

    @contextmanager
    def alone(self) -> Generator[None]:
        """NoArguments: see the class."""
        yield

    @contextmanager
    def _reached(self) -> Generator[tuple[Any, str]]:
        """The file system of the address and the path in it; what goes wrong with either is one line."""
        import fsspec

        try:
            files, root = fsspec.url_to_fs(self.url)
        except ImportError as missing:
            raise MissingExtraError(f"{self}: expected a package that is not installed: {missing}") from missing
        except ValueError as wrong:
            raise InputError(f"{self}: expected a folder or an address that fsspec knows: {wrong}") from wrong
        try:
            # What was listed before may have been changed by other machines.
            files.invalidate_cache()
            yield files, root
        except OSError as wrong:
            raise FileError(f"{self}: cannot be reached: {wrong}") from wrong


def place_of(where: Path | str) -> SweepPlace:
    """The folder or the prefix that a person names; ``file://`` is a folder."""
    text = str(where)
    if isinstance(where, Path) or "://" not in text:
        return SweepFolder(path=Path(where))
    if text.startswith("file://"):
        return SweepFolder(path=Path(text.removeprefix("file://")))
    return SweepBucket(url=text.rstrip("/"))


def zarr() -> Any:
    """The library.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        import zarr
    except ImportError as missing:
        raise MissingExtraError(
            "sweep: expected zarr, which is not installed; pip install 'midair[sweep]'"
        ) from missing
    return zarr


def _numbers(names: Iterable[Iterable[str]]) -> set[tuple[int, int]]:
    """Chunk keys as numbers; what is no key (a file that was being written in a crash) does not count."""
    ends = (tuple(parts)[-2:] for parts in names)
    return {(int(end[0]), int(end[1])) for end in ends if all(part.isdecimal() for part in end)}
