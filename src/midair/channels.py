"""Iterate over the channels of many frames, so that only one channel at a time is in memory."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.lazy_frames import LazyFrames, blocks

Array = NDArray[np.float64]


def channels(x: "NDArray[Any] | LazyFrames") -> Iterator[Array]:
    """Yield each channel, shape (frame,), in the order of the other axes; lazy frames are read once per channel."""
    for number in range(int(np.prod(x.shape[1:], dtype=np.int64))):
        whole, first = np.empty(len(x)), 0
        for block in blocks(x):
            whole[first : first + len(block)] = block.reshape(len(block), -1)[:, number]
            first += len(block)
        yield whole
