"""Parts of a sweep, divided into tasks; its storage: a folder, or a prefix of an object store that fsspec supports."""

import json
import os
import secrets
import shutil
import sys
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import BrokenFileError, FileError, InputError, MidairError, MissingExtraError
from midair.files import lock_or_raise, parse_errors, writable_path


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """Items `first` to `last` - 1 of one condition, solved together."""

    condition: int
    first: int
    last: int

    @property
    def count(self) -> int:
        """Number of items."""
        return self.last - self.first


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """Result of a job: E with exact and with rounded phases, shape (item,), and the strength of the targets."""

    error: Array
    rounded_error: Array
    strength: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """Result of a task with its processor time in s; `found` is None if the worker has stored it."""

    task: Task
    found: Found | None
    seconds: float


Job = Callable[[], Found]
"""A task with all its data; it is sent to a worker and called there."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coordinate:
    """Array along axes of the results, stored as `name`; `axes` are ``condition``, the name of the items, or both."""

    name: str
    axes: tuple[str, ...]
    values: NDArray[Any]
    attributes: Mapping[str, Any]


def settings_of(thing: Any) -> Any:
    """Convert a dataclass of settings to JSON values; other types than those of JSON become strings."""
    return json.loads(json.dumps(asdict(thing), default=str))


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepFolder:
    """A folder on this machine or on a shared disk."""

    path: Path

    def __str__(self) -> str:
        return str(self.path)

    @property
    def name(self) -> str:
        """Absolute path, for other processes."""
        return str(self.path.resolve())

    def exists(self) -> bool:
        """True if a file or folder has this name."""
        return self.path.exists()

    def create(self, fill: Callable[[Any], None]) -> None:
        """Create the store beside `path` and rename it when complete; `fill` gets the location in Zarr's notation."""
        path = writable_path(self.path)
        partial = path.with_name(f".midair-{secrets.token_hex(4)}.part")
        try:
            fill(str(partial))
            with suppress(OSError):  # another program was first; its store is checked afterwards
                partial.rename(path)
        except MidairError:
            raise
        except OSError as wrong:
            # Name the final path instead of the temporary one.
            raise FileError(f"{self}: cannot be written: {wrong.strerror or wrong}") from wrong
        finally:
            shutil.rmtree(partial, ignore_errors=True)

    def group(self, mode: str) -> Any:
        """Open the Zarr group in this folder."""
        if not self.path.is_dir():
            raise BrokenFileError(f"{self}: expected a sweep, which is a folder, got a file; use another name")
        with parse_errors(self.path, "a sweep of midair"):
            return sweep_package("zarr").open_group(self.path, mode=mode, zarr_format=3, use_consolidated=False)

    def chunks(self, array: str) -> set[tuple[int, int]]:
        """Row and column of every written chunk, from the file names."""
        return _numbers(file.relative_to(self.path).parts for file in (self.path / array / "c").glob("*/*"))

    def layout(self, array: str) -> bytes:
        """Content of the zarr.json of an array."""
        return (self.path / array / "zarr.json").read_bytes()

    @contextmanager
    def alone(self) -> Generator[None]:
        """Lock the folder if the system supports it; the lock ends with the process."""
        if sys.platform == "win32":  # folders cannot be opened there
            yield
            return
        held = os.open(self.path, os.O_RDONLY)
        try:
            lock_or_raise(held, f"{self}: another program is writing to this sweep; wait for it")
            yield
        finally:
            os.close(held)


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepBucket:
    """A prefix in an object store, such as s3://bucket/all.zarr, with the credentials that fsspec finds.

    Object stores have neither locks nor renaming. Two commands may write to one sweep: every task has its own objects,
    and both commands write the same values.
    """

    url: str

    def __str__(self) -> str:
        return self.url

    @property
    def name(self) -> str:
        """Address as it was typed, for other processes."""
        return self.url

    def exists(self) -> bool:
        """True if any object has this prefix."""
        with self._reached() as (files, root):
            return bool(files.exists(root))

    def create(self, fill: Callable[[Any], None]) -> None:
        """Create the store in place; `fill` completes an interrupted one."""
        with self._reached():
            fill(self.url)

    def group(self, mode: str) -> Any:
        """Open the Zarr group of this prefix."""
        with self._reached(), parse_errors(self.url, "a sweep of midair"):
            return sweep_package("zarr").open_group(self.url, mode=mode, zarr_format=3, use_consolidated=False)

    def chunks(self, array: str) -> set[tuple[int, int]]:
        """Row and column of every written chunk, from the object names."""
        with self._reached() as (files, root):
            return _numbers(name.removeprefix(root).strip("/").split("/") for name in files.find(f"{root}/{array}/c"))

    def layout(self, array: str) -> bytes:
        """Content of the zarr.json of an array."""
        with self._reached() as (files, root):
            return bytes(files.cat_file(f"{root}/{array}/zarr.json"))

    @contextmanager
    def alone(self) -> Generator[None]:
        """Do nothing, because object stores have no locks."""
        yield

    @contextmanager
    def _reached(self) -> Generator[tuple[Any, str]]:
        """File system of the address and the path in it; errors of both become one line."""
        import fsspec

        try:
            files, root = fsspec.url_to_fs(self.url)
        except ImportError as missing:
            raise MissingExtraError(f"{self}: expected a package that is not installed: {missing}") from missing
        except ValueError as wrong:
            raise InputError(f"{self}: expected a folder or an address that fsspec supports: {wrong}") from wrong
        try:
            # Other machines may have changed the listing since.
            files.invalidate_cache()
            yield files, root
        except OSError as wrong:
            raise FileError(f"{self}: cannot be reached: {wrong}") from wrong


SweepStorage = SweepFolder | SweepBucket


def storage_of(where: Path | str) -> SweepStorage:
    """Return the storage for a path or an address; ``file://`` is a folder."""
    text = str(where)
    if isinstance(where, Path) or "://" not in text:
        return SweepFolder(path=Path(where))
    if text.startswith("file://"):
        return SweepFolder(path=Path(text.removeprefix("file://")))
    return SweepBucket(url=text.rstrip("/"))


def sweep_package(name: str) -> Any:
    """Import a package of the extra sweep; raise a MissingExtraError if it is not installed."""
    try:
        return import_module(name)
    except ImportError as missing:
        raise MissingExtraError(
            f"sweep: expected {name}, which is not installed; pip install 'midair[sweep]'"
        ) from missing


def _numbers(names: Iterable[Iterable[str]]) -> set[tuple[int, int]]:
    """Numbers of chunk keys; other names (files that a crash left incomplete) are ignored."""
    ends = (tuple(parts)[-2:] for parts in names)
    return {(int(end[0]), int(end[1])) for end in ends if all(part.isdecimal() for part in end)}
