"""A hand that sways over the array, sent 100 times a second to a tracker, with a fault for a while."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]
Fault = Callable[[Values, float, float], "tuple[Values, float, float] | None"]
"""From values, time stamp and time since the fault to values, stamp and confidence; None for no pose."""
SOLVED = np.array([0.0, 0.0, 0.2])
LAST = 0.4
"""Default duration of a fault in s."""


def palm(at: float) -> Values:
    """A palm that sways by 10 mm once a second."""
    centre = SOLVED + np.array([0.01 * np.sin(2 * np.pi * at), 0.005 * np.cos(2 * np.pi * at), 0])
    return np.array([*centre, 0, 0, -1, 0, 1, 0])


class Hand:
    """Sends the palm 100 times a second, with a fault from a time on."""

    def __init__(self, sender: Any, fault: Fault, *, lasts: float = LAST, dies: bool = False) -> None:
        self._sender, self._fault, self._lasts, self._dies = sender, fault, lasts, dies
        self._ends, self.wrong_at = threading.Event(), np.inf
        self.wrong, self.right = np.inf, np.inf
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Hand:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        self._thread.join()

    def _run(self) -> None:
        last = np.inf
        while not self._ends.wait(0.01):
            stamp = time.monotonic()
            since = stamp - self.wrong_at
            if since >= 0 and self._dies:
                self.wrong = last
                self._sender.die()
                return
            told = self._fault(palm(stamp), stamp, since) if 0 <= since < self._lasts else (palm(stamp), stamp, 1.0)
            if since >= 0:
                self.wrong = min(self.wrong, last if told is None else stamp)
            if since >= self._lasts:
                self.right = min(self.right, stamp)
            if told is not None:
                self._sender.send(*told)
                last = stamp
