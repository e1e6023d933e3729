"""In which order the frames of a recording are solved: marks far apart, then what lies halfway, until none is left.

The marks are counted from the first frame that sounds, and a block is a fixed number of marks, so that what is solved
together does not depend on how long the recording is or how many blocks are solved at once.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlockRange:
    """Some of the frames, between two marks.

    Attributes
    ----------
    first, last : int
        The frames of the block, both included; `first` is the last of the block before it, but for the first block.
    marks : ndarray of int, shape (mark,)
        Known that are solved from nothing, `first` only in the first block.
    """

    first: int
    last: int
    marks: Indices

    @property
    def leads(self) -> bool:
        """Whether no block is before it."""
        return self.first == int(self.marks[0])


def blocks(frames: int, *, coarse: int, size: int) -> Iterator[BlockRange]:
    """All blocks of so many frames, in order.

    Parameters
    ----------
    frames : int
        That sound, 1 or more.
    coarse : int
        Distance between two marks; the last frame is a mark too.
    size : int
        Known of a block, rounded up to whole distances.
    """
    size = coarse * max(-(-size // coarse), 1)
    for first in range(0, max(frames - 1, 1), size):
        last = min(first + size, frames - 1)
        start = first if first == 0 else first + coarse
        marks = np.unique(np.minimum(np.arange(start, last + coarse, coarse), last))
        yield BlockRange(first=first, last=last, marks=marks)


def halvings(marks: Indices) -> Iterator[Indices]:
    """What lies between the marks, level by level: rows (before, middle, after), where the outer two are solved."""
    pairs = np.stack([marks[:-1], marks[1:]], axis=1)
    while len(pairs := pairs[pairs[:, 1] - pairs[:, 0] > 1]):
        middle = pairs.sum(axis=1) // 2
        yield np.stack([pairs[:, 0], middle, pairs[:, 1]], axis=1)
        pairs = np.stack([pairs[:, 0], middle, middle, pairs[:, 1]], axis=1).reshape(-1, 2)
