"""One channel of many frames at a time: what a spectrum of the whole needs in memory is a channel, not all of them."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.lazy_frames import LazyFrames, blocks

Array = NDArray[np.float64]


def channels(x: "NDArray[Any] | LazyFrames") -> Iterator[Array]:
    """Each channel of an array or a reel of (frame, ...), shape (frame,), in the order of its other axes.

    A reel is read once for each channel: keep in a `TempFrames` what takes long to work out.
    """
    for number in range(int(np.prod(x.shape[1:], dtype=np.int64))):
        whole, first = np.empty(len(x)), 0
        for block in blocks(x):
            whole[first : first + len(block)] = block.reshape(len(block), -1)[:, number]
            first += len(block)
        yield whole
