"""Sound amplitude that exerts a given radiation pressure, and back (paper, 2.1 and 4.1)."""

import numpy as np
from numpy.typing import NDArray

from midair.errors import NegativePressureError
from midair.model import Medium

Array = NDArray[np.float64]


def sound_amplitude(pressure: Array, medium: Medium) -> Array:
    """Peak amplitude of a plane wave whose radiation pressure on a surface is `pressure`.

    p_amp = c sqrt(2 rho P / alpha), section 4.1.

    Parameters
    ----------
    pressure : ndarray, any shape
        Radiation pressure, in Pa. Radiation pressure only pushes: rectify first.
    medium : Medium
        Density rho (kg/m3), speed c (m/s), alpha = 1 + R with R the power reflection coefficient.

    Returns
    -------
    ndarray, same shape
        Peak sound pressure, in Pa. 100 Pa of radiation pressure need 3801 Pa of sound.

    Raises
    ------
    NegativePressureError
        If any pressure is below zero.
    """
    pressure = np.asarray(pressure, float)
    if pressure.size and pressure.min() < 0:
        raise NegativePressureError(
            f"radiation pressure cannot be negative, got {pressure.min():g} Pa; choose a mapping in prepare()"
        )
    return medium.speed * np.sqrt(2 * medium.density * pressure / medium.alpha)


def radiation_pressure(amplitude: NDArray[np.float64] | NDArray[np.complex128], medium: Medium) -> Array:
    """Radiation pressure of a plane wave of peak `amplitude` on a surface.

    P = alpha p0^2 / (rho c^2) with p0 = amplitude / sqrt(2) the rms sound pressure, section 2.1.

    Parameters
    ----------
    amplitude : ndarray, any shape
        Peak sound pressure, in Pa; complex amplitudes count by their magnitude.
    medium : Medium
        As in `sound_amplitude`.

    Returns
    -------
    ndarray, same shape
        In Pa.
    """
    return medium.alpha * np.abs(amplitude) ** 2 / (2 * medium.density * medium.speed**2)
