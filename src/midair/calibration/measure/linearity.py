"""Whether output grows with pressure: a line with an intercept through five levels or more, and its bend."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from midair.calibration.measure.frequency_response import BandSums, FrequencyResponse, widened
from midair.errors import InputError
from midair.model import Linearity

Array = NDArray[np.float64]


def fit_levels(pressure: Array, output: Array, uncertainty: Array) -> Linearity:
    """The straight line through (pressure, output) of every channel, and its bend.

    Ordinary least squares; the scatter of the points about the line, or the noise of the points if that is larger,
    gives the standard errors, widened by Student's t for the few points there are.

    Parameters
    ----------
    pressure, output : ndarray, shape (level, row, column)
        In Pa.
    uncertainty : ndarray, shape (level, row, column)
        Uncertainty of `output` from noise, in Pa.

    Raises
    ------
    InputError
        With fewer than five different levels.
    """
    if min(len(distinct(column)) for column in pressure.reshape(len(pressure), -1).T) < 5:
        raise InputError(f"levels: expected at least 5 different ones, got {len(distinct(pressure[:, 0, 0]))}")
    line, line_error = _polynomial(pressure, output, uncertainty, 1)
    bend, bend_error = _polynomial(pressure, output, uncertainty, 2)
    gain = np.where(line[1] != 0, line[1], 1)
    # From a x + b x^2 the slope changes by 2 b over the range.
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


def followed_share(part: BandSums, fit: FrequencyResponse, counts: NDArray[np.bool_]) -> tuple[Array, Array]:
    """How much of what a response predicts a record's output holds, shape (channel,), and its standard uncertainty.

    s = sum Re(Y_p^* Y) / sum |Y_p|^2 over the bands that count, Y_p = H X: 1 where the output follows the response.
    Half of each band is its neighbour's, too, which halves what they tell.

    Returns
    -------
    share, uncertainty : ndarray, shape (channel,)
        0 and 1 for a channel that hears nothing.
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
    """What a sensor that is not straight adds to the uncertainty of its response, shape (channel,).

    The largest departure of a level from the common response, less twice its noise, as the half width of an even
    distribution: divided by sqrt(3) (GUM, 4.3.7).

    Parameters
    ----------
    share, error : ndarray, shape (level, channel)
        Shares and uncertainties from `followed_share`.
    """
    return np.maximum(np.abs(share - 1) - 2 * error, 0).max(axis=0) / np.sqrt(3)


def same_levels(levels: Array, cell: Sequence[int | None], cells: int) -> NDArray[np.int64] | None:
    """Which takes make the levels of each channel, weakest first, shape (level, channel).

    Those on all cells if they have five levels, else those on each cell alone; None if neither has.
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
    """Levels that differ from the one below them by more than a part of it, smallest first."""
    chosen: list[float] = []
    for level in np.sort(levels):
        if not chosen or level > chosen[-1] * (1 + apart):
            chosen.append(float(level))
    return np.array(chosen)


def _polynomial(x: Array, y: Array, noise: Array, degree: int) -> tuple[Array, Array]:
    """Coefficients and standard errors, lowest power first, each of shape (power, row, column)."""
    # Powers of the pressure over the highest one, so that the normal equations stay well conditioned.
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
