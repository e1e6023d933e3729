"""The palm that a tracker reports, for the pages: where it is, where it is predicted, and whether it is followed."""

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from midair.array_types import Array
from midair.devices import PosePredictor, Tracker
from midair.physics import PoseBox, pose_of
from midair.rig import FollowRules


class PalmWatch:
    """Sends the palm of an open tracker 15 times a second by `send`, which gets None at the end; closes the tracker."""

    def __init__(self, tracker: Tracker, solved: Array, send: Callable[[dict[str, Any] | None], object]) -> None:
        self.tracker = tracker
        self.said = deque[str](maxlen=64)
        """Lines of a play that follows the palm."""
        self._solved, self._send, self._box = solved, send, PoseBox()
        self._predictor, self._newest = PosePredictor(), -np.inf
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, name="palm", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End, and close the tracker."""
        self._ends.set()
        self._thread.join(5.0)
        self.tracker.close()
        self._send(None)

    def begin(self) -> None:
        """Set time 0 of replayed poses to now."""
        self._predictor, self._newest = PosePredictor(), -np.inf
        self.tracker.begin(time.monotonic())

    def _run(self) -> None:
        while not self._ends.wait(1 / 15):
            self._send(self.palm())

    def palm(self) -> dict[str, Any]:
        """The palm now, in mm and degrees, from the place for which the drive was solved."""
        status, new = self.tracker.status(), self.tracker.poses(self._newest)
        found: dict[str, Any] = {
            "tracker": self.tracker.name,
            "state": status.state,
            "rate": round(status.rate),
            "confidence": round(status.confidence, 2),
            "latency_ms": round(1e3 * status.latency, 1),
            "refused": dict(status.refused),
            "said": next((line[8:] for line in reversed(self.said) if line.startswith("follow: ")), ""),
            "solved": _mm(self._solved),
            "box": [1e3 * edge for edge in self._box.size],
            "place": None,
        }
        if new is not None:
            self._predictor.add(new)
            self._newest, self._seen = float(new.time[-1]), pose_of(new, -1)
        if not np.isfinite(self._newest):
            return found
        ahead = self._predictor.at(np.array([time.monotonic()]))
        x, _, z = self._seen.normal[0]
        return found | {
            "place": _mm(self._seen.centre[0]),
            "predicted": _mm(ahead.centre[0]),
            "tilt": round(float(np.degrees(np.arccos(np.clip(-z, -1, 1)))), 1),
            "lean": round(float(np.degrees(np.arctan2(x, -z))), 1),
            "inside": bool(self._box.inside(self._seen, self._solved)[0]),
            "sure": status.state == "tracking" and status.confidence >= FollowRules().confidence,
        }


def _mm(place: Array) -> list[float]:
    return [round(1e3 * float(each), 1) for each in place]
