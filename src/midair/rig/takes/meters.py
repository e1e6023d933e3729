"""Level meters with detection of clipping, dead and stuck channels; trigger and pre-roll of a recording."""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.model import Event
from midair.recordings import at_limit

Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Levels:
    """Meter values; each array has shape (channel,)."""

    rms: Array
    """Root mean square about the mean of the last `window`, in the sensor's unit."""
    peak: Array
    """Largest deviation from the mean in the last `window`, in the sensor's unit."""
    highest: Array
    """Largest `peak` since the start."""
    clipped: NDArray[np.int64]
    """Number of frames at the limit since the start."""
    clipping: Flags
    """Whether one of them was in the last `window`."""
    dead: Flags
    """Channels that have not changed since the start, for `still` or longer."""
    stuck: Flags
    """Channels that changed before, but have had one value for `still` or longer."""


class Meters:
    """Computes the levels of every channel as the frames arrive.

    `full_scale` is the limit of the converter on either side. If it is unknown, a channel clips where it stays at its
    own highest or lowest value of the window for three frames or more while it hardly ever repeats a value elsewhere.
    The levels are those of 0.3 s; a channel is dead or stuck after 0.5 s without change.
    """

    def __init__(self, channels: int, rate: float, *, full_scale: float | None = None) -> None:
        self._rate, self._full_scale = rate, full_scale
        self._window, self._still = max(4, round(0.3 * rate)), max(2, round(0.5 * rate))
        self._recent = np.zeros((0, channels))
        self._frames = 0
        self._since = np.zeros(channels, np.int64)  # first frame of each channel's current value
        self._moved, self._reported = np.zeros(channels, bool), np.zeros(channels, bool)
        self._highest, self._clipped = np.zeros(channels), np.zeros(channels, np.int64)

    def add(self, samples: Array) -> tuple[Event, ...]:
        """Process frames, shape (frame, row, column); return new events, counted from the first frame added."""
        if not len(samples):
            return ()
        block = np.asarray(samples, np.float64).reshape(len(samples), -1)
        # An unknown limit is estimated with the frames before.
        together = block if self._full_scale is not None else np.concatenate([self._recent, block])
        at_limit = self._limits(together)[-len(block) :]
        first = self._frames
        before = self._recent[-1:] if len(self._recent) else block[:1]
        changed = np.diff(np.concatenate([before, block]), axis=0) != 0
        moves = changed.any(axis=0)
        last = self._frames + len(block) - 1 - changed[::-1].argmax(axis=0)
        self._since = np.where(moves, last, self._since)
        self._moved |= moves
        # A channel that changes and then stops again is reported again.
        self._reported &= ~moves
        self._frames += len(block)
        self._recent = np.concatenate([self._recent, block])[-self._window :]
        self._highest = np.maximum(self._highest, np.abs(block - self._recent.mean(axis=0)).max(axis=0))
        counts = at_limit.sum(axis=0)
        self._clipped += counts
        clipped = [
            Event(kind="clipped", frame=first + int(at_limit[:, i].argmax()), frames=int(counts[i]), channel=int(i))
            for i in np.flatnonzero(counts)
        ]
        return (*clipped, *self._new_events())

    @property
    def levels(self) -> Levels:
        """Current meter values."""
        recent = self._recent if len(self._recent) else np.zeros((1, len(self._highest)))
        about = recent - recent.mean(axis=0)
        still = self._frames - self._since >= self._still
        return Levels(
            rms=np.sqrt(np.square(about).mean(axis=0)),
            peak=np.abs(about).max(axis=0),
            highest=self._highest.copy(),
            clipped=self._clipped.copy(),
            clipping=np.asarray(self._limits(recent).any(axis=0)),
            dead=still & ~self._moved,
            stuck=still & self._moved,
        )

    def _limits(self, samples: Array) -> Flags:
        if self._full_scale is not None:
            return at_limit(samples, self._full_scale)
        if len(samples) < 4:
            return np.zeros(samples.shape, bool)
        same = samples[1:] == samples[:-1]
        extreme = (samples == samples.max(axis=0)) | (samples == samples.min(axis=0))
        runs = np.zeros(samples.shape, bool)
        triple = same[1:] & same[:-1] & extreme[2:]
        runs[2:] |= triple
        runs[1:-1] |= triple
        runs[:-2] |= triple
        elsewhere = ~extreme[1:]
        # A slow or coarse signal repeats values everywhere, so that a run at its extreme is no sign of clipping.
        repeats = (same & elsewhere).sum(axis=0) <= 0.05 * elsewhere.sum(axis=0)
        return runs & repeats & elsewhere.any(axis=0)

    def _new_events(self) -> list[Event]:
        new = (self._frames - self._since >= self._still) & ~self._reported
        self._reported |= new
        return [
            Event(kind="stuck" if self._moved[i] else "dead", frame=int(self._since[i]), channel=int(i))
            for i in np.flatnonzero(new)
        ]


class Trigger:
    """Detects frames in which any channel deviates from its resting value by more than `level`, in the sensor's unit.

    The resting value of each channel is its running mean with a time constant of 0.5 s, starting at the first
    frame; it is frozen while the trigger is exceeded.
    """

    def __init__(self, level: float, rate: float) -> None:
        self._level, self._keep = level, float(np.exp(-1 / (0.5 * rate)))
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
