"""The cells of the sensor as the target, instead of the control points between them.

Only as many numbers a frame were measured as the sensor has cells; the control points are interpolated from them. This
term asks that each cell would read what it should: ``w_c^T |G q|^2`` against its pressure, with w_c the share that
each point has in cell c.

It holds for a sensor in that one place: 2 mm beside it another pressure presses, since nobody asked what presses
between the cells. `windows` asks for that, too.
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
    """Which cells, and what they are to read.

    Attributes
    ----------
    sensor : SensorModel
        Its grid, aperture and spread give the weights.
    pressure : PressureFrames, optional
        Pressure of the cells, 0 or more, in Pa. What they would read of the target at the control points if None.
    """

    sensor: SensorModel = field(default_factory=SensorModel)
    pressure: PressureFrames | None = None

    def target(self, amplitude: Array, grid: ControlGrid, unit: float) -> "CellTarget":
        """The weights and the wanted readings for a target of amplitude (frame, point).

        `unit` is the radiation pressure, in Pa, of an amplitude of 1, for `pressure` where it is given.

        Raises
        ------
        ShapeError
            If `pressure` has other frames or cells.
        """
        # Radiation pressure goes with the square of the amplitude; what is interpolated lies on lines.
        wanted = amplitude**2 @ cell_weights(self.sensor, grid, centre=grid.centre, between="lines").T
        if self.pressure is not None:
            given = self.pressure.pressure.reshape(self.pressure.frames, -1)
            wanted = frozen_array(given / unit, "pressure of the cells", wanted.shape)
        return CellTarget(weights=cell_weights(self.sensor, grid, centre=grid.centre, between="waves"), wanted=wanted)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellTarget:
    """Cells of one problem.

    Attributes
    ----------
    weights : ndarray, shape (cell, point)
        w, each point's share.
    wanted : ndarray, shape (frame, cell)
        In the unit of amplitude squared.
    faint : float
        In the same unit: frames that want less than this of the cells, rms, are told their error over this.
    """

    weights: Array
    wanted: Array
    faint: float = 0.0

    def repeated(self, times: int) -> "CellTarget":
        """The same wanted of so many fields, whose points follow one another."""
        if times == 1:
            return self
        weights = np.kron(np.eye(times), self.weights).astype(np.float64)
        return CellTarget(weights=weights, wanted=np.tile(self.wanted, (1, times)), faint=self.faint)

    def error(self, size: Array) -> Array:
        """|| w |y|^2 - P || / || P || of each frame for the field's magnitude (frame, point); 0 where P is 0."""
        norm = np.linalg.norm(self.wanted, axis=1)
        norm = np.where(norm > 0, np.maximum(norm, self.faint * np.sqrt(self.wanted.shape[1])), 0.0)
        missed = np.linalg.norm(size**2 @ self.weights.T - self.wanted, axis=1)
        return np.divide(missed, norm, out=np.zeros(len(norm)), where=norm > 0)


def cell_misfit(xp: Any, y: Rows, weights: Rows, wanted: Rows, scale: Numbers) -> tuple[Numbers, Rows]:
    """The cost scale || w |y|^2 - P ||^2 / 2 of each row, and its gradient by y, 2 scale (w^T (w |y|^2 - P)) y.

    Parameters
    ----------
    xp : module
        Module of the array API standard.
    y : array of complex, shape (row, point)
        The field at the control points.
    weights : array, shape (point, cell)
        w transposed.
    wanted : array, shape (row, cell)
        P, in the unit of y squared.
    scale : array, shape (row,)
        1 / || P ||^2, for a cost that is half the square of a relative error.

    Returns
    -------
    cost : array, shape (row,)
    slope : array of complex, shape (row, point)
        d cost = Re(conj(slope) dy).
    """
    size = xp.abs(y)
    missed = (size * size) @ weights - wanted
    return 0.5 * scale * squares(xp, missed), y * ((2 * scale[:, None] * missed) @ weights.T)
