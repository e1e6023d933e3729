"""An array of single frames that exists only here: for live touch without units."""

import time
from collections import deque

import numpy as np

from midair.devices.arrays import ImmediateArray, Silencer
from midair.devices.frame_bytes import Bytes
from midair.model import Placement


class VirtualUnits:
    """Takes frames and plays them to nobody; its clock is this computer's.

    Parameters
    ----------
    kept : int
        How many of the last frames it remembers, as (phases, intensity, instant).
    """

    emulated = True
    failsafe = 0.0

    def __init__(self, kept: int = 0) -> None:
        self.frames: deque[tuple[Bytes, int, int]] = deque(maxlen=kept)
        self._told: dict[str, int] = dict.fromkeys(("sent", "answered", "lost", "late", "crowded"), 0)
        self._left = np.zeros(64, np.int64)
        self._number = 0

    def set_silencer(self, silencer: Silencer) -> None:
        """Nothing to spread."""

    def now(self) -> int:
        """Device time, in ns."""
        return time.monotonic_ns()

    def put(self, phases: Bytes, intensity: int, instant: int) -> None:
        """Take a frame, unless its instant has gone by."""
        number, self._number = self._number, self._number + 1
        now = self._left[number % 64] = time.monotonic_ns()
        if now >= instant:
            self._left[number % 64] = 0
            self._told["late"] += 1
            return
        self._told["sent"] += 1
        self._told["answered"] += 1
        if self.frames.maxlen:
            self.frames.append((phases.copy(), intensity, instant))

    def sent(self, number: int) -> int:
        """When a frame was taken, in ns of `time.monotonic_ns`."""
        return int(self._left[number % 64])

    def told(self) -> dict[str, int]:
        """What became of all frames."""
        return dict(self._told)

    def state(self) -> None:
        """NoArguments: there is nobody to ask."""

    def silence(self) -> None:
        """A silent frame at once."""
        if self.frames:
            phases, _, _ = self.frames[-1]
            self.frames.append((np.zeros_like(phases), 0, time.monotonic_ns()))

    def release(self) -> None:
        """Nothing to release."""

    def describe(self) -> dict[str, str]:
        """What there is."""
        return {"units": "virtual, heard by nobody"}

    def close(self) -> None:
        """Nothing to let go of."""


def virtual_immediate(
    placement: Placement | None = None, *, hold: float = 0.006, units: VirtualUnits | None = None
) -> ImmediateArray:
    """An immediate array that nobody can hear; its units may be one's own, to look at what they got."""
    own = units or VirtualUnits()
    return ImmediateArray(
        lambda _: own, placement or Placement.grid(), name="virtual", hold=hold, simulated=True, gated=False
    )
