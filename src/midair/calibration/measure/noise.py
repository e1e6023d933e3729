"""Noise of a sensor: density at the output and equivalent pressure."""

import numpy as np

from midair.array_types import Array
from midair.calibration.measure.frequency_response import band_sums
from midair.dsp import Band
from midair.errors import BandError
from midair.model import BAND, Calibration, Recording


def quiet_density(recording: Recording, *, resolution: float, width: float) -> tuple[Array, Array, float]:
    """Noise spectrum of a recording without pressure, in the bands of `band_sums`.

    Returns the band frequencies in Hz, the one-sided power density (band, channel) in unit^2/Hz, and the number of
    independent values per band.
    """
    flat = recording.samples.reshape(recording.frames, -1)
    # With an input of zeros, all of the output counts as noise.
    sums = band_sums(np.zeros((len(flat), 1)), flat, recording.rate, resolution=resolution, width=width)
    return sums.frequency, sums.power / sums.points, float(sums.points[0])


def white_level(density: Array, averages: float, overlap: float) -> tuple[Array, Array]:
    """Median amplitude density over the bands, shape (channel,), and its relative standard uncertainty.

    The median of n independent means of m squared values has a relative standard error of sqrt(pi / (2 n m)) in power,
    half of that in amplitude. `averages` is m, and `overlap` the width of a band over the band spacing.
    """
    level = np.sqrt(np.median(density, axis=0))
    independent = max(len(density) / max(overlap, 1.0), 1.0) * max(averages, 1.0)
    return level, np.full(level.shape, 0.5 * np.sqrt(np.pi / (2 * independent)))


def noise_equivalent_pressure(calibration: Calibration, band: Band = BAND) -> Array:
    """Rms pressure in a band that is as strong as each channel's noise, in Pa, shape (row, column).

    It is the root of the integral of ``S_nn / |H|^2`` over the band, or uses the white `noise` if no density was
    measured. It is infinite for a channel whose response is 0 somewhere in the band. Raises BandError if the band (low,
    high) in Hz is not within the calibration's.
    """
    low, high = band
    first, last = calibration.frequency[0], calibration.frequency[-1]
    if not first <= low < high <= last:
        raise BandError(f"band: expected one within {first:g} to {last:g} Hz, got {low:g} to {high:g} Hz")
    frequency = np.linspace(low, high, 512)
    measured = calibration.measurement
    if measured is None:
        density = np.broadcast_to(calibration.noise, (512, *calibration.noise.shape))
    else:
        channels = measured.noise_density.reshape(len(calibration.frequency), -1).T
        density = np.array([np.interp(frequency, calibration.frequency, one) for one in channels]).T
        density = density.reshape(512, *calibration.noise.shape)
    size = np.abs(calibration.response_at(frequency))
    hidden = np.divide(density, size, out=np.full(size.shape, np.inf), where=size > 0)
    return np.sqrt(np.trapezoid(hidden**2, frequency, axis=0))


def known_noise(calibration: Calibration | None, band: Band = BAND) -> Array | None:
    """Noise of each channel in a band as `noise_equivalent_pressure`; None if the calibration does not hold it."""
    if calibration is None or not calibration.noise.any():
        return None
    first, last = calibration.frequency[0], calibration.frequency[-1]
    found = noise_equivalent_pressure(calibration, (max(band[0], first), min(band[1], last)))
    return found if np.isfinite(found).all() else None
