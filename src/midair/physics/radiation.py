"""Convert between sound amplitude and radiation pressure (paper, 2.1 and 4.1)."""

import numpy as np

from midair.array_types import Array, Complex
from midair.errors import NegativePressureError
from midair.model import Medium


def sound_amplitude(pressure: Array, medium: Medium) -> Array:
    """Peak amplitude in Pa of a plane wave whose radiation pressure on a surface is `pressure`.

    p_amp = c sqrt(2 rho P / alpha), section 4.1; 100 Pa of radiation pressure need 3801 Pa of sound.

    Parameters
    ----------
    pressure : ndarray, any shape
        Radiation pressure in Pa, never negative.
    medium : Medium
        Density rho (kg/m3), speed c (m/s), alpha = 1 + R with R the power reflection coefficient.

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


def radiation_pressure(amplitude: Array | Complex, medium: Medium) -> Array:
    """Radiation pressure in Pa of a plane wave of peak `amplitude` (Pa, complex or magnitude) on a surface.

    P = alpha p0^2 / (rho c^2) with p0 = amplitude / sqrt(2) the rms sound pressure, section 2.1.
    """
    return medium.alpha * np.abs(amplitude) ** 2 / (2 * medium.density * medium.speed**2)
