"""Starting a recording when something touches the sensor, with what came just before, and ending it in silence."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Trigger:
    """Looks for the first frame at which any channel is further from its resting value than a level.

    The resting value of each channel is its running mean with a time constant of `settle`, which starts at the first
    frame; it stands still while the trigger is exceeded.

    Parameters
    ----------
    level : float
        In the sensor's unit, above 0.
    rate : float
        Frames per second, in Hz.
    settle : float
        Time constant, in s.
    """

    def __init__(self, level: float, rate: float, *, settle: float = 0.5) -> None:
        self._level, self._keep = level, float(np.exp(-1 / (settle * rate)))
        self._rest: Array | None = None

    def exceeded(self, samples: Array) -> NDArray[np.bool_]:
        """Whether any channel is past the level, for each frame of samples of shape (frame, row, column)."""
        if not len(samples):
            return np.zeros(0, bool)
        flat = np.asarray(samples, np.float64).reshape(len(samples), -1)
        rest = flat[0].copy() if self._rest is None else self._rest
        # Block by block, not frame by frame: the mean moves far slower than a block is long.
        past = np.asarray((np.abs(flat - rest) > self._level).any(axis=1))
        calm = flat[~past]
        keep = self._keep ** len(calm)
        self._rest = keep * rest + (1 - keep) * calm.mean(axis=0) if len(calm) else rest
        return past


class PreRoll:
    """The last frames, a fixed number at most.

    Parameters
    ----------
    frames : int
        How many; 0 keeps none.
    """

    def __init__(self, frames: int) -> None:
        self._frames, self._have = frames, 0
        self._parts: deque[Array] = deque()

    def add(self, samples: Array) -> None:
        """Frames that came; the oldest are forgotten."""
        if self._frames == 0:
            return
        # A copy, since a view would keep its whole block in memory.
        self._parts.append(np.array(samples[-self._frames :]))
        self._have += len(self._parts[-1])
        while self._have - len(self._parts[0]) >= self._frames:
            self._have -= len(self._parts.popleft())

    def take(self) -> Array | None:
        """What was kept, oldest first, and forget it; None when there is nothing."""
        if not self._have:
            return None
        kept = np.concatenate(self._parts)[-self._frames :]
        self._parts.clear()
        self._have = 0
        return kept
