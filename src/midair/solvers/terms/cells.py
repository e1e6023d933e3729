"""Mean pressures in the cells of a sensor as the target, instead of amplitudes at the control points.

A sensor measures only one number per cell and frame; the control points are interpolated from them. This term compares
``w_c^T |G q|^2`` with the pressure of cell c, where w_c is the share of each point in the cell. It holds for one place
of the sensor: 2 mm beside it the pressure between the cells is not controlled. `windows` controls that, too.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.model import ControlGrid, PressureFrames
from midair.physics import SensorModel, cell_weights
from midair.solvers.backend import Numbers, Rows, squares
from midair.validation import frozen_array

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """Cells of a sensor, and optionally their target pressures."""

    sensor: SensorModel = field(default_factory=SensorModel)
    """Its grid, aperture and spread give the weights."""
    pressure: PressureFrames | None = None
    """Target pressure of the cells, 0 or more, in Pa. If None, it is computed from the target at the control points."""

    def target(self, amplitude: Array, grid: ControlGrid, unit: float) -> "CellTarget":
        """The weights and target pressures for an amplitude (frame, point).

        `unit` is the radiation pressure in Pa of an amplitude of 1. Raises ShapeError if `pressure` has other frames or
        cells.
        """
        # Radiation pressure is proportional to the squared amplitude and interpolated linearly.
        wanted = amplitude**2 @ cell_weights(self.sensor, grid, centre=grid.centre, between="lines").T
        if self.pressure is not None:
            given = self.pressure.pressure.reshape(self.pressure.frames, -1)
            wanted = frozen_array(given / unit, "pressure of the cells", wanted.shape)
        return CellTarget(weights=cell_weights(self.sensor, grid, centre=grid.centre, between="waves"), wanted=wanted)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellTarget:
    """Weights and target pressures of cells or windows in one problem."""

    weights: Array  # w, the share of each point, shape (cell, point)
    wanted: Array  # Target pressure in the unit of amplitude squared, shape (frame, cell)
    faint: float = 0.0  # Frames with an rms target below this report their error relative to this, in the same unit

    def repeated(self, times: int) -> "CellTarget":
        """The same target for several fields, whose points follow one another."""
        if times == 1:
            return self
        weights = np.kron(np.eye(times), self.weights).astype(np.float64)
        return CellTarget(weights=weights, wanted=np.tile(self.wanted, (1, times)), faint=self.faint)

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
