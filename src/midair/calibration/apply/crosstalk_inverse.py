"""What cells feel of each other's pressure, undone."""

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import Crosstalk

Array = NDArray[np.float64]


def undo_matrix(crosstalk: Crosstalk, *, damping: float = 0.0) -> Array:
    """The matrix that turns what the cells felt into the pressure on each: (C^T C + d^2)^-1 (C^T + d^2).

    With d = 0 the inverse; a large damping d leaves the pressure as it is (Tikhonov, towards no crosstalk), so that
    nearly even cells do not turn noise into pressure.

    Parameters
    ----------
    crosstalk : Crosstalk
        C.
    damping : float
        d, 0 or more.

    Returns
    -------
    ndarray, shape (channel, channel)
        Multiply it with the felt pressure of all channels.

    Raises
    ------
    InputError
        If the damping is below 0, or the matrix cannot be inverted.
    """
    if not 0 <= damping < np.inf:
        raise InputError(f"damping: expected 0 or more, got {damping:g}")
    matrix, extra = crosstalk.matrix, damping**2 * np.eye(len(crosstalk.matrix))
    normal = matrix.T @ matrix + extra
    # C^T C has the square of C's condition.
    condition = float(np.sqrt(np.linalg.cond(normal)))
    if condition > 1e6:
        raise InputError(
            f"crosstalk: expected a matrix that can be inverted, got a condition of {condition:.2g}; give a damping"
        )
    return np.asarray(np.linalg.solve(normal, matrix.T + extra), np.float64)
