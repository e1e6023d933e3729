"""Modes of solved problems in the state folder: the next solve with the same array, grid and air starts sooner."""

import hashlib
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.devices import make_state_folder, state_folder
from midair.errors import FileError
from midair.files import atomic_file

MOST = 256_000_000
"""Bytes of all files together; the oldest are removed first."""


class ModeStore:
    """One file per problem: the SHA-256 of the rest, then an archive of NumPy."""

    def read(self, key: str) -> dict[str, NDArray[Any]] | None:
        """The arrays; None if there are none, or they are damaged."""
        with suppress(OSError):
            path = _folder() / f"{key}.npz"
            stored = path.read_bytes()
            if hashlib.sha256(stored[32:]).digest() == stored[:32]:
                path.touch()
                with np.load(BytesIO(stored[32:]), allow_pickle=False) as archive:
                    return dict(archive)
        return None

    def write(self, key: str, arrays: dict[str, NDArray[Any]]) -> None:
        """Keep arrays, and remove the oldest ones above the limit; a failure is ignored."""
        archive, left = BytesIO(), MOST
        save: Any = np.savez
        save(archive, **arrays)
        with suppress(OSError, FileError):
            make_state_folder()
            _folder().mkdir(mode=0o700, exist_ok=True)
            with atomic_file(_folder() / f"{key}.npz") as partial:
                partial.write_bytes(hashlib.sha256(archive.getvalue()).digest() + archive.getvalue())
            for path in sorted(_folder().glob("*.npz"), key=lambda each: -each.stat().st_mtime):
                left -= path.stat().st_size
                if left < 0:
                    path.unlink(missing_ok=True)


def clear_modes() -> int:
    """Remove all stored modes; returns the number of bytes that this freed."""
    freed = 0
    for path in _folder().glob("*.npz"):
        freed += path.stat().st_size
        path.unlink(missing_ok=True)
    return freed


def _folder() -> Path:
    return state_folder() / "modes"
