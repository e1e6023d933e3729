"""Radiation pressure on a palm that moves while an array plays."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.model import Acoustics, PalmPath, TransducerArray
from midair.physics.playback import Spread
from midair.physics.playback_chain import Precision, Waves
from midair.physics.propagation import transfer_matrix
from midair.physics.steering import on_the_palm, pose_of, poses_at, steering_phase

NEAR = (4e-3, 1.0)
"""Motion in m, and rotation in degrees, over which the field is interpolated; errors stay below -60 dB."""


class MovingSpread:
    """Map from drives to the pressure at points that move with a palm, like `Spread` for points at rest.

    Each transducer's phase at the centre of the palm is exact at every step; the rest of the transfer matrix changes
    slowly, and is interpolated between poses. `points`, shape (point, 3), lie on the palm in its solved place, whose
    centre is `solved`, shape (3,), in m. `path` begins at the first step, and its last pose holds; `rate` is in Hz.
    """

    def __init__(
        self,
        points: NDArray[np.float64],
        array: TransducerArray,
        acoustics: Acoustics,
        *,
        solved: NDArray[np.float64],
        path: PalmPath,
        rate: float,
        precision: Precision = "single",
    ) -> None:
        self._array, self._acoustics, self._solved, self._path, self._rate = array, acoustics, solved, path, rate
        self._points = points
        self._precision: Precision = precision
        self._known: dict[bytes, Spread] = {}

    def pressure(self, q: Waves, first: int) -> Array:
        """Radiation pressure of drives (step, transducer) from step `first` on, shape (step, point), in Pa."""
        # A step is at the end of its interval.
        poses = poses_at(self._path, (first + 1 + np.arange(len(q))) / self._rate)
        phase = -steering_phase(self._array, self._acoustics.medium, self._solved, poses)
        out = np.empty((len(q), len(self._points)))
        for begin, end in pairwise(_knots(poses)):
            steps = slice(begin, end + 1 if end == len(q) - 1 else end)
            out[steps] = self._between(q[steps], phase[steps], poses, phase[[begin, end]], (begin, end))
        return out

    def _between(self, q: Waves, phase: Array, poses: PalmPath, at: Array, ends: tuple[int, int]) -> Array:
        """Pressure of consecutive steps between two poses, whose phases at the centre of the palm are `at`."""
        spreads = [self._at(poses, end) for end in ends]
        first, last = (
            (q * np.exp(1j * (phase - each))).astype(spread.G.dtype) @ spread.G
            for spread, each in zip(spreads, at, strict=True)
        )
        share = np.arange(len(q))[:, None] / max(ends[1] - ends[0], 1)
        field = first + share * (last - first)
        return spreads[0].factor * np.asarray(field.real**2 + field.imag**2, np.float64)

    def _at(self, poses: PalmPath, number: int) -> Spread:
        """Map from drives to the field at one pose."""
        one = pose_of(poses, number)
        if (known := one.rotation.tobytes() + one.centre.tobytes()) not in self._known:
            here = on_the_palm(self._points, self._solved, one)[0]
            G = transfer_matrix(here, self._array, acoustics=self._acoustics)
            # Two poses are enough: one stretch ends where the next begins.
            self._known = dict([*self._known.items()][-1:])
            self._known[known] = Spread.of(G, self._acoustics.medium, None, self._precision)
        return self._known[known]


def _knots(poses: PalmPath) -> list[int]:
    """Steps between which the palm moves by `NEAR` at most, the first and the last included."""
    way = np.linalg.norm(np.diff(poses.centre, axis=0), axis=1) / NEAR[0]
    turn = sum(np.linalg.norm(np.diff(each, axis=0), axis=1) for each in (poses.normal, poses.fingers))
    passed = np.concatenate([[0.0], np.cumsum(way + turn / np.radians(NEAR[1]))])
    last = len(passed) - 1
    inside = np.searchsorted(passed, np.arange(1, int(passed[-1]) + 1))
    return [0, *sorted({int(each) for each in inside} - {0, last}), last]
