"""OpenMPD boards: 256 transducers with measured pins and phase offsets; one board, or two opposing boards."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError
from midair.model.geometry import TransducerArray, centred
from midair.model.reprs import clipped, summary
from midair.validation import frozen_array

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
        object.__setattr__(self, "pin", frozen_array(self.pin, "board pin", (count,), np.int64))
        object.__setattr__(self, "offset", frozen_array(self.offset, "board offset", (count,)))
        object.__setattr__(self, "strength", frozen_array(self.strength, "board strength", (count,)))
        if np.any(np.sort(self.pin) != np.arange(count)):
            raise InputError(f"board pin: expected each of 0 to {count - 1} once, got {np.sort(self.pin)[:4]}...")
        if self.strength.min() < 0 or self.strength.max() > 1:
            # Above 1 the board would be louder than the exposure check assumes.
            raise InputError(f"board strength: expected 0 to 1, got {self.strength.min():g} to {self.strength.max():g}")

    def __repr__(self) -> str:
        known = "offsets known" if np.any(self.offset) else "no offsets"
        return summary(self, clipped(self.serial or "any"), f"{len(self.pin)} transducers", known)

    @classmethod
    def nominal(cls) -> "Board":
        """A board without offsets: 10.5 mm pitch, column by column from the upper left.

        Positions and pins are those of the manufacturer's board files (RMResearch/OpenMPD, OpenMPD_Client/board_1.pat).
        """
        column, row = np.divmod(np.arange(SIDE * SIDE), SIDE)
        x = centred(SIDE, 10.5e-3)
        within = np.where(row % 2 == 0, np.array([1, 0, 3, 2])[column % 4], np.array([5, 4, 6, 7])[column % 4])
        return cls(
            position=np.stack([x[column], -x[row], np.zeros(SIDE * SIDE)], axis=1),
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
