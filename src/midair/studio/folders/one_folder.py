"""The one folder that a studio reads and writes: names that lead out of it are refused, whoever sends them."""

import os
import re
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path

from midair.errors import InputError, MissingFileError
from midair.files import whole_file
from midair.rig import Subject

LARGEST = 256 * 2**20
"""Bytes of an upload, at most."""

READABLE = (".h5", ".csv", ".wav", ".mat", ".npz", ".npy", ".json", ".html")
"""Endings of what may come in or go out."""


@dataclass(frozen=True, slots=True)
class OneFolder:
    """A folder and what is in it, by names relative to it.

    Attributes
    ----------
    path : Path
        Absolute, with links resolved.
    """

    path: Path

    @classmethod
    def at(cls, path: Path) -> "OneFolder":
        """The folder at a path.

        Raises
        ------
        MissingFileError
            If there is none.
        """
        if not path.is_dir():
            raise MissingFileError(f"{path}: expected a folder, found none; make it first")
        return cls(path.resolve())

    def find(self, name: str) -> Path:
        """A file or folder that is there.

        Raises
        ------
        InputError
            If the name leads out of the folder: by .., from the root, through a link, or with a character that no name
            has.
        MissingFileError
            If there is nothing of this name.
        """
        path = self.place(name)
        if not path.exists():
            raise MissingFileError(f"{name}: expected a file in {self.path}, found none")
        return path

    def place(self, name: str) -> Path:
        """Where something of this name is, or would be.

        Raises
        ------
        InputError
            As `find`.
        """
        if not name or len(name) > 1000 or any(ord(letter) < 32 for letter in name) or "\\" in name or ":" in name:
            raise InputError("name: expected one of a file in the studio's folder, got one with letters that none has")
        if name.startswith("/") or any(part in ("..", ".", "") for part in name.split("/")):
            raise InputError(f"{name}: expected a name inside the studio's folder, got one that leads out of it")
        # Links are followed first: what lies elsewhere is elsewhere, whatever it is called here.
        path = Path(os.path.realpath(self.path / name))
        if not path.is_relative_to(self.path):
            raise InputError(f"{name}: expected a name inside the studio's folder, got one that leads out of it")
        return path

    def names(self, ending: str) -> list[str]:
        """Names of the files of an ending, hidden ones and those behind links to elsewhere left out, newest first."""
        found: list[tuple[float, str]] = []
        for path in self.path.iterdir():
            if not path.name.endswith(ending) or path.name.startswith("."):
                continue
            try:
                if path.is_file() and self.place(path.name):
                    found.append((path.stat().st_mtime, path.name))
            except (OSError, InputError):
                continue
        return [name for _, name in sorted(found, reverse=True)]

    def free(self, stem: str, ending: str) -> Path:
        """A path of no file that is there, made of a name that somebody sent; ours, whatever they wrote."""
        own = re.sub(r"\.+", "_", Subject(object=stem).stem)
        number = 1
        while (path := self.path / f"{own}-{number:02d}{ending}").exists():
            number += 1
        return path

    async def receive(self, name: str, parts: AsyncIterator[bytes], *, largest: int = LARGEST) -> Path:
        """Write what is sent, as it comes, under a name of our own.

        Raises
        ------
        InputError
            If it is larger than it may be, or of no kind that midair reads; nothing of it is left then.
        """
        ending = Path(name).suffix.lower()
        if ending not in READABLE or ending == ".html":
            raise InputError(f"upload: expected a recording ({' '.join(READABLE[:-2])}), got {ending or 'no ending'}")
        path = self.free(Path(name).stem, ending)
        size = 0
        with whole_file(path) as partial, partial.open("wb") as file:
            async for part in parts:
                size += len(part)
                if size > largest:
                    raise InputError(
                        f"upload: expected at most {largest >> 20} MiB, got more; copy it into {self.path}"
                    )
                file.write(part)
        return path
