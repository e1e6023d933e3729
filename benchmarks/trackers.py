"""Prediction of recorded palms over the latency of a tracker: error, distortion and jitter.

The recordings (folder --data, or $MIDAIR_PALM_POSES) are turned and moved so that the median centre is (0, 0, 200 mm)
and the mean normal -z. Poses arrive `latency` after their time; the path is predicted every millisecond. The signal to
distortion (SDR) follows from the error by a table of a towel's stroke (docs/follow.md), as the median over pieces of
1 s. Jitter is the rms of the path's part above 20 Hz, which is felt.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np

from midair.devices import DAMPED_VELOCITY, MotionModel, PosePredictor
from midair.files import load_palm_path
from midair.model import PalmPath, TrackerPlacement

RECORDINGS = {"HandSplay": "HandSplay-110fps.csv", "Waiting": "Waiting-110fps.csv", "flapping": "flapping.csv"}
STEP, START = 1e-3, 0.3
SIDEWAYS = ([2e-3, 5e-3, 10e-3], [16.5, 7.2, 1.9])
HEIGHT = ([2e-3, 5e-3, 10e-3, 20e-3], [23.2, 15.1, 9.3, 4.6])
"""Error in m, and the SDR in dB that it leaves without steering."""

# A decay time of 1000 s is none; larger ones lose digits to cancellation.
CONSTANT_VELOCITY = MotionModel(damping=1e3, memory=1e-4, agility=7.2e7)
CONSTANT_ACCELERATION = MotionModel(damping=1e4, memory=1e3, agility=5.0e4)


def at_the_array(palm: PalmPath, *, scale: float = 1.0) -> PalmPath:
    """The recording with its median centre at (0, 0, 200 mm) and its mean normal at -z."""
    z = -palm.normal.mean(axis=0)
    z /= np.linalg.norm(z)
    y = palm.fingers.mean(axis=0)
    y -= (y @ z) * z
    y /= np.linalg.norm(y)
    turned = TrackerPlacement(rotation=np.stack([np.cross(y, z), y, z])).path(palm)
    centre = (turned.centre - np.median(turned.centre, axis=0)) * scale + [0, 0, 0.2]
    return PalmPath(
        time=turned.time,
        centre=centre,
        normal=turned.normal,
        fingers=turned.fingers,
        confidence=turned.confidence,
    )


class Held:
    """The last pose."""

    def add(self, poses: PalmPath) -> None:
        self.last = poses.centre[-1]

    def at(self, times: np.ndarray) -> np.ndarray:
        return np.tile(self.last, (len(times), 1))


class Mixed:
    """Several models, weighted by the inverse of their squared errors of the last .1 s, two poses ahead."""

    def __init__(self, models: list[MotionModel], smoothing: float) -> None:
        self.filters = [PosePredictor(model, smoothing=smoothing) for model in models]
        self.ahead = [PosePredictor(model, smoothing=0.0) for model in models]
        self.error = np.zeros(len(models))
        self.time = -np.inf

    def add(self, poses: PalmPath) -> None:
        for at in range(len(poses.time)):
            one = part(poses, slice(at, at + 1))
            if np.isfinite(self.time):
                keep = np.exp(-(one.time[0] - self.time) / 0.1)
                missed = [((each.at(one.time).centre - one.centre) ** 2).sum() for each in self.ahead]
                self.error = keep * self.error + (1 - keep) * np.array(missed)
                for each in self.ahead:
                    each.add(self.before)
            else:
                for each in self.ahead:
                    each.add(one)
            self.time, self.before = one.time[0], one
        for each in self.filters:
            each.add(poses)

    def at(self, times: np.ndarray) -> np.ndarray:
        weight = (self.error + 0.05e-3**2) ** -2.0
        weight /= weight.sum()
        return sum(share * each.at(times).centre for share, each in zip(weight, self.filters, strict=True))


class OneModel:
    def __init__(self, model: MotionModel, smoothing: float) -> None:
        self.filter = PosePredictor(model, smoothing=smoothing)
        self.add = self.filter.add

    def at(self, times: np.ndarray) -> np.ndarray:
        return self.filter.at(times).centre


def filters(smoothing: float) -> dict:
    return {
        "held": Held(),
        "constant velocity": OneModel(CONSTANT_VELOCITY, smoothing),
        "constant acceleration": OneModel(CONSTANT_ACCELERATION, smoothing),
        "damped velocity": OneModel(DAMPED_VELOCITY, smoothing),
        "mixed": Mixed([CONSTANT_VELOCITY, CONSTANT_ACCELERATION, DAMPED_VELOCITY], smoothing),
    }


def part(palm: PalmPath, which: slice) -> PalmPath:
    return PalmPath.from_rows(palm.rows[which])


def followed(palm: PalmPath, predictor, latency: float) -> tuple[np.ndarray, np.ndarray]:
    """Predicted and true centres every millisecond."""
    times = np.arange(palm.time[0] + START, palm.time[-1], STEP)
    arrived = np.searchsorted(palm.time, times - latency + 1e-9, "right")
    predictor.add(part(palm, slice(0, arrived[0])))
    found = [predictor.at(times[:1])]
    for at in range(1, len(times)):
        if arrived[at] > arrived[at - 1]:
            predictor.add(part(palm, slice(arrived[at - 1], arrived[at])))
        found.append(predictor.at(times[at : at + 1]))
    true = np.stack([np.interp(times, palm.time, axis) for axis in palm.centre.T], axis=1)
    return np.concatenate(found), true


def distortion(error: np.ndarray, table) -> np.ndarray:
    """Distortion relative to the signal: by the table, with the square of the error below it."""
    distances, levels = np.array(table[0]), -np.array(table[1])
    level = np.interp(np.log(np.maximum(error, 1e-9)), np.log(distances), levels)
    below = error < distances[0]
    return np.where(below, 10 ** (levels[0] / 10) * (error / distances[0]) ** 2, 10 ** (level / 10))


def sdr(error: np.ndarray) -> float:
    """SDR in dB, the median over pieces of 1 s."""
    total = distortion(np.hypot(error[:, 0], error[:, 1]), SIDEWAYS) + distortion(np.abs(error[:, 2]), HEIGHT)
    pieces = np.array_split(total, max(1, round(len(total) * STEP)))
    return float(np.median([-10 * np.log10(piece.mean()) for piece in pieces]))


def jitter(path: np.ndarray) -> float:
    """Rms above 20 Hz in m, with a Hann window against the ends."""
    window = np.hanning(len(path))[:, None]
    line = np.linspace(0, 1, len(path))[:, None]
    spectrum = np.fft.rfft((path - path[0] - line * (path[-1] - path[0])) * window, axis=0)
    high = np.fft.rfftfreq(len(path), STEP) > 20
    return float(np.sqrt(2 * (np.abs(spectrum[high]) ** 2).sum() / len(path) / (window**2).sum()))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.trackers", description=__doc__.splitlines()[0])
    parser.add_argument("--data", default=os.environ.get("MIDAIR_PALM_POSES", "../shared/data/palm-poses"))
    parser.add_argument("--recordings", nargs="*", default=list(RECORDINGS), choices=list(RECORDINGS))
    parser.add_argument("--latencies", type=float, nargs="*", default=[10, 20, 40], help="in ms")
    parser.add_argument("--smoothings", type=float, nargs="*", default=[0, 10, 17], help="in ms")
    given = parser.parse_args()
    print(
        "recording   latency  smoothing  filter                 rms x, y, z (all), mm      SDR, dB  jitter, mm (true)"
    )
    for name in given.recordings:
        palm = at_the_array(load_palm_path(Path(given.data) / RECORDINGS[name]))
        for latency in given.latencies:
            for smoothing in given.smoothings:
                for which, predictor in filters(smoothing * 1e-3).items():
                    if which == "held" and smoothing != given.smoothings[0]:
                        continue
                    path, true = followed(palm, predictor, latency * 1e-3)
                    error = path - true
                    rms = np.sqrt((error**2).mean(axis=0)) * 1e3
                    print(
                        f"{name:<11} {latency:4.0f} ms {smoothing:7.0f} ms  {which:<22} "
                        f"{rms[0]:5.2f} {rms[1]:5.2f} {rms[2]:5.2f} ({np.linalg.norm(rms):5.2f}) {sdr(error):10.1f} "
                        f"{jitter(path) * 1e3:10.3f} ({jitter(true) * 1e3:.3f})",
                        flush=True,
                    )


if __name__ == "__main__":
    main()
