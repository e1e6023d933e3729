"""A simulated array for live touch, frame by frame."""

import time
from collections import deque

import numpy as np

from midair.devices.arrays import OUTCOMES, ImmediateArray, Silencer
from midair.devices.frame_bytes import Bytes
from midair.model import Placement


class VirtualUnits:
    """Accepts frames without sound; keeps the last `kept` of them as (phases, intensity, instant)."""

    emulated = True
    failsafe = 0.0

    def __init__(self, kept: int = 0) -> None:
        self.frames: deque[tuple[Bytes, int, int]] = deque(maxlen=kept)
        self._counts: dict[str, int] = dict.fromkeys(OUTCOMES, 0)
        self._sent_at = np.zeros(64, np.int64)
        self._number = 0

    def set_silencer(self, silencer: Silencer) -> None:
        """Do nothing: there is no silencer."""

    def now(self) -> int:
        """Device time, in ns."""
        return time.monotonic_ns()

    def put(self, phases: Bytes, intensity: int, instant: int) -> None:
        """Accept a frame, unless its instant has passed."""
        number, self._number = self._number, self._number + 1
        now = self._sent_at[number % 64] = time.monotonic_ns()
        if now >= instant:
            self._sent_at[number % 64] = 0
            self._counts["late"] += 1
            return
        self._counts["sent"] += 1
        self._counts["answered"] += 1
        if self.frames.maxlen:
            self.frames.append((phases.copy(), intensity, instant))

    def skip(self) -> None:
        """Do nothing: virtual units are never too hot."""

    def sent(self, number: int) -> int:
        """Time at which a frame was accepted, in ns of `time.monotonic_ns`."""
        return int(self._sent_at[number % 64])

    def told(self) -> dict[str, int]:
        """Number of frames by outcome."""
        return dict(self._counts)

    def state(self) -> None:
        """None: there are no units to query."""

    def silence(self) -> None:
        """Add a silent frame."""
        if self.frames:
            phases, _, _ = self.frames[-1]
            self.frames.append((np.zeros_like(phases), 0, time.monotonic_ns()))

    def release(self) -> None:
        """Do nothing: there is nothing to release."""

    def describe(self) -> dict[str, str]:
        """Description of the units."""
        return {"units": "virtual, without sound"}

    def close(self) -> None:
        """Do nothing: there is no connection to close."""


def virtual_immediate(
    placement: Placement | None = None, *, hold: float = 0.006, units: VirtualUnits | None = None
) -> ImmediateArray:
    """An immediate array without sound; pass `units` to inspect the frames that they received."""
    own = units or VirtualUnits()
    return ImmediateArray(
        lambda _: own, placement or Placement.grid(), name="virtual", hold=hold, simulated=True, gated=False
    )
