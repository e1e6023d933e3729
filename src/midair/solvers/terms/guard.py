"""Guard ring: limit the field next to the controlled square.

The error of the paper does not include the field outside the control points, where the loudest place can be at moderate
strength. The term is one-sided, ``lambda sum max(|p| - kappa p_peak, 0)^2 / 2`` over the points of a ring around the
square.
"""

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import ControlGrid, Setting
from midair.physics import transfer_matrix
from midair.solvers.backend import Numbers, Rows, squares
from midair.solvers.terms.term import Term
from midair.validation import positive

if TYPE_CHECKING:
    from midair.solvers.problem import Problem
    from midair.solvers.solve_plan import NormalisedSetup


@dataclass(frozen=True, slots=True, kw_only=True)
class Guard(Term):
    """Settings of the guard ring."""

    keyword = "guard"
    help = "Width of the quiet ring around the control points; 0mm switches it off."
    methods = frozenset({"lm", "fast", "glide", "free"})
    unit = "m"
    default = None
    values = float | None
    path = "guard.margin"

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

    @classmethod
    def of(cls, value: "float | Guard | None") -> "Guard | None":
        """The ring for its width in m or a configured ring."""
        return cls(margin=value) if isinstance(value, int | float) else value

    @classmethod
    def with_number(cls, value: "float | Guard | None", number: float) -> "Guard | None":
        """The ring with another width; None for 0."""
        return replace(value if isinstance(value, cls) else cls(), margin=number) if number else None

    @classmethod
    def noted(cls, value: "float | Guard | None") -> dict[str, Setting]:
        """All settings of the ring; none without a ring."""
        ring = cls.of(value)
        return {} if ring is None else {f"guard_{one.name}": getattr(ring, one.name) for one in fields(ring)}

    def added(self, problem: "Problem", setup: "NormalisedSetup") -> "Problem":
        """The problem with the field on the ring."""
        ring = self.ring(setup.target.grid)
        G = np.concatenate([transfer_matrix(ring, setup.array, acoustics=each) for each in setup.airs])
        return replace(problem, guard=GuardField(G=G / setup.focus, ceiling=self.ceiling, weight=self.weight))

    def quiet_rows(self, grid: ControlGrid) -> int:
        """Number of points of the ring."""
        return len(self.ring(grid))

    def ring(self, grid: ControlGrid) -> NDArray[np.float64]:
        """The points of the ring, shape (point, 3), in m, at least half a pitch from the control grid.

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
        return ring


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GuardField:
    """Transfer matrix and limits of the points that shall be quiet, in one problem."""

    G: NDArray[np.complex128]  # Complex, shape (guard point, transducer), in the unit of the problem's G
    # As in `Guard`, for all points or shape (guard point,); 0 for rows with minimal sound, see `terms.quiet_ears`
    ceiling: float | NDArray[np.float64]
    weight: float  # As in `Guard`

    @property
    def ceilings(self) -> NDArray[np.float64]:
        """Ceiling of each point, shape (guard point,)."""
        return np.array(np.broadcast_to(self.ceiling, len(self.G)), np.float64)

    def and_quiet(self, rows: NDArray[np.complex128], weight: float) -> "GuardField":
        """Add rows whose field shall be minimal, with their own weight."""
        ceiling = np.concatenate([self.ceilings, np.zeros(len(rows))])
        # With a ceiling of 0 the term is a plain square, so the weight can go into the rows.
        G = np.concatenate([self.G, np.sqrt(weight / self.weight) * rows])
        return GuardField(G=G, ceiling=ceiling, weight=self.weight)


def excess(xp: Any, y: Rows, ceiling: Rows, weight: float) -> tuple[Numbers, Rows]:
    """The cost lambda sum max(|y| - c, 0)^2 / 2 of each row (row,), and its gradient by y (row, guard point).

    y is the field on the ring, `ceiling` (row, 1) is c = kappa times the row's loudest target; d cost = Re(conj(slope)
    dy).
    """
    size = xp.abs(y)
    above = xp.clip(size - ceiling, 0, None)
    # The smallest number gives slope 0 instead of 0 / 0 at a silent point.
    return 0.5 * weight * squares(xp, above), y * (weight * above / (size + xp.finfo(size.dtype).smallest_normal))


def excess_rows(
    guard: GuardField, theta: NDArray[np.float64], level: float, peak: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The term as residuals for least squares: sqrt(lambda) (|y| - c) where positive, and their derivative by theta.

    Shapes (active point,) and (active point, transducer); the derivative is -sqrt(lambda) Im(conj(y) A G exp(j theta))
    / |y|.
    """
    q = level * np.exp(1j * theta)
    y = guard.G @ q
    above = np.abs(y) - guard.ceiling * peak
    active = above > 0
    root = np.sqrt(guard.weight)
    turned = (y[active].conj() / np.abs(y[active]))[:, None] * guard.G[active] * q
    return root * above[active], -root * turned.imag


def _count(points: int, pitch: float, margin: float, new: float) -> int:
    """Points of the larger grid along one axis, of the same parity as the old grid so that old points stay on it."""
    half = (points - 1) / 2 * pitch + margin
    # 1e-9 keeps the outermost points of a margin of whole pitches despite rounding.
    if np.isclose(pitch, new):
        return points + 2 * int(margin / pitch + 1e-9)
    return 2 * int(half / new + 1e-9) + 1
