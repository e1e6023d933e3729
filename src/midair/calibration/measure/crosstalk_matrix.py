"""Crosstalk between cells, measured by pressing each cell alone."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.calibration.measure.frequency_response import FrequencyResponse
from midair.model import Crosstalk


def crosstalk_of(
    fits: Sequence[FrequencyResponse], counts: NDArray[np.bool_], *, repeat: Array | float = 0.0
) -> Crosstalk:
    """Compute the crosstalk matrix from the responses of all channels to a pressure on each cell alone.

    C_ik = H_ik / H_ii, with H_ik the response of channel i to a pressure on cell k. The spread in the gel does not
    depend on frequency, so C is the mean of the real part over the bins, weighted by 1 / u^2. If the ratio varies over
    the band more than the noise explains, the uncertainty is increased accordingly (Birge's ratio). The error of the
    reference cancels. `fits` has one response per cell, in the order of the channels, and `repeat` is the relative
    standard uncertainty of each channel's own response from the scatter between takes, because H_ik and H_ii come from
    different takes. A dead channel has no crosstalk.
    """
    response: Complex = np.array([fit.response[counts] for fit in fits])
    spread = np.array([np.abs(fit.response[counts]) * _finite(fit.uncertainty[counts]) for fit in fits])
    cells = np.arange(len(fits))
    own, own_spread = response[cells, :, cells].T, spread[cells, :, cells].T
    heard = np.abs(own) > 0
    size = np.where(heard, np.abs(own), 1)
    ratio = np.real(np.where(heard, response / np.where(heard, own, 1), 0))
    error = np.sqrt((spread / size) ** 2 + (ratio * own_spread / size) ** 2)
    weight = 1 / np.maximum(error, 1e-12) ** 2
    total = weight.sum(axis=1)
    mean = (weight * ratio).sum(axis=1) / total
    chi = (weight * (ratio - mean[:, None]) ** 2).sum(axis=1) / max(len(own) - 1, 1)
    seated = np.broadcast_to(repeat, len(fits))
    uncertainty = np.hypot(np.sqrt(np.maximum(chi, 1) / total), np.abs(mean) * np.hypot(seated[:, None], seated))
    alive = np.asarray(heard.all(axis=0))
    matrix = np.where(alive & alive[:, None], mean, 0).T
    np.fill_diagonal(matrix, 1)
    uncertainty = np.where(alive & alive[:, None], uncertainty, 0).T
    np.fill_diagonal(uncertainty, 0)
    return Crosstalk(matrix=matrix, uncertainty=uncertainty)


def _finite(values: Array) -> Array:
    # An uncertainty is infinite where a response is 0, and their product would be NaN.
    return np.where(np.isfinite(values), values, 1e6)
