"""Ring buffer of samples and emitted phases, in memory that the loop shares with other programs.

The loop writes and never waits: a slow reader learns how many frames it missed. Counts and times of all frames since
the start are stored as well, so that statistics need not read every frame.
"""

import math
from multiprocessing.sharedctypes import RawArray
from typing import Any

import numpy as np
from numpy.typing import NDArray

FRAME_EMITTED, FRAME_LATE, FRAME_REPEATED = 1, 2, 4
"""Flags of a frame: it was emitted; it was late, so the previous one stayed; the sensor lost it (repeated frame)."""

STEP = 50e-6
"""Bin width of the histograms in s."""

_BINS = 1000
_COUNTS = (
    *("head", "frames", "lost", "late", "gaps", "unanswered", "played", "hurried", "hot", "failsafe", "ends"),
    *("timed", "span_us"),
)
_TIMES = ("work", "left")
_MISSES = ("late", "lost", "gaps")
_SECONDS = 4096

_NUMBERS = len(_COUNTS) + len(_TIMES) * _BINS + len(_MISSES) * _SECONDS


def _slot(channels: int, transducers: int) -> np.dtype[Any]:
    """Data type of a frame.

    number; taken, sampling time in s of the computer's clock; instant in ns of device time; left, sending time in ns, 0
    if not sent; samples; pressure in Pa; flags; intensity; phases.
    """
    times = [("number", "i8"), ("taken", "f8"), ("instant", "i8"), ("left", "i8")]
    frames = [("samples", "f8", (channels,)), ("pressure", "f8", (channels,))]
    played = [("flags", "u1"), ("intensity", "u1"), ("phases", "u1", (transducers,))]
    return np.dtype([*times, *frames, *played], align=True)


class TouchRing:
    """A ring of frames, made by `LiveSession` and shared with the loop's process."""

    def __init__(self, slots: int, channels: int, transducers: int) -> None:
        self._slot = _slot(channels, transducers)
        self._memory: Any = RawArray("B", 8 * _NUMBERS + slots * self._slot.itemsize)
        self._view()

    def __getstate__(self) -> dict[str, Any]:
        """State for another process: the same memory."""
        return {"_slot": self._slot, "_memory": self._memory}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._slot, self._memory = state["_slot"], state["_memory"]
        self._view()

    def _view(self) -> None:
        whole = np.frombuffer(self._memory, np.uint8)
        numbers = whole[: 8 * _NUMBERS].view(np.int64)
        self._counts = {name: numbers[place : place + 1] for place, name in enumerate(_COUNTS)}
        self._misses: NDArray[np.int64] = numbers[-len(_MISSES) * _SECONDS :].reshape(len(_MISSES), _SECONDS)
        times = numbers[len(_COUNTS) : len(_COUNTS) + len(_TIMES) * _BINS].reshape(len(_TIMES), _BINS)
        self._times: dict[str, NDArray[np.int64]] = dict(zip(_TIMES, times, strict=True))
        self.slots: NDArray[Any] = whole[numbers.nbytes :].view(self._slot)

    def count(self, name: str) -> int:
        """Count since the start, as in `LiveStatistics`; timed frames and their span in us, see `RateMeter`."""
        return int(self._counts[name][0])

    def add(self, name: str, more: int = 1) -> None:
        """Increase a count (loop only)."""
        self._counts[name][0] += more

    def put(self, name: str, value: int) -> None:
        """Set a count (loop only)."""
        self._counts[name][0] = value

    def time(self, name: str, seconds: float) -> None:
        """Add a duration to a histogram (loop only): "work", computing time; "left", from sampling to sending."""
        self._times[name][min(max(int(seconds / STEP), 0), _BINS - 1)] += 1

    def miss(self, name: str, seconds: float) -> None:
        """Count a late or lost frame, or a gap, `seconds` after the start (loop only)."""
        self.add(name)
        self._misses[_MISSES.index(name), min(int(seconds), _SECONDS - 1)] += 1

    def over_time(self, seconds: float) -> dict[str, tuple[int, ...]]:
        """Late and lost frames and gaps in ten equal parts of a run of so many seconds, to whole seconds."""
        tenth = np.arange(_SECONDS) * 10 // max(1, math.ceil(min(seconds, _SECONDS)))
        parts = [np.bincount(np.minimum(tenth, 9), counts, 10).astype(int).tolist() for counts in self._misses]
        return dict(zip(_MISSES, map(tuple, parts), strict=True))

    def histogram(self, name: str) -> NDArray[np.int64]:
        """Number of durations per bin of `STEP`, shape (bin,); the last bin holds all longer ones."""
        return self._times[name].copy()

    def __getitem__(self, number: int) -> Any:
        """Slot of a frame, by its number in the ring."""
        return self.slots[number % len(self.slots)]

    def next_slot(self) -> Any:
        """Slot that the loop writes next; `publish` makes it visible."""
        return self[self.count("head")]

    def publish(self) -> None:
        """Make the next slot visible."""
        self._counts["head"][0] += 1

    def end(self) -> None:
        """Request an orderly end of the loop."""
        self._counts["ends"][0] = 1

    @property
    def ends(self) -> bool:
        """Whether an end was requested."""
        return bool(self._counts["ends"][0])

    def since(self, seen: int) -> tuple[NDArray[Any], int, int]:
        """Frames from number `seen` on: a copy, the number to continue with, and the count of overwritten frames."""
        head, slots = self.count("head"), len(self.slots)
        first = max(seen, head - slots)
        found = self.slots[np.arange(first, head) % slots]
        # Slots that the loop overwrote during the copy are invalid; one more is being written now.
        torn = max(first, self.count("head") - slots + 1) - first
        torn = min(max(0, torn), len(found)) if self.count("head") > slots else 0
        return found[torn:], head, first - seen + torn
