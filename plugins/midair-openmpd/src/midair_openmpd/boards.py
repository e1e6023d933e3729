"""OpenMPD boards: their transducers, and the board files of the makers, ``board_N.pat``, seven lines of measurements.

Serial number; number of transducers; phase steps per turn; positions (x, y, z), in m; pins; phase offsets, in integer
degrees; amplitude factors. All lists are in the order of transducers, not of pins, as in the makers' driver and solver
(OpenMPD_Driver, AsierInhoImpl_V2.cpp; OpenMPD_Solvers, hologramSolver_V2.cl), although their page on the format states
the order of pins.
"""

import os
import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.errors import BrokenFileError, InputError
from midair.files import read_text
from midair.model import TransducerArray
from midair.validation import frozen_array

Array = NDArray[np.float64]

LARGEST = 65_536
"""Maximum size in bytes; the makers' own files have 12,500."""

SIDE = 16
"""Number of transducers along one side of a board."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Board:
    """One OpenMPD board with the values that its manufacturer measured."""

    position: Array
    """Position of each transducer relative to the centre of the board, shape (256, 3), in m; all radiate along +z."""
    pin: NDArray[np.int64]
    """Index of each transducer's byte in a frame, 0 to 255, shape (256,)."""
    offset: Array
    """Phase lag of each transducer, shape (256,), in rad; it is subtracted from the drive.

    Many boards have two groups that differ by half a turn: transducers soldered with reversed polarity."""
    strength: Array
    """Factor on the level of each transducer, 0 to 1, shape (256,)."""
    serial: str = ""
    """Serial number of the board's USB chip."""

    def __post_init__(self) -> None:
        count = SIDE * SIDE
        object.__setattr__(self, "position", frozen_array(self.position, "board position", (count, 3)))
        for name, kind in (("pin", np.int64), ("offset", np.float64), ("strength", np.float64)):
            object.__setattr__(self, name, frozen_array(getattr(self, name), f"board {name}", (count,), kind))
        if np.any(np.sort(self.pin) != np.arange(count)):
            raise InputError(f"board pin: expected each of 0 to {count - 1} once, got {np.sort(self.pin)[:4]}...")
        if self.strength.min() < 0 or self.strength.max() > 1:
            # Above 1 the board would be louder than the exposure check assumes.
            raise InputError(f"board strength: expected 0 to 1, got {self.strength.min():g} to {self.strength.max():g}")

    @classmethod
    def nominal(cls) -> "Board":
        """A board without offsets: 10.5 mm pitch, column by column from the upper left.

        Positions and pins are those of the manufacturer's board files (RMResearch/OpenMPD, OpenMPD_Client/board_1.pat).
        """
        column, row = np.divmod(np.arange(SIDE * SIDE), SIDE)
        x = np.asarray((np.arange(SIDE) - (SIDE - 1) / 2) * 10.5e-3, np.float64)
        within = np.where(row % 2 == 0, np.array([1, 0, 3, 2])[column % 4], np.array([5, 4, 6, 7])[column % 4])
        return cls(
            position=np.stack([x[column], -x[row], np.zeros(SIDE * SIDE, np.float64)], axis=1),
            pin=64 * (3 - column // 4) + 8 * (7 - row // 2) + within,
            offset=np.zeros(SIDE * SIDE),
            strength=np.ones(SIDE * SIDE),
        )


def array_of_boards(*boards: Board) -> TransducerArray:
    """One board that radiates upwards, or two opposing boards 238.8 mm apart.

    The second board is turned about the y axis, as in the manufacturer's driver (AsierInhoImpl_V2.cpp). The model of
    the transducers is not published; programs for these boards assume a pressure of 3.4, 6.0 or 8.02 Pa m (AcousTools,
    Constants.py). midair assumes the highest value, so that exposure is never underestimated; the felt pressure may
    then be weaker than requested. Raises InputError if there are not one or two boards.
    """
    if len(boards) not in (1, 2):
        raise InputError(f"OpenMPD: expected one board, or two face to face, got {len(boards)}")
    facing = np.array([-1.0, 1.0, -1.0])
    places = [board.position for board in boards[:1]]
    places += [board.position * facing + np.array([0, 0, 0.2388]) for board in boards[1:]]
    normals = np.repeat([[0, 0, 1.0], [0, 0, -1.0]][: len(boards)], SIDE * SIDE, axis=0)
    return TransducerArray(
        position=np.concatenate(places),
        normal=normals,
        unit=np.repeat(np.arange(len(boards)), SIDE * SIDE),
        pressure=8.02,
        name="OpenMPD" if len(boards) == 1 else "OpenMPD twin",
    )


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
