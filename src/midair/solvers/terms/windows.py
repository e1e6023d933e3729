"""What a hand feels as the target, wherever it lies: windows of the size of a cell, overlapping all over the square.

The control points leave open what presses between them, and the cells of a sensor leave open what presses beside that
one sensor. A window averages the pressure as a cell does; windows a third of the cells' pitch apart say what any cell
would read, wherever the sensor or a palm lies: ``w_c^T |G q|^2``, as `cells` has it.

The squared field is band-limited, so that its weights are exact with the control points as samples; what each window is
to read is the exact mean of the pressure that is interpolated between the points, in straight lines.
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
    """Windows over the control points; 13 x 13 over the paper's 16 x 16.

    Attributes
    ----------
    aperture : float
        Side of the square over which a window averages, in m.
    spread : float
        Standard deviation of the Gaussian with which skin, or gel, spreads a pressure point, in m.
    pitch : float
        From one window to the next, in m; less than half the aperture leaves nothing between them.
    inset : float
        From the outermost control points, where pressure has faded to nothing, to the middle of the outermost windows,
        in m.
    faint : float
        Pressure over that of the strongest focus, below which the error is told over this: what 996 transducers press
        whose phases are at random, which none of them can press less than for long.
    """

    aperture: float = 8e-3
    spread: float = 1e-3
    pitch: float = 11e-3 / 3
    inset: float = 5.5e-3
    faint: float = 1e-3

    def __post_init__(self) -> None:
        for name in ("aperture", "spread", "pitch", "inset"):
            positive(getattr(self, name), f"{name} of the windows", "m")

    def places(self, grid: ControlGrid) -> SensorModel:
        """The windows over a control grid, as the cells of a sensor."""
        rows, columns = (self._count(points, grid.pitch) for points in (grid.rows, grid.columns))
        sensor = SensorGrid(rows=rows, columns=columns, pitch=self.pitch, name="windows")
        return SensorModel(grid=sensor, aperture=self.aperture, spread=self.spread)

    def target(self, amplitude: Array, grid: ControlGrid, unit: float) -> CellTarget:  # noqa: ARG002, as `Cells` has it
        """The weights and what is wanted for a target of amplitude (frame, point); in units of the focus."""
        places = self.places(grid)
        # Radiation pressure goes with the square of the amplitude.
        wanted = amplitude**2 @ cell_weights(places, grid, centre=grid.centre, between="lines").T
        weights = cell_weights(places, grid, centre=grid.centre, between="waves")
        return CellTarget(weights=weights, wanted=wanted, faint=self.faint)

    def _count(self, points: int, pitch: float) -> int:
        """Windows along an axis of so many control points."""
        free = (points - 1) * pitch - 2 * self.inset
        # 1e-9 keeps rounding from losing the last one.
        return 1 + max(int(free / self.pitch + 1e-9), 0)
