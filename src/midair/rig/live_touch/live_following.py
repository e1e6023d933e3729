"""Live frames that follow a palm: phases to add, and a gain that is 0 where the palm is not followed."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from midair.devices import Tracker
from midair.model import Drive, TransducerArray
from midair.rig.live_touch.live_settings import LiveSettings
from midair.rig.playing import Follower, FollowRules


class LiveSteering:
    """Steers frames to the palm of an open tracker as `Follower` does, to its centre; `report` gets one line a change.

    The exposure check of live touch holds for any phases, and therefore for steered frames.
    """

    def __init__(
        self,
        tracker: Tracker,
        array: TransducerArray,
        rate: float,
        order: LiveSettings,
        report: Callable[[str], object],
    ) -> None:
        rules = FollowRules(confidence=order.confidence, fit=False)
        frames = max(1, round(rules.block * rate))
        phase, level = np.zeros((frames, array.count)), np.ones(frames)
        still = Drive(phase=phase, level=level, rate=rate, array=array, acoustics=order.acoustics)
        self._follower = Follower(tracker, still, order.grid, rules=rules, report=report)
        self._rate, self._all, self._later = rate, slice(0, frames), np.arange(frames) / rate
        self._steps = np.zeros((frames, array.count), np.uint8)
        self._gains, self._begin = np.zeros(frames), -np.inf
        self.phases: NDArray[np.uint8] = np.zeros(array.count, np.uint8)
        """Phases of the last frame in steps of 2 pi / 256, steered."""

    def steer(self, phases: NDArray[np.uint8], at: float) -> float:
        """Steer the next frame, which sounds at a time of `time.monotonic`, into `phases`; return its gain."""
        if not 0 <= (at - self._begin) * self._rate < len(self._gains) - 0.5:
            drive, _ = self._follower.steered(self._all, at + self._later)
            np.copyto(self._steps, np.rint(drive.phase * (128 / np.pi)).astype(np.int64), casting="unsafe")
            self._gains, self._begin = np.asarray(drive.level), at
        row = round((at - self._begin) * self._rate)
        # 256 steps are one turn, so that the overflow of a byte is harmless.
        np.add(phases, self._steps[row], out=self.phases)
        return float(self._gains[row])
