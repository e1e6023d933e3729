"""The error of the paper: magnitude of the field at the control points against the target (paper, eq. 5)."""

from typing import Any

from midair.solvers.backend import Numbers, Rows, squares


def misfit(xp: Any, y: Rows, p: Rows) -> tuple[Numbers, Rows]:
    """|| |y| - p ||^2 / 2 of each row (row,), and its gradient by y, (|y| - p) y / |y| (row, point); y is overwritten.

    At the best phases u of the target || y - diag(p) u || is || |y| - p ||. d cost = Re(conj(slope) dy).
    """
    size = xp.abs(y)
    missed = size - p
    # The direction at an exactly silent point is undefined; 0 is used.
    y *= missed / (size + xp.finfo(size.dtype).smallest_normal)
    return 0.5 * squares(xp, missed), y
