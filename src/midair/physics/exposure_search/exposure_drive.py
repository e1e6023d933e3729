"""Convert frames of a drive for the search: real parts, imaginary parts and their sums."""

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
    """Some frames as float32 (3, frame, transducer), and their level (frame, 1) or (frame, transducer).

    A level common to all transducers of a frame is not yet included in the parts. `order` permutes the transducers of
    the parts; `steps` rounds phases to that many steps per turn.
    """
    phase = np.asarray(drive.phase[frames])
    level = np.asarray(drive.level[frames]).reshape(len(phase), -1)
    parts, angle = space.array("parts", 3, *phase.shape), space.array("angle", *phase.shape)
    with np.errstate(over="ignore"):
        angle[:] = phase
    # Remove whole turns, which would cost digits in single precision; files may contain any phase.
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
