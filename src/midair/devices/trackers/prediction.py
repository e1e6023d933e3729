"""Prediction of the palm over the latency of its tracker, smooth between the poses, and replayed poses."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from midair.array_types import Array
from midair.devices.trackers.tracker import RawPose
from midair.errors import DeviceStateError
from midair.model import PalmPath

LONGEST = 0.1
"""Longest prediction, and longest gap between poses that a filter bridges, in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionModel:
    """Motion of each coordinate for a Kalman filter: position, velocity, and an acceleration that noise drives.

    The velocity decays with `damping`, the acceleration with `memory`, both in s (Singer's model without damping).
    """

    damping: float
    memory: float
    agility: float
    """Standard deviation of the noise, in 1/s^2.5 for a pose whose own standard deviation is 1."""

    def transition(self, after: float) -> Array:
        """Matrix (3, 3) from a state to the state `after` s."""
        velocity, memory = self.damping, self.memory
        lost_v, lost_a = -math.expm1(-after / velocity), -math.expm1(-after / memory)
        mixed = velocity * memory / (velocity - memory)
        return np.array(
            [
                [1.0, velocity * lost_v, mixed * (velocity * lost_v - memory * lost_a)],
                [0.0, 1 - lost_v, mixed * (lost_a - lost_v)],
                [0.0, 0.0, 1 - lost_a],
            ]
        )


DAMPED_VELOCITY = MotionModel(damping=0.063, memory=3.8e-3, agility=1.74e7)
"""The model that predicts best on the recording HandSplay (docs/follow.md)."""


@lru_cache(maxsize=1024)
def _step(model: MotionModel, ticks: int) -> tuple[Array, Array]:
    """Transition and covariance of the noise over a time in 0.1 ms."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    after = ticks * 1e-4
    column = np.array([model.transition(each)[:, 2] for each in (nodes + 1) * after / 2])
    noise = np.einsum("i,ij,ik->jk", weights * after / 2, column, column) * model.agility**2
    return model.transition(after), noise


class PosePredictor:
    """Predicts centre, normal and fingers by one Kalman filter.

    A new pose corrects the prediction; the correction is blended in over `smoothing` s from the last predicted time,
    without a step of position or velocity, since steps are felt; 0 for steps.
    """

    def __init__(self, model: MotionModel = DAMPED_VELOCITY, *, smoothing: float = 0.017) -> None:
        self.model, self.smoothing = model, smoothing
        self._time, self._confidence, self._shown = -np.inf, 0.0, -np.inf
        self._state, self._covariance = np.zeros((3, 9)), np.eye(3)
        self._blend = (-np.inf, np.zeros(9), np.zeros(9))

    def add(self, poses: PalmPath) -> None:
        """Take new poses into account, in order of time; those not later than the last one are ignored."""
        rows = np.column_stack([poses.centre, poses.normal, poses.fingers])
        later = np.flatnonzero(poses.time > self._time)
        if not len(later):
            return
        before = self._smoothed(self._shown) if np.isfinite(self._shown) else None
        for at in later:
            if poses.time[at] - self._time > LONGEST:
                self._state, self._covariance = np.zeros((3, 9)), np.diag([1.0, 1e8, 1e10])
                self._state[0], before = rows[at], None
            else:
                transition, noise = _step(self.model, max(1, round((poses.time[at] - self._time) * 1e4)))
                self._state = transition @ self._state
                covariance = transition @ self._covariance @ transition.T + noise
                gain = covariance[:, 0] / (covariance[0, 0] + 1.0)
                self._state = self._state + np.outer(gain, rows[at] - self._state[0])
                self._covariance = covariance - np.outer(gain, covariance[0])
            self._time, self._confidence = float(poses.time[at]), float(poses.confidence[at])
        self._blend = (-np.inf, np.zeros(9), np.zeros(9))
        if before is not None:
            after = self._smoothed(self._shown)
            self._blend = (self._shown, before[0] - after[0], before[1] - after[1])

    def at(self, times: Array) -> PalmPath:
        """Predicted poses at increasing times; the prediction ends 100 ms after the newest pose and holds.

        Raises DeviceStateError before the first pose.
        """
        if not np.isfinite(self._time):
            raise DeviceStateError("prediction of the palm: expected a pose first, got none")
        times = np.atleast_1d(np.asarray(times, np.float64))
        rows = np.array([self._smoothed(float(each))[0] for each in times])
        self._shown = float(times[-1])
        normal = rows[:, 3:6] / np.linalg.norm(rows[:, 3:6], axis=1, keepdims=True)
        fingers = rows[:, 6:9] - (rows[:, 6:9] * normal).sum(axis=1, keepdims=True) * normal
        fingers /= np.linalg.norm(fingers, axis=1, keepdims=True)
        confidence = np.full(len(times), self._confidence)
        return PalmPath.from_rows(np.column_stack([times, rows[:, :3], normal, fingers, confidence]))

    def _smoothed(self, time: float) -> tuple[Array, Array]:
        """Values (9,) at a time and their rates, with the rest of the last correction."""
        after = min(max(time - self._time, -LONGEST), LONGEST)
        values, rates, _ = self.model.transition(max(after, 0.0)) @ self._state
        # The model's decay would grow without end before the newest pose, so that the motion is linear there.
        values += min(after, 0.0) * self._state[1]
        rates *= time - self._time < LONGEST
        begin, offset, slope = self._blend
        if self.smoothing and math.isfinite(begin):
            # Cubic Hermite from the offset and its rate to zero and zero.
            part = min(max((time - begin) / self.smoothing, 0.0), 1.0)
            values += (1 - part) ** 2 * ((1 + 2 * part) * offset + part * self.smoothing * slope)
            rates += (1 - part) * ((1 - 3 * part) * slope - 6 * part / self.smoothing * offset)
        return values, rates


class ReplaySource:
    """Sends each pose, in the tracker's coordinates, `latency` s after its time, which counts from `begin`, once."""

    host_clock = True

    def __init__(self, palm: PalmPath, *, latency: float = 0.0) -> None:
        self.clock: Callable[[], float] = time.monotonic
        self._times, self._rows, self._latency = palm.time, palm.rows, latency
        self.begin(math.inf)

    def begin(self, at: float) -> None:
        """Set time 0 of the poses on the clock."""
        self._zero, self._next = at, 0

    def open(self) -> None:
        """Set time 0 to now."""
        self.begin(self.clock())

    def pull(self, wait: float) -> list[RawPose | str]:
        """Poses that have arrived."""
        if wait and self._next < len(self._times):
            left = self._zero + self._times[self._next] + self._latency - self.clock()
            time.sleep(float(np.clip(left, 0.0, wait)))
        elif wait:
            time.sleep(wait)
        end = int(np.searchsorted(self._times, self.clock() - self._zero - self._latency, "right"))
        first, self._next = self._next, max(end, self._next)
        return [
            RawPose(stamp=float(self._zero + row[0]), values=row[1:10], confidence=float(row[10]))
            for row in self._rows[first : self._next]
        ]

    def close(self) -> None:
        """Nothing to disconnect."""
