"""A recording in pieces that can be solved anywhere, in any order, to the same bits as one after another.

Blocks are joined by one frame each, the last mark of the block before. Who solves the marks of that block, and no other
of its frames, knows all that a block goes on from.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.solvers.glide.glide import Glide
from midair.solvers.glide.schedule import Indices, blocks


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Piece:
    """Frames `first` to `last` - 1 of a recording: whole blocks, and the silent frames among and before them.

    Attributes
    ----------
    first, last : int
        Frames of the recording.
    marks : ndarray of int, shape (mark,)
        Frames that sound, of the block before the first one of the piece, that are solved from nothing; none for the
        first piece.
    """

    first: int
    last: int
    marks: Indices


def pieces(solver: Glide, sounds: NDArray[np.bool_], *, together: int) -> Iterator[Piece]:
    """All frames of a recording, in pieces of so many blocks.

    Parameters
    ----------
    solver : Glide
        Whose blocks.
    sounds : ndarray of bool, shape (frame,)
        Which frames ask for anything.
    together : int
        Blocks a piece.
    """
    audible = np.flatnonzero(sounds)
    every = list(blocks(len(audible), coarse=solver.coarse, size=solver.block_on())) if len(audible) else []
    first = 0
    for number in range(0, max(len(every), 1), together):
        ends = number + together >= len(every)
        last = len(sounds) if ends else int(audible[every[number + together - 1].last]) + 1
        marks = audible[every[number - 1].marks] if number else np.zeros(0, np.int64)
        yield Piece(first=first, last=last, marks=marks)
        first = last
