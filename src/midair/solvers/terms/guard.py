"""A guard ring: no hot spots next to the controlled square.

Nothing in the paper's error says what the field does outside the control points, and at moderate strength the loudest
place can be there. The term is one-sided, ``lambda sum max(|p| - kappa p_peak, 0)^2 / 2`` over the points of a ring
around the square: quiet is as good as quieter.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import ControlGrid
from midair.solvers.backend import Numbers, Rows, squares
from midair.validation import positive


@dataclass(frozen=True, slots=True, kw_only=True)
class Guard:
    """What is asked of the field around the square.

    Attributes
    ----------
    margin : float
        Width of the ring, in m.
    pitch : float, optional
        Distance between its points, in m; that of the control grid if None.
    ceiling : float
        kappa: part of the frame's loudest target that costs nothing.
    weight : float
        lambda, over the weight of a control point.
    """

    margin: float = 20e-3
    pitch: float | None = None
    ceiling: float = 0.3
    weight: float = 1.0

    def __post_init__(self) -> None:
        positive(self.margin, "margin of the guard", "m")
        positive(self.weight, "weight of the guard")
        if self.pitch is not None:
            positive(self.pitch, "pitch of the guard", "m")
        if not 0 <= self.ceiling < np.inf:
            raise InputError(f"ceiling of the guard: expected 0 or more of the target's peak, got {self.ceiling:g}")

    def ring(self, grid: ControlGrid) -> NDArray[np.float64]:
        """The points of the ring, shape (point, 3), in m.

        They lie on a larger grid around the same centre, less those that are no more than half a pitch outside the
        control points.

        Raises
        ------
        InputError
            If the margin is less than a pitch, so that there are none.
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
        # A nanometre more: points on the edge itself must not depend on rounding.
        ring = larger.position[(away > edge + 1e-9).any(axis=1)]
        if not len(ring):
            raise InputError(
                f"margin of the guard: expected at least its pitch, {1e3 * pitch:g} mm, got {1e3 * self.margin:g} mm"
            )
        return ring


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GuardField:
    """A guard of one problem.

    Attributes
    ----------
    G : ndarray of complex, shape (guard point, transducer)
        In the unit of the problem's G.
    ceiling : float or ndarray, shape (guard point,)
        As in `Guard`; 0 for rows that are to be as quiet as can be, see `terms.quiet_ears`.
    weight : float
        As in `Guard`.
    """

    G: NDArray[np.complex128]
    ceiling: float | NDArray[np.float64]
    weight: float

    @property
    def ceilings(self) -> NDArray[np.float64]:
        """Of each point, shape (guard point,)."""
        return np.array(np.broadcast_to(self.ceiling, len(self.G)), np.float64)

    def and_quiet(self, rows: NDArray[np.complex128], weight: float) -> "GuardField":
        """The same with rows that are to be as quiet as can be, with a weight of their own."""
        ceiling = np.concatenate([self.ceilings, np.zeros(len(rows))])
        # Above a ceiling of 0 is everything: what is left of the term is its square, which takes the weight in.
        G = np.concatenate([self.G, np.sqrt(weight / self.weight) * rows])
        return GuardField(G=G, ceiling=ceiling, weight=self.weight)


def excess(xp: Any, y: Rows, ceiling: Rows, weight: float) -> tuple[Numbers, Rows]:
    """The cost lambda sum max(|y| - c, 0)^2 / 2 of each row, and its gradient by y.

    Parameters
    ----------
    xp : module
        Module of the array API standard.
    y : array of complex, shape (row, guard point)
        The field on the ring.
    ceiling : array, shape (row, 1)
        c = kappa times the row's loudest target.
    weight : float
        lambda.

    Returns
    -------
    cost : array, shape (row,)
    slope : array of complex, shape (row, guard point)
        d cost = Re(conj(slope) dy).
    """
    size = xp.abs(y)
    above = xp.clip(size - ceiling, 0, None)
    # The smallest number keeps the slope at a silent point 0 instead of 0 / 0.
    return 0.5 * weight * squares(xp, above), y * (weight * above / (size + xp.finfo(size.dtype).smallest_normal))


def excess_rows(
    guard: GuardField, theta: NDArray[np.float64], level: float, peak: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The term as residuals, for methods of least squares: sqrt(lambda) (|y| - c) where that is above 0.

    Parameters
    ----------
    guard : GuardField
        The ring.
    theta : ndarray, shape (transducer,)
        Phases, in rad.
    level : float
        Drive of every transducer.
    peak : float
        The loudest target.

    Returns
    -------
    residual : ndarray, shape (active point,)
    slope : ndarray, shape (active point, transducer)
        Its derivative by theta: -sqrt(lambda) Im(conj(y) A G exp(j theta)) / |y|.
    """
    q = level * np.exp(1j * theta)
    y = guard.G @ q
    above = np.abs(y) - guard.ceiling * peak
    active = above > 0
    root = np.sqrt(guard.weight)
    turned = (y[active].conj() / np.abs(y[active]))[:, None] * guard.G[active] * q
    return root * above[active], -root * turned.imag


def _count(points: int, pitch: float, margin: float, new: float) -> int:
    """Points of the larger grid along one axis: as many as fit, and as odd or even as keeps them on the old grid."""
    half = (points - 1) / 2 * pitch + margin
    # 1e-9 keeps a margin of whole pitches from losing its outermost points to rounding.
    if np.isclose(pitch, new):
        return points + 2 * int(margin / pitch + 1e-9)
    return 2 * int(half / new + 1e-9) + 1
