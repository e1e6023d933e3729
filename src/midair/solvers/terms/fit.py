"""Where the error is measured: control points (paper, eq. 5), windows over the whole square, or the cells of a sensor.

A sensor measures one number per cell and frame; the control points are interpolated from them. Windows and cells
compare ``w_c^T |G q|^2`` with a mean pressure, where w_c is the share of each point in window or cell c. Cells hold for
one place of the sensor: 2 mm beside it the pressure between the cells is not controlled. Windows of the size of a cell,
at a third of the cells' pitch, give the reading of any cell at any place of the sensor. The squared field is
band-limited, so the weights are exact with the control points as samples; the target of a window is the exact mean of
the linearly interpolated pressure.
"""

from abc import abstractmethod
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from midair.array_types import Array
from midair.errors import InputError
from midair.model import ControlGrid, PressureFrames, SensorGrid, Setting
from midair.physics import SensorModel, cell_weights, radiation_pressure
from midair.solvers.backend import Numbers, Rows, squares
from midair.solvers.terms.term import Term
from midair.validation import frozen_array, positive

if TYPE_CHECKING:
    from midair.solvers.problem import Problem
    from midair.solvers.solve_plan import NormalisedSetup


class PressureMeans(Term):
    """Mean pressures, in place of amplitudes at the control points, as the target."""

    __slots__ = ()
    keyword = "fit"
    help = "Where the error is measured: control points, windows of 8 or 5.5 mm, or sensor cells."
    methods = frozenset({"fast", "glide", "free"})
    default = "points"
    values = Literal["points", "windows", "fine-windows", "cells"]
    name = "cells"
    instead = "fit points"

    @classmethod
    def setting(cls) -> Any:
        """A name, `Windows` or `Cells`."""
        return Fit

    @classmethod
    def of(cls, value: "Fit") -> "Windows | Cells | None":
        """The term of this fit; None for "points"."""
        if isinstance(value, Windows | Cells):
            return value
        match value:
            case "points":
                return None
            case "windows":
                return Windows()
            case "fine-windows":
                return Windows.fine()
            case "cells":
                return Cells()
        raise InputError(
            f"fit: expected points, windows, fine-windows, cells, Windows(...) or Cells(...), got {value!r}"
        )

    @classmethod
    def number(cls, value: "Fit") -> Any:
        """The fit itself."""
        return value

    @classmethod
    def noted(cls, value: "Fit") -> dict[str, Setting]:
        """Name of the fit."""
        return {"fit": value if isinstance(value, str) else type(value).__name__.lower()}

    def added(self, problem: "Problem", setup: "NormalisedSetup") -> "Problem":
        """The problem with the weights and target pressures."""
        unit = float(radiation_pressure(np.array(setup.focus), setup.airs[0].medium))
        return replace(problem, cells=self.target(setup.target.amplitude / setup.focus, setup.target.grid, unit))

    @abstractmethod
    def target(self, amplitude: Array, grid: ControlGrid, unit: float) -> "CellTarget":
        """The weights and target pressures for an amplitude (frame, point) in units of the focus.

        `unit` is the radiation pressure in Pa of an amplitude of 1.
        """


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells(PressureMeans):
    """Cells of a sensor, and optionally their target pressures."""

    sensor: SensorModel = field(default_factory=SensorModel)
    """Its grid, aperture and spread give the weights."""
    pressure: PressureFrames | None = None
    """Target pressure of the cells, 0 or more, in Pa. If None, it is computed from the target at the control points."""

    def target(self, amplitude: Array, grid: ControlGrid, unit: float) -> "CellTarget":
        """As `PressureMeans.target`; ShapeError if `pressure` has other frames or cells."""
        # Radiation pressure is proportional to the squared amplitude and interpolated linearly.
        wanted = amplitude**2 @ cell_weights(self.sensor, grid, centre=grid.centre, between="lines").T
        if self.pressure is not None:
            given = self.pressure.pressure.reshape(self.pressure.frames, -1)
            wanted = frozen_array(given / unit, "pressure of the cells", wanted.shape)
        return CellTarget(weights=cell_weights(self.sensor, grid, centre=grid.centre, between="waves"), wanted=wanted)


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows(PressureMeans):
    """Windows over the control points; 13 x 13 over the paper's 16 x 16."""

    aperture: float = 8e-3
    """Side of the square over which a window averages, in m."""
    spread: float = 1e-3
    """Standard deviation in m of the Gaussian with which skin, or gel, spreads a point of pressure."""
    pitch: float = 11e-3 / 3
    """Distance between windows in m; below half the aperture the windows leave no gaps."""
    inset: float = 5.5e-3
    """Distance in m from the outermost control points, with pressure zero, to the middle of the outermost windows."""
    faint: float = 1e-3
    """Smallest pressure, over that of the focus, to which errors are relative: that of 996 transducers with random
    phases.
    """

    def __post_init__(self) -> None:
        for name in ("aperture", "spread", "pitch", "inset"):
            positive(getattr(self, name), f"{name} of the windows", "m")

    @classmethod
    def fine(cls) -> "Windows":
        """Windows of half a cell, which overlap by half; 19 x 19 over the paper's 16 x 16 points."""
        return cls(aperture=5.5e-3, pitch=2.75e-3, inset=2.75e-3)

    def places(self, grid: ControlGrid) -> SensorModel:
        """The windows over a control grid, as the cells of a sensor."""
        rows, columns = (self._count(points, grid.pitch) for points in (grid.rows, grid.columns))
        sensor = SensorGrid(rows=rows, columns=columns, pitch=self.pitch, name="windows")
        return SensorModel(grid=sensor, aperture=self.aperture, spread=self.spread)

    def target(self, amplitude: Array, grid: ControlGrid, unit: float) -> "CellTarget":  # noqa: ARG002
        """As `PressureMeans.target`."""
        places = self.places(grid)
        # Radiation pressure is proportional to the squared amplitude.
        wanted = amplitude**2 @ cell_weights(places, grid, centre=grid.centre, between="lines").T
        weights = cell_weights(places, grid, centre=grid.centre, between="waves")
        return CellTarget(weights=weights, wanted=wanted, faint=self.faint)

    def _count(self, points: int, pitch: float) -> int:
        """Number of windows along an axis with this many control points."""
        free = (points - 1) * pitch - 2 * self.inset
        # 1e-9 keeps the last window despite rounding.
        return 1 + max(int(free / self.pitch + 1e-9), 0)


