"""The paper's error: the magnitude of the field at the control points against the target (paper, eq. 5)."""

from typing import Any

from midair.solvers.backend import Numbers, Rows, squares


def misfit(xp: Any, y: Rows, p: Rows) -> tuple[Numbers, Rows]:
    """|| |y| - p ||^2 / 2 of each row, and its gradient by y: (|y| - p) y / |y|.

    At the best phases u of the target || y - diag(p) u || is || |y| - p ||.

    Parameters
    ----------
    xp : module
        Module of the array API standard.
    y : array of complex, shape (row, point)
        The field; overwritten.
    p : array, shape (row, point)
        Target, in the same unit.

    Returns
    -------
    cost : array, shape (row,)
    slope : array of complex, shape (row, point)
        d cost = Re(conj(slope) dy).
    """
    size = xp.abs(y)
    missed = size - p
    # A point that is exactly silent has no direction; any will do, none is taken.
    y *= missed / (size + xp.finfo(size.dtype).smallest_normal)
    return 0.5 * squares(xp, missed), y
