"""OpenMPD boards: 256 transducers each, wired and measured one by one; one board, or two face to face."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model.geometry import TransducerArray, centred
from midair.model.reprs import clipped, told
from midair.validation import frozen_array

Array = NDArray[np.float64]

SIDE = 16
"""Transducers along a side of a board."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Board:
    """One board as its makers measured it.

    Attributes
    ----------
    position : ndarray, shape (256, 3)
        Of each transducer from the middle of the board, in m; all radiate along +z.
    pin : ndarray of int, shape (256,)
        Place of each transducer's byte in a frame, 0 to 255.
    offset : ndarray, shape (256,)
        Phase by which each transducer sounds later than it is told, in rad; it is subtracted. Many boards have two
        groups half a turn apart: transducers soldered the other way round.
    strength : ndarray, shape (256,)
        By which the level of each transducer is multiplied, 0 to 1.
    serial : str
        Of the board's USB chip.
    """

    position: Array
    pin: NDArray[np.int64]
    offset: Array
    strength: Array
    serial: str = ""

    def __post_init__(self) -> None:
        count = SIDE * SIDE
        object.__setattr__(self, "position", frozen_array(self.position, "board position", (count, 3)))
        object.__setattr__(self, "pin", frozen_array(self.pin, "board pin", (count,), np.int64))
        object.__setattr__(self, "offset", frozen_array(self.offset, "board offset", (count,)))
        object.__setattr__(self, "strength", frozen_array(self.strength, "board strength", (count,)))
        if np.any(np.sort(self.pin) != np.arange(count)):
            raise InputError(f"board pin: expected each of 0 to {count - 1} once, got {np.sort(self.pin)[:4]}...")
        if self.strength.min() < 0 or self.strength.max() > 1:
            # Above 1 it would be louder than what its exposure was worked out for.
            raise InputError(f"board strength: expected 0 to 1, got {self.strength.min():g} to {self.strength.max():g}")

    def __repr__(self) -> str:
        known = "offsets known" if np.any(self.offset) else "no offsets"
        return told(self, clipped(self.serial or "any"), f"{len(self.pin)} transducers", known)

    @classmethod
    def nominal(cls) -> "Board":
        """A board without offsets: 10.5 mm pitch, down the columns from the upper left.

        Places and pins are those of the makers' board files (RMResearch/OpenMPD, OpenMPD_Client/board_1.pat), which
        agree with each other.
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
    """One board that radiates up, or a second one face to face with it, 238.8 mm above.

    The second board is turned about the y axis, as the makers' driver places it (AsierInhoImpl_V2.cpp). Nobody
    publishes the model of the transducers; figures for their pressure in programs for these boards are 3.4, 6.0 and
    8.02 Pa m (AcousTools, Constants.py). The highest is assumed, so that exposure errs to the safe side, and what is
    played may be felt weaker than asked.

    Raises
    ------
    InputError
        If there are not one or two.
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
