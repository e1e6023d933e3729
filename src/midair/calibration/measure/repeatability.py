"""Variation of a response between recordings beyond their noise."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.calibration.measure.frequency_response import BandSums, FrequencyResponse, solve_sums, widened


def repeatability(
    parts: Sequence[BandSums], whole: FrequencyResponse, counts: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Relative standard uncertainty of magnitude, and of phase in rad, from the scatter of takes, shape (channel,).

    Takes differ because the sensor is placed anew and the gel warms up. The variance tau^2 between takes is estimated
    by the method of moments: sum_r w_r (H_r / H - mean)^2 has the expectation (R - 1) + tau^2 (sum w - sum w^2 / sum
    w), with w_r = 1 / u_r^2 (DerSimonian and Laird, Controlled Clinical Trials 7, 1986), pooled over the bands, because
    mostly the gain varies. The common response weights take r by its share p_r of the input's power, so its variance is
    tau^2 sum p_r^2, widened by Student's t for R - 1. The result is 0 for a single take, whose repeatability is
    unknown.
    """
    pressed = np.array([part.points > 0 for part in parts])
    if len(parts) < 2 or not (pressed.sum(axis=0) > 1).any():
        return np.zeros(pressed.shape[1]), np.zeros(pressed.shape[1])
    fits = [solve_sums([part]) for part in parts]
    reference = np.where(whole.response[counts] != 0, whole.response[counts], 1)
    apart = np.array([fit.response[counts] for fit in fits]) / reference - 1
    own = np.array([fit.uncertainty[counts] for fit in fits])
    weight = np.where(pressed[:, None] & np.isfinite(own) & (own > 0), 1 / np.maximum(own, 1e-12) ** 2, 0)
    energy = np.array([part.gram[counts, :, 0, 0].real for part in parts])
    share = energy / np.maximum(energy.sum(axis=0), 1e-300)
    kept = (share**2).sum(axis=0).mean(axis=0)
    number = pressed.sum(axis=0)
    both = [_between(values, weight, number) for values in (apart.real, apart.imag)]
    magnitude, phase = (widened(np.sqrt(tau * kept), np.maximum(number - 1, 1)) for tau in both)
    return magnitude, phase


def _between(values: Array, weight: Array, number: NDArray[np.int64]) -> Array:
    """tau^2 of each channel, from values and weights of shape (take, band, channel)."""
    whole = np.maximum(weight.sum(axis=0), 1e-300)
    mean = (weight * values).sum(axis=0) / whole
    scatter = (weight * (values - mean) ** 2).sum(axis=0)
    free = whole - (weight**2).sum(axis=0) / whole
    return np.maximum((scatter - (number - 1)).sum(axis=0), 0) / np.maximum(free.sum(axis=0), 1e-300)