Fit = Literal["points", "windows", "fine-windows", "cells"] | Windows | Cells
"""Control points, as in the paper; windows of 8 or 5.5 mm over the square; or the cells of a sensor at one place."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellTarget:
    """Weights and target pressures of cells or windows in one problem."""

    weights: Array  # w, the share of each point, shape (cell, point)
    wanted: Array  # Target pressure in the unit of amplitude squared, shape (frame, cell)
    faint: float = 0.0  # Frames with an rms target below this report their error relative to this, in the same unit

    def error(self, size: Array) -> Array:
        """|| w |y|^2 - P || / || P || of each frame, from the field's magnitude (frame, point); 0 where P is 0."""
        norm = np.linalg.norm(self.wanted, axis=1)
        norm = np.where(norm > 0, np.maximum(norm, self.faint * np.sqrt(self.wanted.shape[1])), 0.0)
        missed = np.linalg.norm(size**2 @ self.weights.T - self.wanted, axis=1)
        return np.divide(missed, norm, out=np.zeros(len(norm)), where=norm > 0)


def cell_misfit(xp: Any, y: Rows, weights: Rows, wanted: Rows, scale: Numbers) -> tuple[Numbers, Rows]:
    """The cost scale || w |y|^2 - P ||^2 / 2 of each row, and its gradient by y, 2 scale (w^T (w |y|^2 - P)) y.

    `weights` (point, cell) is w transposed, `wanted` (row, cell) is P, `scale` (row,) is 1 / || P ||^2.
    """
    size = xp.abs(y)
    missed = (size * size) @ weights - wanted
    return 0.5 * scale * squares(xp, missed), y * ((2 * scale[:, None] * missed) @ weights.T)


def misfit(xp: Any, y: Rows, p: Rows) -> tuple[Numbers, Rows]:
    """|| |y| - p ||^2 / 2 of each row (row,), and its gradient by y, (|y| - p) y / |y| (row, point); y is overwritten.

    At the best phases u of the target || y - diag(p) u || is || |y| - p ||. d cost = Re(conj(slope) dy).
    """
    size = xp.abs(y)
    missed = size - p
    # The direction at an exactly silent point is undefined; 0 is used.
    y *= missed / (size + xp.finfo(size.dtype).smallest_normal)
    return 0.5 * squares(xp, missed), y
