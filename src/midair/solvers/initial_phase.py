"""Initial phases of the field for which all transducers contribute equally."""

import numpy as np
from numpy.typing import NDArray

from midair.model import ControlGrid, Medium, TransducerArray
from midair.physics import wavenumber

Array = NDArray[np.float64]


def spreading_phase(grid: ControlGrid, array: TransducerArray, medium: Medium) -> Array:
    """Initial phases of the field in rad, shape (point,), that map the whole array onto the control grid.

    A field with constant phase is made by the few transducers below the square, a wave that diverges from behind it by
    all: with psi = k (x^2 / 2 R_x + y^2 / 2 R_y) the ray through a point at x comes from the array at x - x h / R_x,
    with the height h. R = -h w / (W - w), with the half widths w and W of grid and array, maps one onto the other; the
    sign is that of a converging wave. The phase is constant along an axis in which the array is not wider than the
    grid. `medium` gives the wavelength.
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
