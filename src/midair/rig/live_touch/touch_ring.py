"""What was felt and what was played, frame by frame, in memory that the loop shares with whoever looks on.

The loop writes and never waits: a reader that is too slow finds out how many frames it missed. Counts and times of all
frames since the start are beside it, so that they can be told without having read every frame.
"""

from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

import numpy as np
from numpy.typing import NDArray

SOUNDS, LATE, HELD = 1, 2, 4
"""Of a frame: it sounded; it was ready after its instant, and the one before stood on; the sensor never gave it."""

STEP = 50e-6
"""Width of a bin of the histograms, in s."""

_BINS = 1000
_COUNTS = ("head", "frames", "lost", "late", "gaps", "unanswered", "played", "hurried", "ends")
_TIMES = ("work", "left")


@dataclass(frozen=True, slots=True, kw_only=True)
class RingShape:
    """How large a ring is.

    Attributes
    ----------
    slots : int
        Frames that it holds.
    channels, transducers : int
        Of a frame.
    """

    slots: int
    channels: int
    transducers: int

    @property
    def slot(self) -> np.dtype[Any]:
        """What is known of a frame: number, when it was taken (s, by the computer's clock), its instant (ns of device
        time), when it left (ns, 0 if it did not), the sensor's samples, pressure in Pa, flags, intensity, phases.
        """
        return np.dtype(
            [
                ("number", "i8"),
                ("taken", "f8"),
                ("instant", "i8"),
                ("left", "i8"),
                ("samples", "f8", (self.channels,)),
                ("pressure", "f8", (self.channels,)),
                ("flags", "u1"),
                ("intensity", "u1"),
                ("phases", "u1", (self.transducers,)),
            ],
            align=True,
        )

    @property
    def size(self) -> int:
        """In bytes."""
        return 8 * (len(_COUNTS) + len(_TIMES) * _BINS) + self.slots * self.slot.itemsize


class TouchRing:
    """A ring of frames; `LiveSession` makes one and hands it to the loop's process.

    Parameters
    ----------
    shape : RingShape
        How large.
    """

    def __init__(self, shape: RingShape) -> None:
        self.shape = shape
        self._memory: Any = get_context("spawn").RawArray("B", shape.size)
        self._view()

    def __getstate__(self) -> dict[str, Any]:
        """What another process gets: the same memory."""
        return {"shape": self.shape, "_memory": self._memory}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.shape, self._memory = state["shape"], state["_memory"]
        self._view()

    def _view(self) -> None:
        whole = np.frombuffer(self._memory, np.uint8)
        numbers = whole[: 8 * (len(_COUNTS) + len(_TIMES) * _BINS)].view(np.int64)
        self._counts = {name: numbers[place : place + 1] for place, name in enumerate(_COUNTS)}
        times = numbers[len(_COUNTS) :].reshape(len(_TIMES), _BINS)
        self._times: dict[str, NDArray[np.int64]] = dict(zip(_TIMES, times, strict=True))
        self.slots: NDArray[Any] = whole[numbers.nbytes :].view(self.shape.slot)

    def count(self, name: str) -> int:
        """How many so far: frames (held ones included), lost, late, gaps, unanswered, played, hurried."""
        return int(self._counts[name][0])

    def add(self, name: str, more: int = 1) -> None:
        """Count; the loop's."""
        self._counts[name][0] += more

    def put(self, name: str, value: int) -> None:
        """Set a count; the loop's."""
        self._counts[name][0] = value

    def time(self, name: str, seconds: float) -> None:
        """Note how long something took: work on a frame, or left, from its being taken to its leaving; the loop's."""
        self._times[name][min(max(int(seconds / STEP), 0), _BINS - 1)] += 1

    def histogram(self, name: str) -> NDArray[np.int64]:
        """How many took so long, shape (bin,), in bins of `STEP`; the last holds all that took longer."""
        return self._times[name].copy()

    def next_slot(self) -> Any:
        """The slot that the loop writes next; `publish` makes it seen."""
        return self.slots[self.count("head") % self.shape.slots]

    def publish(self) -> None:
        """The next slot is written."""
        self._counts["head"][0] += 1

    def end(self) -> None:
        """Ask the loop to end in order."""
        self._counts["ends"][0] = 1

    @property
    def ends(self) -> bool:
        """Whether it was asked to end."""
        return bool(self._counts["ends"][0])

    def since(self, seen: int) -> tuple[NDArray[Any], int, int]:
        """Frames from a number on: a copy of them, where to go on, and how many were overwritten before they were read.

        Parameters
        ----------
        seen : int
            Frames that were read before, counted from the start.
        """
        head, slots = self.count("head"), self.shape.slots
        first = max(seen, head - slots)
        found = self.slots[np.arange(first, head) % slots]
        # What the loop wrote over while this copied is not what it was; one more is being written now.
        torn = max(first, self.count("head") - slots + 1) - first
        torn = min(max(0, torn), len(found)) if self.count("head") > slots else 0
        return found[torn:], head, first - seen + torn
