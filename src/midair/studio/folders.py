"""The only folder that a studio reads and writes, from which no name leads out; the temporary folder of a session."""

import os
import re
import shutil
import tempfile
import time
import unicodedata
import zipfile
from collections import Counter
from collections.abc import AsyncIterator, Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePath, PurePosixPath

from midair.errors import DeviceStateError, InputError, MissingFileError
from midair.files import FORMATS, atomic_file, check_expansion, lock_or_raise, parse_errors
from midair.studio.jobs import Progressed

BIN, EXPORTS = "bin", "exports"
"""Folders, in the studio's, of takes that were deleted and of files that were exported."""

LARGEST, PROJECT = 256 * 2**20, 4 * 2**30
"""Largest recording that is uploaded and largest project, packed or not, in bytes."""

PROJECT_FILES = 10_000
"""Largest number of files of a project."""

READABLE = (*FORMATS, ".zip")
"""Endings of files that may be uploaded: recordings, and a project."""

_OF_PROJECTS = (*FORMATS, ".json", ".html", ".toml", ".jsonl", ".tsv", ".md", ".gif", ".mp4", ".adaptics")
"""Endings of a project's files, besides the pictures and sounds of studies."""


@dataclass(frozen=True, slots=True)
class StudioFolder:
    """A folder (absolute, links resolved) whose files have names relative to it."""

    path: Path

    @classmethod
    def at(cls, path: Path) -> "StudioFolder":
        """Return the folder at a path, made if its parent exists; InputError for a file, MissingFileError otherwise."""
        if path.exists() and not path.is_dir():
            raise InputError(f"{path}: expected a folder, got a file; open its folder: midair studio {path.parent}")
        if not path.parent.is_dir():
            raise MissingFileError(f"{path}: expected the folder {path.parent}, found none; make it first")
        path.mkdir(exist_ok=True)
        return cls(path.resolve())

    def find(self, name: str) -> Path:
        """Return the path of an existing file or folder; InputError as `place`, MissingFileError if there is none."""
        path = self.place(name)
        if not path.exists():
            raise MissingFileError(f"{name}: expected a file in {self.path}, found none")
        return path

    def place(self, name: str) -> Path:
        """Return the path of a name, existing or not.

        InputError if the name leads out of the folder (by .., an absolute path or a link) or has a forbidden character.
        """
        if not name or len(name) > 1000 or any(ord(letter) < 32 for letter in name) or "\\" in name or ":" in name:
            raise InputError(
                "name: expected the name of a file in the studio's folder, got one with forbidden characters"
            )
        if name.startswith("/") or any(part in ("..", ".", "") for part in name.split("/")):
            raise InputError(f"{name}: expected a name inside the studio's folder, got one that leads out of it")
        # Links are resolved first, so that a link cannot lead out of the folder.
        path = Path(os.path.realpath(self.path / name))
        if not path.is_relative_to(self.path):
            raise InputError(f"{name}: expected a name inside the studio's folder, got one that leads out of it")
        return path

    def name_of(self, path: Path) -> str:
        """Name of a path in the folder."""
        return path.relative_to(self.path).as_posix()

    def names(self, ending: str) -> list[str]:
        """Names of the files with an ending, newest first, without hidden ones and links that lead out."""
        return [name for name in self.stamps() if name.endswith(ending)]

    def stamps(self, *, within: bool = False) -> dict[str, str]:
        """Modification time of each file as in `take_data.stamp_of`, newest first; hidden ones are left out.

        With `within`, also of the files in its folders, except the bin, exports and studies.
        """
        found: list[tuple[int, str]] = []
        with os.scandir(self.path) as listed:
            inner = [one.name for one in listed if within and one.is_dir(follow_symlinks=False)]
        inner = [name for name in inner if name not in (BIN, EXPORTS) and not (self.path / name / "plan.json").exists()]
        for folder in ("", *(f"{name}/" for name in inner if not name.startswith("."))):
            with suppress(OSError), os.scandir(self.path / folder) as listed:
                for one in (one for one in listed if not one.name.startswith(".")):
                    with suppress(OSError, InputError):  # a link that leads out or nowhere
                        if one.is_file() and (not one.is_symlink() or self.place(folder + one.name)):
                            found.append((one.stat().st_mtime_ns, folder + one.name))
        return {name: f"{time_ns:x}" for time_ns, name in sorted(found, reverse=True)}

    def free(self, stem: str, ending: str) -> Path:
        """Return a path of a name that a page sent, with a number if that of a file or of those beside one is taken."""
        plain = re.sub(r" *[^\w -]+", "_", unicodedata.normalize("NFC", stem)).strip("_ -")[:60] or "recording"
        own, number = plain, 0
        while (self.path / own).exists() or any(self.path.glob(f"{own}.*")):
            number += 1
            own = f"{re.sub(r'-[0-9][0-9]$', '', plain)}-{number:02d}"
        return self.path / (own + ending)

    async def receive(self, name: str, parts: AsyncIterator[bytes], *, largest: int | None = None) -> Path:
        """Write an upload under a new name; InputError, and no file, if it is too large or not a recording."""
        ending = Path(name).suffix.lower()
        if ending not in READABLE:
            raise InputError(f"upload: expected a recording or project ({' '.join(READABLE)}), got {ending or 'none'}")
        path = self.free(Path(name).stem, ending)
        size, largest = 0, largest or (PROJECT if ending == ".zip" else LARGEST)
        with atomic_file(path) as partial, partial.open("wb") as file:
            async for part in parts:
                size += len(part)
                if size > largest:
                    raise InputError(
                        f"upload: expected at most {largest >> 20} MiB, got more; copy it into {self.path}"
                    )
                file.write(part)
        return path


