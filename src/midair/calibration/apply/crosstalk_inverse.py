"""Inverse of the crosstalk between sensor cells."""

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import Calibration, Crosstalk

Array = NDArray[np.float64]


def undo_matrix(crosstalk: Crosstalk, *, damping: float = 0.0) -> Array:
    """Compute the damped inverse of a crosstalk matrix C: (C^T C + d^2)^-1 (C^T + d^2), shape (channel, channel).

    With a damping d = 0 this is the inverse. A large d leaves the pressure unchanged (Tikhonov regularisation towards
    no crosstalk), so that nearly identical rows do not amplify noise. Multiply the matrix with the pressures of all
    channels.

    Raises
    ------
    InputError
        If the damping is negative, or the matrix cannot be inverted.
    """
    if not 0 <= damping < np.inf:
        raise InputError(f"damping: expected 0 or more, got {damping:g}")
    matrix, extra = crosstalk.matrix, damping**2 * np.eye(len(crosstalk.matrix))
    normal = matrix.T @ matrix + extra
    # The condition number of C^T C is the square of that of C.
    condition = float(np.sqrt(np.linalg.cond(normal)))
    if condition > 1e6:
        raise InputError(
            f"crosstalk: expected an invertible matrix, got a condition number of {condition:.2g}; set a damping"
        )
    return np.asarray(np.linalg.solve(normal, matrix.T + extra), np.float64)


def crosstalk_inverse(calibration: Calibration, crosstalk: str, damping: float) -> Array | None:
    """Return the matrix that undoes a calibration's crosstalk, or None for crosstalk = "keep"."""
    if crosstalk == "keep":
        return None
    if crosstalk != "undo":
        raise InputError(f"crosstalk: expected keep or undo, got {crosstalk!r}")
    if calibration.crosstalk is None:
        raise InputError(
            "crosstalk: expected a calibration with a crosstalk matrix, got none; press on each cell alone"
        )
    return undo_matrix(calibration.crosstalk, damping=damping)
