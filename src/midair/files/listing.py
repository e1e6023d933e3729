"""What a file of midair holds, without reading its numbers."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from midair.errors import BrokenFileError
from midair.files.native import Kind, check_kind, kind_of, open_file, plain_text, stored_dataset


@dataclass(frozen=True, slots=True, kw_only=True)
class Contents:
    """What an HDF5 file of midair holds.

    Attributes
    ----------
    kind : {"recording", "calibration", "drive", "array"}
        Of the file.
    created : str
        ISO 8601, UTC.
    created_by : str
        Program and version.
    frames : int or None
        Number of frames; None for a calibration of a sensor or an array.
    finished : bool
        Whether it was closed in order.
    parts : tuple of str
        What a recording carries besides its samples: "calibration", "pressure"; what a drive carries: "target".
    """

    kind: Kind
    created: str
    created_by: str
    frames: int | None
    finished: bool
    parts: tuple[str, ...]


def contents(path: str | os.PathLike[str]) -> Contents:
    """What an HDF5 file of midair holds.

    Raises
    ------
    MissingFileError, BrokenFileError, UnknownFormatError
        If the file is not there, is damaged or of another program, or is newer than this midair.
    """
    with open_file(path) as file:
        kind = _kind(kind_of(file), path)
        check_kind(file, kind, Path(path))
        return Contents(
            kind=kind,
            created=plain_text(file.attrs.get("created")),
            created_by=plain_text(file.attrs.get("created_by")),
            frames=None if kind in ("calibration", "array") else int(stored_dataset(file, "time").shape[0]),
            finished=kind != "recording" or bool(stored_dataset(file, "finished")[()]),
            parts=tuple(part for part in ("calibration", "pressure", "target") if part in file),
        )


def _kind(text: str, path: str | os.PathLike[str]) -> Kind:
    kinds: tuple[Kind, ...] = get_args(Kind)
    for kind in kinds:
        if text == f"midair {kind}":
            return kind
    raise BrokenFileError(f"{path}: expected a file of midair, got {text or 'an HDF5 file of another program'}")
