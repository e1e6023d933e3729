"""Phases that move a solved field to a palm that lies elsewhere, the array relative to it, and its pressure."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.array_types import Array
from midair.model import Acoustics, ControlGrid, Drive, Medium, PalmPath, TransducerArray
from midair.physics.playback import Precision, Spread, Waves
from midair.physics.propagation import transfer_matrix, wavenumber

Points = NDArray[np.float64]


def middle_of(grid: ControlGrid) -> Points:
    """Centre of the palm that a grid of control points was solved for, shape (3,), in m; its normal is -z."""
    return grid.position.mean(axis=0)


def poses_at(path: PalmPath, time: Array) -> PalmPath:
    """Poses at other times: cubic between the poses, the first before them and the last after them.

    Linear interpolation would have a corner at each pose, which can be felt. `time` increases, in s.
    """
    # Imported here, since scipy.interpolate takes a fifth of a second.
    time = np.asarray(time, float)
    now = np.clip(time, path.time[0], path.time[-1])
    held = np.stack([path.centre, path.normal, path.fingers], axis=1)
    if len(path.time) > 1:
        between = scipy.interpolate.CubicSpline(path.time, held, bc_type="natural")(now)
    else:
        between = np.repeat(held, len(now), axis=0)
    centre, normal, fingers = np.moveaxis(between, 1, 0)
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    fingers = fingers - (fingers * normal).sum(axis=1, keepdims=True) * normal
    fingers = fingers / np.linalg.norm(fingers, axis=1, keepdims=True)
    before = np.maximum(np.searchsorted(path.time, time, side="right") - 1, 0)
    return PalmPath(time=time, centre=centre, normal=normal, fingers=fingers, confidence=path.confidence[before])


def pose_of(path: PalmPath, number: int) -> PalmPath:
    """One pose of a path, which is a path of length 1."""
    return PalmPath.from_rows(path.rows[[number]])


def on_the_palm(points: Points, solved: Points, poses: PalmPath) -> Points:
    """Points of the solved palm on the palms of these poses, shape (pose, point, 3), in m.

    `points` (point, 3) or (pose, point, 3) lie around the `solved` centre (3,), in m.
    """
    away = np.broadcast_to(points - solved, (len(poses.time), *points.shape[-2:]))
    return np.einsum("pxy,pmy->pmx", poses.rotation, away) + poses.centre[:, None]


def array_from_palm(array: TransducerArray, solved: Points, pose: PalmPath) -> TransducerArray:
    """The array as it lies relative to the palm of a pose, so that this palm is again in its solved place.

    Fields at the solved points, and phases solved for them, are those at the moved palm.
    """
    turned = pose.rotation[0]
    position = (array.position - pose.centre[0]) @ turned + solved
    return replace(array, position=position, normal=array.normal @ turned, name=f"{array.name}, palm moved")


def steering_phase(
    array: TransducerArray, medium: Medium, solved: Points, poses: PalmPath, *, aim: Points | None = None
) -> Array:
    """Phases in rad to add to frames that were solved for a palm in its solved place, shape (pose, transducer).

    -k (distance of each transducer to the aim on the palm now - distance to where the aim was): the sound of all
    transducers arrives there with the phases that it had. Beside the aim it does so approximately.

    `solved` is the centre (3,) of the palm that the frames were solved for, see `middle_of`; `aim` the place on it that
    is steered exactly, shape (3,) or (pose, 3), in m, such as from `aims_of`, the centre if None.
    """
    there = np.broadcast_to(solved if aim is None else aim, (len(poses.time), 3))
    here = on_the_palm(there[:, None], solved, poses)[:, 0]
    longer = _distance(array, here) - _distance(array, there)
    return np.asarray(-wavenumber(array, medium) * longer, np.float64)


def _distance(array: TransducerArray, points: Points) -> Array:
    # A norm of three columns takes half the time of one over the last axis.
    x, y, z = (points[:, None, axis] - array.position[:, axis] for axis in range(3))
    return np.sqrt(x * x + y * y + z * z)


CLOSE = (5e-4, 5e-3)
"""Motion of a palm in m, and change of its directions, below which a fit to it is kept, except at its centre."""


class PalmFit:
    """Phases that press a solved pattern on a palm that is tilted, turned or far away, beside those of steering.

    At 9 x 9 points of the palm the sound gets the amplitudes that were solved for; its phases there are free (Gerchberg
    and Saxton). The drive changes by the regularised inverse of the transfer matrix, then only its phases are kept. In
    single precision.
    """

    steps = 3
    """Changes of each fitted frame."""

    def __init__(self, array: TransducerArray, acoustics: Acoustics, grid: ControlGrid) -> None:
        self.solved, edge = middle_of(grid), np.ptp(grid.position, axis=0).max() / 2
        x, y = np.meshgrid(*[np.linspace(-1, 1, 9) * min(edge, 16.5e-3)] * 2)
        self._points = self.solved + np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
        self._array, self._acoustics, self._k = array, acoustics, wavenumber(array, acoustics.medium)
        # The magnitude changes so slowly that parabolas through 3 x 3 of the points are within a percent of it.
        at = np.linspace(-1, 1, 9)
        parabolas = np.stack([(at - 1) * at / 2, 1 - at * at, (at + 1) * at / 2], axis=1)
        self._parabolas = np.kron(parabolas, parabolas).astype(np.float32)
        self._few = np.arange(81).reshape(9, 9)[::4, ::4].ravel()
        self._still = np.asarray(transfer_matrix(self._points, array, acoustics=acoustics).T, np.complex64)
        self.pose: PalmPath | None = None
        """The pose that frames are fitted to; None to begin anew."""

    def move(self, pose: PalmPath) -> None:
        """Fit the following frames to the palm of a pose; within `CLOSE` of the last one that is the same fit."""
        before, self._beside = self.pose, np.zeros(self._array.count, np.float32)
        if before is not None and np.linalg.norm(pose.centre - before.centre) < CLOSE[0]:
            turned = max(np.abs(pose.normal - before.normal).max(), np.abs(pose.fingers - before.fingers).max())
            if turned < CLOSE[1]:
                # The sound of all transducers arrives at the centre with the phases that it had.
                here, there = (np.linalg.norm(self._array.position - each.centre, axis=1) for each in (pose, before))
                self._beside = (self._k * (here - there)).astype(np.float32)
                return
        self.pose, array = pose, self._array
        points = on_the_palm(self._points, self.solved, pose)[0]
        squares = (points**2).sum(axis=1)[:, None] + (array.position**2).sum(axis=1)
        squares -= 2 * points @ array.position.T
        turns = np.sqrt(squares, dtype=np.float32)
        turns *= np.float32(self._k)
        few = np.abs(transfer_matrix(points[self._few], array, acoustics=self._acoustics)).astype(np.float32)
        radiated, parts = self._parabolas @ few, np.empty((len(points), 2, array.count), np.float32)
        if not array.alike:
            turns += np.angle(array.response).astype(np.float32)
        np.multiply(radiated, np.cos(turns), out=parts[:, 0])
        np.multiply(radiated, np.sin(turns), out=parts[:, 1])
        self._conjugate = parts[:, 0] - 1j * parts[:, 1]
        self._matrix = np.ascontiguousarray(self._conjugate.conj().T)
        # Three real products take half the time of a complex one.
        both, crossed = parts.reshape(len(points), -1), parts[:, 1] @ parts[:, 0].T
        gram = both @ both.T + 1j * (crossed - crossed.T)
        gram.flat[:: len(gram) + 1] += np.float32(0.1) * gram.diagonal().real.mean()
        self._inverse = np.ascontiguousarray(np.linalg.inv(gram).T)

    def __call__(self, phase: Array, steered: Array) -> NDArray[np.complex64]:
        """Factors of magnitude 1 for the sound of each transducer in steered frames, shape (frame, transducer).

        `phase` and `steered` are the phases in rad as they were solved, and with those of steering added.
        """
        amplitude = np.abs(_turned(phase) @ self._still)
        q = begin = _turned(steered + self._beside)
        tiny = np.finfo(np.float32).tiny
        for _ in range(self.steps):
            field = q @ self._matrix
            lacks = field * (amplitude / (np.abs(field) + tiny) - 1)
            q = q + (lacks @ self._inverse) @ self._conjugate
            q /= np.abs(q) + tiny
        return q * begin.conj()


def _turned(phase: Array) -> NDArray[np.complex64]:
    """Sound of magnitude 1, ten times as fast as the exponential."""
    sound, angle = np.empty(phase.shape, np.complex64), phase.astype(np.float32)
    np.cos(angle, out=sound.real)
    np.sin(angle, out=sound.imag)
    return sound


def aims_of(drive: Drive, grid: ControlGrid, *, smooth: float = 0.05, block: int = 256) -> Points:
    """Where each frame presses: centre of the changing pressure at the control points, shape (frame, 3), in m.

    Pressure that does not change with time cannot be felt and does not count. The place is smoothed over about `smooth`
    seconds, so that the phases which follow from it change slowly.
    """
    G = np.asarray(transfer_matrix(grid, drive.array, acoustics=drive.acoustics).T, np.complex64)
    pressure = np.empty((drive.frames, grid.count), np.float32)
    for first in range(0, drive.frames, block):
        last = min(first + block, drive.frames)
        pressure[first:last] = np.abs(drive.q_of(slice(first, last)).astype(np.complex64) @ G) ** 2
    power = (pressure - pressure.mean(axis=0)) ** 2
    power = scipy.ndimage.gaussian_filter1d(power, smooth * drive.rate, axis=0, mode="nearest")
    total = power.sum(axis=1, keepdims=True)
    # Where nearly nothing presses, or changes by more than single precision, the aim returns to the centre.
    least = 1e-3 * total.max() + 1e-9 * float(np.square(pressure).sum(axis=1).max()) + 1e-30
    away = power @ (grid.position - middle_of(grid)) / (total + least)
    return np.asarray(away + middle_of(grid), np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseBox:
    """Poses to which frames may be steered, around the solved one."""

    size: tuple[float, float, float] = (0.1, 0.1, 0.06)
    """Edges of the box of the palm's centre along x, y and z, in m, around the solved centre."""
    tilt: float = float(np.radians(15.0))
    """Largest angle between the normal and the solved one, in rad."""

    def inside(self, poses: PalmPath, solved: Points) -> NDArray[np.bool_]:
        """Whether each pose is admitted, shape (pose,)."""
        near = (np.abs(poses.centre - solved) <= np.array(self.size) / 2 + 1e-9).all(axis=1)
        return near & (-poses.normal[:, 2] >= np.cos(self.tilt) - 1e-9)


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
