"""Undoes that a cell also feels what is played for its neighbours."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.lazy_frames import each_frame
from midair.model import ControlGrid, PressureFrames
from midair.physics import SensorModel, cell_weights
from midair.targets.interpolation import interpolation_matrix

Array = NDArray[np.float64]


def coupling(sensor: SensorModel, grid: ControlGrid) -> Array:
    """What each cell reads of pressure interpolated from each cell, shape (cell, cell).

    The interpolation spreads a cell's pressure over a tent of one pitch, and the sensor averages what presses on it:
    M = w T, with T the interpolation and w the cells' weights (`physics.cell_weights`).
    """
    # The interpolation puts the sensor at the grid's centre, wherever that is; so must the weights.
    weights = cell_weights(sensor, replace(grid, centre=(0.0, 0.0)), between="lines")
    return weights @ interpolation_matrix(sensor.grid, grid)


def decouple(
    pressure: PressureFrames,
    *,
    grid: ControlGrid | None = None,
    sensor: SensorModel | None = None,
    worst: float = 100.0,
) -> PressureFrames:
    """Pressure that makes each cell read what it was meant to, interpolated and felt by its neighbours as it is.

    x' = M^-1 x, exact where pressure is interpolated and about right where amplitude is. Do this before a mapping: what
    it adds below zero the mapping lifts or cuts.

    Parameters
    ----------
    pressure : PressureFrames
        What the cells are to read.
    grid : ControlGrid, optional
        The control points; the paper's if None.
    sensor : SensorModel, optional
        The sensor whose aperture and gel spread the pressure; the usual one on the pressure's cells if None.
    worst : float
        Largest condition number of M: by so much noise could grow.

    Returns
    -------
    PressureFrames
        Same rate and number of frames.

    Raises
    ------
    InputError
        If the cells cannot be told apart with these control points.
    """
    grid, sensor = grid or ControlGrid(), sensor or SensorModel.usual(pressure.sensor)
    matrix = coupling(sensor, grid)
    condition = float(np.linalg.cond(matrix))
    if not condition <= worst:
        raise InputError(
            f"decouple: expected cells that the control points tell apart, to a condition number of {worst:g}, got "
            f"{condition:.3g}; take a grid that covers the cells, or leave decouple out"
        )

    def undone(block: Array) -> Array:
        return np.asarray(np.linalg.solve(matrix, block.reshape(len(block), -1).T).T.reshape(block.shape), np.float64)

    return replace(
        pressure,
        pressure=each_frame(pressure.pressure, undone),
        provenance=pressure.provenance.then(
            "decouple", {"spread_m": sensor.spread, "aperture_m": sensor.aperture, "condition": condition}
        ),
    )
