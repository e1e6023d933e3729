"""Order in which the frames of a recording are solved: marks, then midpoints until no frame is left.

Marks are counted from the first sounding frame, and a block is a fixed number of marks, so that batches do not depend
on the length of the recording or on the number of jobs.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlockRange:
    """Frames `first` to `last`, both included; `first` is the last frame of the previous block, if there is one."""

    first: int
    last: int
    marks: Indices  # Frames that are solved from scratch, shape (mark,), `first` only in the first block

    @property
    def leads(self) -> bool:
        """Whether this is the first block."""
        return self.first == int(self.marks[0])


def blocks(frames: int, *, coarse: int, size: int) -> Iterator[BlockRange]:
    """Yield all blocks of this number of sounding frames, in order.

    `coarse` is the distance between marks (the last frame is a mark, too), `size` the frames of a block, rounded up to
    whole distances.
    """
    size = coarse * max(-(-size // coarse), 1)
    for first in range(0, max(frames - 1, 1), size):
        last = min(first + size, frames - 1)
        start = first if first == 0 else first + coarse
        marks = np.unique(np.minimum(np.arange(start, last + coarse, coarse), last))
        yield BlockRange(first=first, last=last, marks=marks)


def midpoints(marks: Indices) -> Iterator[Indices]:
    """Frames between the marks, level by level: rows (before, middle, after), where the outer two are solved."""
    pairs = np.stack([marks[:-1], marks[1:]], axis=1)
    while len(pairs := pairs[pairs[:, 1] - pairs[:, 0] > 1]):
        middle = pairs.sum(axis=1) // 2
        yield np.stack([pairs[:, 0], middle, pairs[:, 1]], axis=1)
        pairs = np.stack([pairs[:, 0], middle, middle, pairs[:, 1]], axis=1).reshape(-1, 2)
