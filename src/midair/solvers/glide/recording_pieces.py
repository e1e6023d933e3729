"""Split a recording into pieces that can be solved anywhere in any order, with bit-identical results.

Consecutive blocks share one frame, the last mark of the earlier block. Solving the marks of that block alone gives
everything that the next block needs.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.solvers.glide.glide import Glide
from midair.solvers.glide.schedule import Indices, blocks


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Piece:
    """Frames `first` to `last` - 1 of a recording: whole blocks, and the silent frames among and before them."""

    first: int
    last: int
    marks: Indices
    """Frames of the recording, shape (mark,): the marks of the block before the piece; empty for the first piece."""


def pieces(solver: Glide, sounds: NDArray[np.bool_], *, together: int) -> Iterator[Piece]:
    """Yield all frames of a recording in pieces of `together` blocks of the solver.

    Parameters
    ----------
    sounds : ndarray of bool, shape (frame,)
        False for silent frames.
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
