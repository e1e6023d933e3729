"""Phases that move a solved field to a palm that lies elsewhere, and the array as it lies relative to that palm."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.model import ControlGrid, Drive, Medium, PalmPath, TransducerArray
from midair.physics.propagation import transfer_matrix, wavenumber
from midair.streaming import read_frames

Points = NDArray[np.float64]


def middle_of(grid: ControlGrid) -> Points:
    """Centre of the palm that a grid of control points was solved for, shape (3,), in m; its normal is -z."""
    return grid.position.mean(axis=0)


def poses_at(path: PalmPath, time: Array) -> PalmPath:
    """Poses at other times: cubic between the poses, the first before them and the last after them.

    Linear interpolation would have a corner at each pose, which can be felt. `time` increases, in s.
    """
    # Imported here, since scipy.interpolate takes a fifth of a second.
    from scipy.interpolate import CubicSpline

    time = np.asarray(time, float)
    now = np.clip(time, path.time[0], path.time[-1])
    held = np.stack([path.centre, path.normal, path.fingers], axis=1)
    if len(path.time) > 1:
        between = CubicSpline(path.time, held, bc_type="natural")(now)
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
    held = {name: getattr(path, name)[[number]] for name in ("time", "centre", "normal", "fingers", "confidence")}
    return PalmPath(**held)


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
    return np.linalg.norm(points[:, None] - array.position, axis=2)


def aims_of(drive: Drive, grid: ControlGrid, *, smooth: float = 0.05, block: int = 256) -> Points:
    """Where each frame presses: centre of the changing pressure at the control points, shape (frame, 3), in m.

    Pressure that does not change with time cannot be felt and does not count. The place is smoothed over about `smooth`
    seconds, so that the phases which follow from it change slowly.
    """
    # Imported here, since scipy.ndimage is needed by nothing else that plays.
    from scipy.ndimage import gaussian_filter1d

    G = np.asarray(transfer_matrix(grid, drive.array, acoustics=drive.acoustics).T, np.complex64)
    pressure = np.empty((drive.frames, grid.count), np.float32)
    for first in range(0, drive.frames, block):
        last = min(first + block, drive.frames)
        phase, level = read_frames(drive.phase, first, last), read_frames(drive.level, first, last)
        q = np.asarray(level.reshape(len(phase), -1) * np.exp(1j * phase), np.complex64)
        pressure[first:last] = np.abs(q @ G) ** 2
    power = gaussian_filter1d((pressure - pressure.mean(axis=0)) ** 2, smooth * drive.rate, axis=0, mode="nearest")
    total = power.sum(axis=1, keepdims=True)
    # Where nearly nothing presses, the aim returns to the centre.
    away = power @ (grid.position - middle_of(grid)) / (total + 1e-3 * total.max() + 1e-30)
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
