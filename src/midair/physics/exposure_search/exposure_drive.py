"""Frames of a drive as the searches want them: real parts, imaginary parts and the sums of both."""

import numpy as np
from numpy.typing import NDArray

from midair.model import Drive
from midair.physics.exposure_search.exposure_products import Workspace

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Indices = NDArray[np.intp]


def drive_parts(
    drive: Drive,
    frames: slice | Indices,
    space: Workspace,
    order: Indices | None = None,
    *,
    steps: int | None = None,
) -> tuple[Single, Array]:
    """Some frames in single precision, and their level.

    Parameters
    ----------
    drive : Drive
        Of any phases.
    frames : slice or ndarray of int
        Which ones.
    space : Workspace
        Where they go.
    order : ndarray of int, shape (transducer,), optional
        Of the transducers; their own if None.
    steps : int, optional
        Of a turn, to which phases are rounded; as they are if None.

    Returns
    -------
    parts : ndarray of float32, shape (3, frame, transducer)
        A level that all transducers of a frame share is not yet in them.
    level : ndarray, shape (frame, 1) or (frame, transducer)
        In the drive's own order.
    """
    phase = np.asarray(drive.phase[frames])
    level = np.asarray(drive.level[frames]).reshape(len(phase), -1)
    parts, angle = space.array("parts", 3, *phase.shape), space.array("angle", *phase.shape)
    with np.errstate(over="ignore"):
        angle[:] = phase
    # Single precision has no digits to spare for turns: a file may hold any number of them.
    if max(angle.max(initial=0.0), -angle.min(initial=0.0)) > 64:
        angle[:] = np.remainder(phase, 2 * np.pi)
    if steps is not None:
        angle *= steps / (2 * np.pi)
        np.rint(angle, out=angle)
        angle *= 2 * np.pi / steps
    if order is not None:
        angle = np.take(angle, order, axis=1, out=space.array("ordered", *phase.shape), mode="clip")
    np.cos(angle, out=parts[0])
    np.sin(angle, out=parts[1])
    if level.shape[1] > 1:
        parts[:2] *= (level if order is None else level[:, order]).astype(np.float32)
    np.add(parts[0], parts[1], out=parts[2])
    return parts, level
