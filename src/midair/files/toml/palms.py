"""Outline of a palm above the array in TOML: a disc, a polygon, or a PNG picture beside the file.

::

    name = "left hand"
    disc_mm = 85                                   # one of these three
    outline_mm = [[-40, -45], [40, -45], [0, 50]]  # x and y from the centre of the array
    picture = "hand.png"                           # dark is skin
    width_mm = 180                                 # width of the picture, which is centred on the array
    pitch_mm = 2.5                                 # distance between evaluated points; optional
"""

import os
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError, InputError, MissingFileError
from midair.files.toml.plain import read_sheet
from midair.model import Palm
from midair.validation import positive


@dataclass(frozen=True, slots=True, kw_only=True)
class PalmSheet:
    """Keys of such a file."""

    name: str = ""
    disc_mm: float | None = None
    outline_mm: tuple[tuple[float, float], ...] | None = None
    picture: str | None = None
    width_mm: float | None = None
    pitch_mm: float = 2.5


def load_palm(path: str | os.PathLike[str]) -> Palm:
    """Read a palm from a TOML file.

    Raises MissingFileError if the file or its picture does not exist and BrokenFileError if the file or the picture is
    invalid.
    """
    expected = "a TOML file with the outline of a palm"
    return read_sheet(path, expected, PalmSheet, lambda sheet: _palm(sheet, Path(path)))


def _palm(sheet: PalmSheet, path: Path) -> Palm:
    pitch, name = positive(sheet.pitch_mm, "pitch_mm", "mm") * 1e-3, sheet.name or path.stem
    asked = [each for each in (sheet.disc_mm, sheet.outline_mm, sheet.picture) if each is not None]
    if len(asked) != 1:
        raise InputError(f"expected one of disc_mm, outline_mm and picture, got {len(asked)}")
    if sheet.disc_mm is not None:
        return Palm(inside=Palm.disc(sheet.disc_mm * 1e-3, pitch=pitch).inside, pitch=pitch, name=name)
    if sheet.outline_mm is not None:
        return Palm.within(np.array(sheet.outline_mm) * 1e-3, pitch=pitch, name=name)
    if sheet.width_mm is None or not sheet.picture:
        raise InputError("expected width_mm beside picture, got none")
    dark = _dark(path.parent / sheet.picture)
    return _sampled(dark, positive(sheet.width_mm, "width_mm", "mm") * 1e-3, pitch, name)


_MOST = 4096
"""Maximum width and height of a picture in pixels."""


def _dark(picture: Path) -> NDArray[np.bool_]:
    """True for pixels that are dark and not transparent, shape (row, column)."""
    from matplotlib.image import imread

    try:
        with picture.open("rb") as file:
            head = file.read(24)
    except OSError:
        raise MissingFileError(f"{picture}: expected the picture of a palm, found no file") from None
    if len(head) < 24 or head[:8] != b"\x89PNG\r\n\x1a\n":
        raise BrokenFileError(f"{picture}: expected a PNG, got something else")
    # Checked before decompression, because a small file can contain a picture that fills the memory.
    columns, rows = struct.unpack(">II", head[16:24])
    if not 0 < columns <= _MOST or not 0 < rows <= _MOST:
        raise BrokenFileError(f"{picture}: expected at most {_MOST} x {_MOST} pixels, got {columns} x {rows}")
    try:
        pixels = np.atleast_3d(np.asarray(imread(picture), float))
    except (OSError, SyntaxError, ValueError) as wrong:
        raise BrokenFileError(f"{picture}: expected a PNG, got: {wrong}") from wrong
    colours = pixels.shape[2]
    seen = pixels[..., -1] if colours in (2, 4) else np.ones(pixels.shape[:2])
    light = pixels[..., : 3 if colours >= 3 else 1].mean(axis=2)
    return (light < 0.5) & (seen > 0.5)


def _sampled(dark: NDArray[np.bool_], width: float, pitch: float, name: str) -> Palm:
    """A palm whose grid points take the nearest pixel."""
    side = width / dark.shape[1]
    counts = [2 * int(each * side / 2 / pitch) + 1 for each in dark.shape]
    rows, columns = (
        np.clip(((np.arange(count) - count // 2) * pitch / side + pixels / 2).astype(int), 0, pixels - 1)
        for count, pixels in zip(counts, dark.shape, strict=True)
    )
    return Palm(inside=dark[np.ix_(rows, columns)], pitch=pitch, name=name)
