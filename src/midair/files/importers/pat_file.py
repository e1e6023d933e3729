"""Board files of OpenMPD, ``board_N.pat``: seven lines of measurements by its makers.

Serial number; number of transducers; phase steps per turn; positions (x, y, z), in m; pins; phase offsets, in integer
degrees; amplitude factors. All lists are in the order of transducers, not of pins, as in the makers' driver and solver
(OpenMPD_Driver, AsierInhoImpl_V2.cpp; OpenMPD_Solvers, hologramSolver_V2.cl), although their page on the format states
the order of pins.
"""

import os
import re

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError, InputError
from midair.files.text_files import read_text
from midair.model import Board

LARGEST = 65_536
"""Maximum size in bytes; the makers' own files have 12,500."""


def load_board(path: str | os.PathLike[str]) -> Board:
    """Read a board file of OpenMPD.

    Raises MissingFileError if the file does not exist; BrokenFileError if it is not a board file, or a number is out of
    range.
    """
    expected = "the seven lines of an OpenMPD board file"
    content = read_text(path, f"{expected} (board_N.pat)", largest=LARGEST)
    whole = [line.strip() for line in content.splitlines() if line.strip()]
    if len(whole) != 7:
        raise BrokenFileError(f"{path}: expected {expected}, got {len(whole)}; use the board_N.pat of this board")
    serial, *lines = whole
    count, steps = (_numbers(line, path, 1)[0] for line in lines[:2])
    if (count, steps) != (256, 128):
        raise BrokenFileError(f"{path}: expected a board of 256 transducers and 128 steps, got {count:g} and {steps:g}")
    places = _numbers(re.sub(r"[()]", " ", lines[2]), path, 3 * 256)
    pins, degrees, factors = (_numbers(line, path, 256) for line in lines[3:])
    try:
        return Board(
            position=places.reshape(256, 3),
            pin=pins.astype(np.int64),
            offset=np.radians(degrees),
            strength=factors,
            serial=serial,
        )
    except InputError as wrong:
        raise BrokenFileError(f"{path}: {wrong}") from None


def _numbers(line: str, path: str | os.PathLike[str], count: int) -> NDArray[np.float64]:
    fields = [field for field in re.split(r"[\s,]+", line) if field]
    try:
        values = np.array([float(field) for field in fields])
    except ValueError as wrong:
        raise BrokenFileError(f"{path}: expected numbers, got {str(wrong).rpartition(': ')[2]}") from None
    if len(values) != count or not np.isfinite(values).all():
        raise BrokenFileError(f"{path}: expected {count} finite numbers in a line, got {len(values)}")
    return values
