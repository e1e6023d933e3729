"""A field to start from that asks the same of every transducer."""

import numpy as np
from numpy.typing import NDArray

from midair.model import ControlGrid, Medium, TransducerArray
from midair.physics import wavenumber

Array = NDArray[np.float64]


def spreading_phase(grid: ControlGrid, array: TransducerArray, medium: Medium) -> Array:
    """Phases of the field with which the square of control points is an image of the whole array.

    A field of one phase is made by the few transducers under the square, a wave that diverges from behind it by all
    of them: with psi = k (x^2 / 2 R_x + y^2 / 2 R_y) the ray through a point at x comes from the array at
    x - x h / R_x, h the height. R = -h w / (W - w), w and W the half widths of grid and array, maps one on the other;
    the sign is that of a wave that converges.

    Parameters
    ----------
    grid : ControlGrid
        The points.
    array : TransducerArray
        What radiates.
    medium : Medium
        Air, for the wavelength.

    Returns
    -------
    ndarray, shape (point,)
        In rad; along an axis in which the array is no wider than the grid, flat.
    """
    away = grid.position - array.position.mean(axis=0)
    phase = np.zeros(grid.count)
    for axis, centre in enumerate(grid.centre):
        w = float(np.abs(grid.position[:, axis] - centre).max())
        W = float(np.ptp(array.position[:, axis])) / 2
        height = float(np.abs(away[:, 2]).mean())
        if 0 < w < W and height > 0:
            radius = height * w / (W - w)
            phase -= wavenumber(array, medium) * (grid.position[:, axis] - centre) ** 2 / (2 * radius)
    return phase
