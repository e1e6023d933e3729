"""Mean pressure in overlapping windows of the size of a sensor cell, over the whole square.

Control points do not control the pressure between them, and the cells of a sensor do not control it between the cells.
Windows at a third of the cells' pitch give what any cell would read at any place of the sensor: ``w_c^T |G q|^2``, as
in `cells`. The squared field is band-limited, so the weights are exact with the control points as samples; the target
of a window is the exact mean of the linearly interpolated pressure.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.model import ControlGrid, SensorGrid
from midair.physics import SensorModel, cell_weights
from midair.solvers.terms.cells import CellTarget
from midair.validation import positive

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows:
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

    def places(self, grid: ControlGrid) -> SensorModel:
        """The windows over a control grid, as the cells of a sensor."""
        rows, columns = (self._count(points, grid.pitch) for points in (grid.rows, grid.columns))
        sensor = SensorGrid(rows=rows, columns=columns, pitch=self.pitch, name="windows")
        return SensorModel(grid=sensor, aperture=self.aperture, spread=self.spread)

    def target(self, amplitude: Array, grid: ControlGrid, unit: float) -> CellTarget:  # noqa: ARG002, as `Cells` has it
        """The weights and target pressures for an amplitude (frame, point) in units of the focus."""
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
