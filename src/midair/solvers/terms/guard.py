"""Guard ring: limit the field next to the controlled square.

The error of the paper does not include the field outside the control points, where the loudest place can be at moderate
strength. The term is one-sided, ``lambda sum max(|p| - kappa p_peak, 0)^2 / 2`` over the points of a ring around the
square.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import ControlGrid
from midair.validation import positive


@dataclass(frozen=True, slots=True, kw_only=True)
class Guard:
    """Settings of the guard ring."""

    margin: float = 20e-3
    """Width of the ring in m."""
    pitch: float | None = None
    """Distance between its points in m; that of the control grid if None."""
    ceiling: float = 0.3
    """kappa: fraction of the frame's loudest target below which the field costs nothing."""
    weight: float = 1.0
    """lambda, relative to a control point."""

    def __post_init__(self) -> None:
        positive(self.margin, "margin of the guard", "m")
        positive(self.weight, "weight of the guard")
        if self.pitch is not None:
            positive(self.pitch, "pitch of the guard", "m")
        if not 0 <= self.ceiling < np.inf:
            raise InputError(f"ceiling of the guard: expected 0 or more of the target's peak, got {self.ceiling:g}")

    def points(self, grid: ControlGrid, middle: tuple[float, float] | None = None) -> NDArray[np.float64]:
        """The points of the ring, shape (point, 3), in m, at least half a pitch from the control grid.

        With a `middle` (x, y) in m near that of the grid they are symmetric about it: a ring that is closer by the
        distance of the middles, so that on no side it is farther away.
        Raises InputError if the margin is less than a pitch, so that the ring is empty.
        """
        pitch = self.pitch or grid.pitch
        larger = ControlGrid(
            rows=_count(grid.rows, grid.pitch, self.margin, pitch),
            columns=_count(grid.columns, grid.pitch, self.margin, pitch),
            pitch=pitch,
            height=grid.height,
            centre=grid.centre,
        )
        away = np.abs(larger.position[:, :2] - np.asarray(grid.centre))
        edge = (np.array([grid.columns, grid.rows]) - 1) * grid.pitch / 2 + grid.pitch / 2
        # One nanometre of margin, so that points on the edge do not depend on rounding.
        ring = larger.position[(away > edge + 1e-9).any(axis=1)]
        if not len(ring):
            raise InputError(
                f"margin of the guard: expected at least its pitch, {1e3 * pitch:g} mm, got {1e3 * self.margin:g} mm"
            )
        if middle is not None:
            from_middle = ring[:, :2] - grid.centre
            closer = np.abs(np.subtract(middle, grid.centre))
            ring[:, :2] = middle + from_middle - np.sign(from_middle) * closer
        return ring

    def count(self, grid: ControlGrid) -> int:
        """Number of points."""
        return len(self.points(grid))


def _count(points: int, pitch: float, margin: float, new: float) -> int:
    """Points of the larger grid along one axis, of the same parity as the old grid so that old points stay on it."""
    half = (points - 1) / 2 * pitch + margin
    # 1e-9 keeps the outermost points of a margin of whole pitches despite rounding.
    if np.isclose(pitch, new):
        return points + 2 * int(margin / pitch + 1e-9)
    return 2 * int(half / new + 1e-9) + 1
