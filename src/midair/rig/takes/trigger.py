"""Start a recording at a touch, with a pre-roll, and end it after silence."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Trigger:
    """Detects frames in which any channel deviates from its resting value by more than `level`, in the sensor's unit.

    The resting value of each channel is its running mean with the time constant `settle` in s, starting at the first
    frame; it is frozen while the trigger is exceeded.
    """

    def __init__(self, level: float, rate: float, *, settle: float = 0.5) -> None:
        self._level, self._keep = level, float(np.exp(-1 / (settle * rate)))
        self._rest: Array | None = None

    def exceeded(self, samples: Array) -> NDArray[np.bool_]:
        """Whether any channel exceeds the level, for each frame of samples of shape (frame, row, column)."""
        if not len(samples):
            return np.zeros(0, bool)
        flat = np.asarray(samples, np.float64).reshape(len(samples), -1)
        rest = flat[0].copy() if self._rest is None else self._rest
        # Per block, not per frame: the mean changes little within a block.
        past = np.asarray((np.abs(flat - rest) > self._level).any(axis=1))
        calm = flat[~past]
        keep = self._keep ** len(calm)
        self._rest = keep * rest + (1 - keep) * calm.mean(axis=0) if len(calm) else rest
        return past


class PreRoll:
    """Buffer of the last `frames` frames; 0 keeps none."""

    def __init__(self, frames: int) -> None:
        self._frames, self._have = frames, 0
        self._parts: deque[Array] = deque()

    def add(self, samples: Array) -> None:
        """Add frames; the oldest are dropped."""
        if self._frames == 0:
            return
        # A copy, since a view would keep its whole block in memory.
        self._parts.append(np.array(samples[-self._frames :]))
        self._have += len(self._parts[-1])
        while self._have - len(self._parts[0]) >= self._frames:
            self._have -= len(self._parts.popleft())

    def take(self) -> Array | None:
        """Return the frames, oldest first, and empty the buffer; None if it is empty."""
        if not self._have:
            return None
        kept = np.concatenate(self._parts)[-self._frames :]
        self._parts.clear()
        self._have = 0
        return kept
