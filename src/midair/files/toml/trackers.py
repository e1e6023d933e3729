"""Placement of a tracker in TOML, written by hand or by `midair calibrate tracker`.

::

    rotation_deg = [0, 0, 180]     # about the fixed x, then y, then z axis
    offset_mm = [0, -120, 15]      # place of the tracker's origin in array coordinates
    uncertainty_mm = 1.5           # standard uncertainty of a placed point; optional

A tracker's own coordinates are x to the right, y away from the person, z up.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from midair.errors import BrokenFileError, InputError
from midair.files.atomic import atomic_file
from midair.files.text_files import read_toml
from midair.files.toml.plain import from_plain
from midair.model import TrackerPlacement


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackerSheet:
    """Keys of such a file."""

    rotation_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    offset_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    uncertainty_mm: float = 0.0


def load_tracker(path: str | os.PathLike[str]) -> TrackerPlacement:
    """Read the placement of a tracker. Raises MissingFileError, or BrokenFileError if a key or value is invalid."""
    content = read_toml(path, "a TOML file with the placement of a tracker")
    try:
        sheet = from_plain(TrackerSheet, content)
        return TrackerPlacement(
            rotation=Rotation.from_euler("xyz", sheet.rotation_deg, degrees=True).as_matrix(),
            offset=np.array(sheet.offset_mm) * 1e-3,
            uncertainty=sheet.uncertainty_mm * 1e-3,
        )
    except InputError as wrong:
        raise BrokenFileError(f"{path}: {wrong}") from wrong


def save_tracker(placement: TrackerPlacement, path: str | os.PathLike[str]) -> None:
    """Write the placement of a tracker atomically. Raises FileError if the file cannot be written."""
    turns = Rotation.from_matrix(placement.rotation).as_euler("xyz", degrees=True)
    lines = [
        f"rotation_deg = [{', '.join(f'{turn:.6f}' for turn in turns)}]",
        f"offset_mm = [{', '.join(f'{1e3 * place:.4f}' for place in placement.offset)}]",
        f"uncertainty_mm = {1e3 * placement.uncertainty:.4f}",
    ]
    with atomic_file(Path(path)) as partial:
        Path(partial).write_text("\n".join(lines) + "\n", encoding="ascii")
