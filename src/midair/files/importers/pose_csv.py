"""Poses of a palm over time as comma-separated values: time in s, centre in m, normal, fingers and confidence."""

import os
from pathlib import Path

import numpy as np

from midair.array_types import Array
from midair.errors import BrokenFileError, InputError
from midair.files.atomic import atomic_file
from midair.files.importers.text_table import read_table
from midair.files.text_files import read_text
from midair.model import PalmPath

NAMES = ("time", "x", "y", "z", "nx", "ny", "nz", "dx", "dy", "dz", "confidence")
"""Columns of the file."""


def load_palm_path(path: str | os.PathLike[str]) -> PalmPath:
    """Read the poses of a palm.

    Normals and directions of fingers are normalised; a length that differs by more than 1 % from 1 is refused. Raises
    MissingFileError or BrokenFileError if the file does not exist, or is not a table of poses with increasing times.
    """
    table = read_table(read_text(path, "a table of poses"), Path(path))
    if table.names != NAMES:
        raise BrokenFileError(f"{path}: expected the columns {','.join(NAMES)}, got {','.join(table.names) or 'none'}")
    rows = table.values.copy()
    rows[:, 4:7], rows[:, 7:10] = _unit(rows[:, 4:7]), _unit(rows[:, 7:10])
    try:
        return PalmPath.from_rows(rows)
    except InputError as wrong:
        raise BrokenFileError(f"{path}: {wrong}") from wrong


def save_palm_path(palm: PalmPath, path: str | os.PathLike[str]) -> None:
    """Write poses atomically, all numbers without loss. Raises FileError if the file cannot be written."""
    with atomic_file(Path(path)) as partial:
        lines = [",".join(NAMES), *(",".join(map(repr, row)) for row in palm.rows.tolist())]
        Path(partial).write_text("\n".join(lines) + "\n", encoding="ascii")


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    # Six digits of a file leave 1e-6; other lengths are for PalmPath to refuse.
    return np.where(np.abs(length - 1) < 1e-2, vectors / np.maximum(length, 0.5), vectors)
