"""Linearity of a sensor: a line with an intercept through five levels or more, and its curvature."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.calibration.measure.frequency_response import BandSums, FrequencyResponse, widened
from midair.errors import InputError
from midair.model import Linearity


def fit_levels(pressure: Array, output: Array, uncertainty: Array) -> Linearity:
    """Fit a line and a parabola to (pressure, output) in Pa of every channel, shape (level, row, column).

    Ordinary least squares. The standard errors come from the scatter about the line or from `uncertainty` (noise of the
    output in Pa), whichever is larger, and are widened by Student's t for the few points.
    """
    if min(len(distinct(column)) for column in pressure.reshape(len(pressure), -1).T) < 5:
        raise InputError(f"levels: expected at least 5 different levels, got {len(distinct(pressure[:, 0, 0]))}")
    line, line_error = _polynomial(pressure, output, uncertainty, 1)
    bend, bend_error = _polynomial(pressure, output, uncertainty, 2)
    gain = np.where(line[1] != 0, line[1], 1)
    # The slope of a x + b x^2 changes by 2 b times the range.
    change = 2 * np.ptp(pressure, axis=0) / gain
    return Linearity(
        pressure=pressure,
        output=output,
        gain=line[1],
        gain_uncertainty=line_error[1],
        intercept=line[0],
        intercept_uncertainty=line_error[0],
        curvature=bend[2] * change,
        curvature_uncertainty=bend_error[2] * np.abs(change),
    )


def predicted_share(part: BandSums, fit: FrequencyResponse, counts: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Share of the predicted output in a recording's output, shape (channel,), and its standard uncertainty.

    s = sum Re(Y_p^* Y) / sum |Y_p|^2 over the valid bands, with Y_p = H X: 1 if the output follows the response. Bands
    overlap by half, so they hold half as much information. A channel without response gets 0 and 1.
    """
    terms = fit.terms[counts]
    along = np.einsum("bci,bci->bc", terms.conj(), part.cross[counts]).real
    power = np.einsum("bci,bcij,bcj->bc", terms.conj(), part.gram[counts], terms).real
    whole = power.sum(axis=0)
    heard = whole > 0
    share = np.divide(along.sum(axis=0), whole, out=np.zeros_like(whole), where=heard)
    error = np.sqrt((fit.noise[counts] * power).sum(axis=0))
    return share, np.divide(error, whole, out=np.ones_like(whole), where=heard)


def bend_uncertainty(share: Array, error: Array) -> Array:
    """Contribution of nonlinearity to the uncertainty of the response, shape (channel,), from `predicted_share`.

    The largest deviation of a level from the common response, minus twice its noise, is the half width of a uniform
    distribution: divided by sqrt(3) (GUM, 4.3.7).
    """
    return np.maximum(np.abs(share - 1) - 2 * error, 0).max(axis=0) / np.sqrt(3)


def same_levels(levels: Array, cell: Sequence[int | None], cells: int) -> NDArray[np.int64] | None:
    """Take numbers of the levels of each channel, weakest first, shape (level, channel); None for fewer than five.

    Takes on all cells are used if they have five levels, otherwise those on each cell alone.
    """
    whole = [index for index, where in enumerate(cell) if where is None]
    chosen = np.tile(np.array(whole, int), (cells, 1)).T
    if len(distinct(levels[whole])) < 5:
        alone = [[index for index, where in enumerate(cell) if where == one] for one in range(cells)]
        if len({len(each) for each in alone}) != 1 or any(len(distinct(levels[each])) < 5 for each in alone):
            return None
        chosen = np.array(alone).T
    return np.take_along_axis(chosen, np.argsort(levels[chosen], axis=0), axis=0)


def distinct(levels: Array, *, apart: float = 0.05) -> Array:
    """Sorted levels that differ from the next lower one by more than the relative distance `apart`."""
    chosen: list[float] = []
    for level in np.sort(levels):
        if not chosen or level > chosen[-1] * (1 + apart):
            chosen.append(float(level))
    return np.array(chosen)


def _polynomial(x: Array, y: Array, noise: Array, degree: int) -> tuple[Array, Array]:
    """Coefficients and standard errors, lowest power first, both of shape (power, row, column)."""
    # Normalise by the highest pressure, so that the normal equations stay well conditioned.
    top = np.maximum(np.abs(x).max(axis=0), 1e-300)
    powers = np.arange(degree + 1)
    design = np.moveaxis(x / top, 0, -1)[..., None] ** powers
    inverse = np.linalg.inv(np.swapaxes(design, -1, -2) @ design)
    pseudo = inverse @ np.swapaxes(design, -1, -2)
    values = np.moveaxis(y, 0, -1)
    found = np.einsum("...pl,...l->...p", pseudo, values)
    rest = values - np.einsum("...lp,...p->...l", design, found)
    free = len(x) - degree - 1
    from_scatter = np.sqrt((rest**2).sum(axis=-1) / free)
    known = np.sqrt((noise**2).mean(axis=0))
    error = np.maximum(widened(from_scatter, free), known)
    unit = np.sqrt(np.diagonal(inverse, axis1=-2, axis2=-1))
    scale = top[..., None] ** powers
    return np.moveaxis(found / scale, -1, 0), np.moveaxis(error[..., None] * unit / scale, -1, 0)
