"""What cells feel of each other's pressure: measured by pressing on one after the other, and undone."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from midair.calibration.measure.frequency_response import FrequencyResponse
from midair.errors import InputError, MismatchError
from midair.model import Crosstalk, PressureFrames

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def crosstalk_of(
    fits: Sequence[FrequencyResponse], counts: NDArray[np.bool_], *, repeat: Array | float = 0.0
) -> Crosstalk:
    """The crosstalk matrix from the responses of all channels to a pressure on each cell alone.

    C_ik = H_ik / H_ii, H_ik the response of channel i to a pressure on cell k: how the gel spreads does not depend on
    frequency, so the mean of its real part over the bins, weighted by 1 / u^2. Where it changes over the band by more
    than the noise explains, the uncertainty is that much larger (Birge's ratio); the reference's own error cancels.

    Parameters
    ----------
    fits : sequence of FrequencyResponse
        One a cell, in the order of the channels.
    counts : ndarray of bool, shape (bin,)
        Which bins count.
    repeat : ndarray, shape (channel,)
        Relative standard uncertainty of each channel's own response from how takes differ: H_ik and H_ii come from
        different ones.

    Returns
    -------
    Crosstalk
        A dead channel feels nothing but itself.
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


def undo_matrix(crosstalk: Crosstalk, *, damping: float = 0.0) -> Array:
    """The matrix that turns what the cells felt into the pressure on each: (C^T C + d^2)^-1 (C^T + d^2).

    With d = 0 the inverse; a large damping d leaves the pressure as it is (Tikhonov, towards no crosstalk), so that
    nearly even cells do not turn noise into pressure.

    Parameters
    ----------
    crosstalk : Crosstalk
        C.
    damping : float
        d, 0 or more.

    Returns
    -------
    ndarray, shape (channel, channel)
        Multiply it with the felt pressure of all channels.

    Raises
    ------
    InputError
        If the damping is below 0, or the matrix cannot be inverted.
    """
    if not 0 <= damping < np.inf:
        raise InputError(f"damping: expected 0 or more, got {damping:g}")
    matrix, extra = crosstalk.matrix, damping**2 * np.eye(len(crosstalk.matrix))
    normal = matrix.T @ matrix + extra
    condition = float(np.sqrt(np.linalg.cond(normal)))
    if condition > 1e6:
        raise InputError(
            f"crosstalk: expected a matrix that can be inverted, got a condition of {condition:.2g}; give a damping"
        )
    return np.asarray(np.linalg.solve(normal, matrix.T + extra), np.float64)


def undo_crosstalk(pressure: PressureFrames, crosstalk: Crosstalk, *, damping: float = 0.0) -> PressureFrames:
    """The pressure on each cell from what all cells felt.

    Parameters
    ----------
    pressure : PressureFrames
        Calibrated channel by channel.
    crosstalk : Crosstalk
        Of the same sensor.
    damping : float
        See `undo_matrix`.

    Raises
    ------
    MismatchError
        If the matrix is of a sensor with another number of cells.
    """
    if len(crosstalk.matrix) != pressure.sensor.count:
        raise MismatchError(
            f"crosstalk: expected {pressure.sensor.count} channels like the pressure, got {len(crosstalk.matrix)}"
        )
    flat = pressure.pressure.reshape(pressure.frames, -1) @ undo_matrix(crosstalk, damping=damping).T
    step = pressure.provenance.then("undo crosstalk", {"damping": damping})
    return replace(pressure, pressure=flat.reshape(pressure.pressure.shape), provenance=step)


def _finite(values: Array) -> Array:
    return np.where(np.isfinite(values), values, 1e6)