def pack_folder(target: str, progress: Progressed) -> str:
    """Write the files of a studio's folder that a project can have into a ZIP file in `exports`, without the bin."""
    folder = Path(target).parents[1]
    named = {path: path.relative_to(folder) for path in sorted(folder.rglob("*")) if path.is_file()}
    kept = [path for path, name in named.items() if name.parts[0] not in (BIN, EXPORTS) and _in_projects(name)]
    _check_size(len(kept), sum(path.stat().st_size for path in kept))
    with atomic_file(target) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive:
        for number, path in enumerate(kept):
            progress("packing", number, len(kept))
            archive.write(path, named[path])
    return target


def unpack_folder(order: tuple[str, str], progress: Progressed) -> None:
    """Write the files of such a ZIP file into a studio's folder, all or none.

    Raises InputError if a name leads out, exists or is not one of a project's files, or if the project or the disk has
    the wrong size, and BrokenFileError if it is damaged.
    """
    source, folder = Path(order[0]), StudioFolder(Path(order[1]))
    with parse_errors(source, "a project"), zipfile.ZipFile(source) as archive:
        files = [one for one in archive.infolist() if not one.is_dir()]
        size, free = sum(one.file_size for one in files), shutil.disk_usage(folder.path).free
        _check_size(len(files), size)
        check_expansion(source, size)
        paths = [folder.place(one.filename) for one in files]
        foreign = next((one.filename for one in files if not _in_projects(PurePosixPath(one.filename))), None)
        if foreign is not None:
            raise InputError(
                "project: expected recordings, drives, and studies with their tables, pictures and sounds, got "
                f"{foreign!r}; make a project without it"
            )
        taken = [
            path.name
            for path, count in Counter(paths).items()
            if count > 1 or path.exists() or any(parent.is_file() for parent in path.parents)
        ]
        if taken or size > free:
            what = (
                f"{taken[0]}, which exists already" if taken else f"{size / 1e6:.3g} MB for {free / 1e6:.3g} MB of disk"
            )
            raise InputError(f"project: expected free names and room for its files, got {what}; open another folder")
        with tempfile.TemporaryDirectory(prefix=".unpacking-", dir=folder.path) as place:
            for number, one in enumerate(files):
                progress("unpacking", number, len(files))
                archive.extract(one, place)
            for one, path in zip(files, paths, strict=True):
                path.parent.mkdir(parents=True, exist_ok=True)
                Path(place, one.filename).rename(path)


def _in_projects(name: PurePath) -> bool:
    """True if a project can have a file of this name: of a known kind, and not hidden."""
    # A worker process that reads takes does not need studies.
    from midair.study import media_type

    known = name.suffix.lower() in _OF_PROJECTS or media_type(name) or name.name == "README"
    return bool(known) and not any(part.startswith(".") for part in name.parts)


def _check_size(files: int, size: int) -> None:
    if files > PROJECT_FILES or size > PROJECT:
        raise InputError(
            f"project: expected at most {PROJECT >> 30} GiB in {PROJECT_FILES} files, got {size / 2**30:.1f} GiB in "
            f"{files}; copy the folder itself"
        )


PREFIX = "midair-studio-"
_HELD = "held"
"""File that the studio locks; the operating system releases the lock when the process ends."""

_YOUNG = 60.0
"""Seconds for which a folder without that file may belong to a studio that is starting."""


@contextmanager
def folder_of_session(where: Path | None = None) -> Generator[Path]:
    """Make a folder in `where` (by default the system's temporary folder); remove those of dead studios."""
    place = where or Path(tempfile.gettempdir())
    sweep(place)
    with tempfile.TemporaryDirectory(prefix=PREFIX, dir=place, ignore_cleanup_errors=True) as name:
        made, folder = Path(name) / f".{_HELD}", Path(name)
        handle = os.open(made, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            lock_or_raise(handle, f"{folder}: expected to lock it")
            # The file gets its name after it is locked, so that no other process finds it unlocked.
            made.rename(folder / _HELD)
            yield folder
        finally:
            os.close(handle)


def sweep(place: Path) -> list[Path]:
    """Remove the folders of dead studios of this user; returns those removed."""
    gone: list[Path] = []
    user = os.getuid() if hasattr(os, "getuid") else 0  # as st_uid is on Windows
    for folder in place.glob(f"{PREFIX}*"):
        # Another process may own this folder or be removing it too.
        with suppress(OSError, DeviceStateError):
            if not folder.is_symlink() and folder.is_dir() and folder.stat().st_uid == user and _left(folder):
                shutil.rmtree(folder)
                gone.append(folder)
    return gone


def _left(folder: Path) -> bool:
    """True if no process holds the lock; DeviceStateError or OSError otherwise."""
    held = folder / _HELD
    if not held.exists():
        return time.time_ns() / 1e9 - folder.stat().st_mtime > _YOUNG  # noqa: TID251  # compared with a file's time
    handle = os.open(held, os.O_RDWR)
    try:
        lock_or_raise(handle, f"{folder}: in use by a studio")
    finally:
        os.close(handle)
    # Without such locks, as on Windows, an open file cannot be removed.
    held.unlink()
    return True
