"""Summary of an HDF5 file of midair, without reading its samples."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from midair.errors import BrokenFileError
from midair.files.native import Kind, check_kind, has_checksums, kind_of, open_file, plain_text, stored_dataset


@dataclass(frozen=True, slots=True, kw_only=True)
class Contents:
    """Summary of an HDF5 file of midair."""

    kind: Kind
    created: str
    """ISO 8601, UTC."""
    created_by: str
    """Program and version."""
    frames: int | None
    """None for a calibration of a sensor or an array."""
    finished: bool
    """False if the program ended before it closed the file."""
    checksums: bool
    """False if flipped bits of the samples cannot be detected: an early version recorded the file."""
    parts: tuple[str, ...]
    """Other contents: "calibration" and "pressure" of a recording, "target" of a drive."""


_NUMBERS: dict[Kind, str] = {"recording": "samples", "drive": "phase"}


def contents(path: str | os.PathLike[str]) -> Contents:
    """Summary of an HDF5 file of midair.

    Raises MissingFileError, BrokenFileError or UnknownFormatError if the file does not exist, is damaged or of another
    program, or was written by a newer midair.
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
            checksums=has_checksums(stored_dataset(file, _NUMBERS.get(kind, "response_real"))),
            parts=tuple(part for part in ("calibration", "pressure", "target") if part in file),
        )


def _kind(text: str, path: str | os.PathLike[str]) -> Kind:
    kinds: tuple[Kind, ...] = get_args(Kind)
    for kind in kinds:
        if text == f"midair {kind}":
            return kind
    raise BrokenFileError(f"{path}: expected a file of midair, got {text or 'an HDF5 file of another program'}")
