"""Maximum likelihood fit of a psychometric function, with profile likelihood limits of the threshold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError
from midair.study.statistics.psychometric import CurveFamily, CurveShape, Psychometric
from midair.study.statistics.psychometric_profile import grid_around, threshold_limits

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class PsychometricFit:
    """Fitted psychometric function with its uncertainty."""

    function: Psychometric
    """Function at the maximum of the likelihood."""
    threshold_low: float
    threshold_high: float
    """`threshold_low`, `threshold_high`: 95 % limits of the threshold for independent trials; 0 or infinite if the
    answers give no limit, NaN if limits were not requested."""
    deviance: float
    """Deviance from the saturated model; about the number of levels minus the number of parameters for a good fit."""
    deviance_p: float
    """Share of data sets simulated from the function with a deviance as large."""


def fit_psychometric(
    level: Sequence[float] | Array,
    correct: Sequence[int] | NDArray[Any],
    total: Sequence[int] | NDArray[Any],
    *,
    rng: np.random.Generator,
    guess: float = 0.0,
    shape: CurveShape = "logistic",
    lapse_most: float = 0.05,
    draws: int = 200,
    limit_draws: int = 400,
) -> PsychometricFit:
    """Fit threshold, slope and lapse by maximum likelihood (Wichmann and Hill, 2001).

    Parameters
    ----------
    level : sequence of float
        Stimulus level; levels may repeat.
    correct, total : sequence of int
        Counted answers and all answers at each level; 0/1 and ones for single trials.
    rng : Generator
        Draws the data sets for the deviance and the threshold limits.
    guess : float
        Known guess rate.
    lapse_most : float
        Upper bound of the lapse rate.
    draws : int
        Simulated data sets for the deviance.
    limit_draws : int
        Simulated data sets per threshold for the limits; 0 for no limits.

    Raises
    ------
    ShapeError
        If the lengths differ.
    InputError
        If there are fewer than three levels, or the answers do not increase with the level.
    """
    x, k, n = _merge_levels(level, correct, total)
    if len(x) < 3:
        raise InputError(f"levels: expected three or more for a fit, got {len(x)}; present more levels")
    if shape == "weibull" and x.min() < 0:
        raise InputError(f"levels: expected 0 or more for a Weibull function, got {x.min():g}")
    rate = k / n
    if np.ptp(rate) == 0 or np.cov(x, rate, aweights=n)[0, 1] <= 0:
        raise InputError("answers: expected a share of correct answers that rises with the level; no threshold found")
    curves = CurveFamily(x=x, guess=guess, lapse_most=lapse_most, shape=shape)
    net = grid_around(curves, k, n)
    best, loss = _maximise(curves, k, n, net.best(k[None], n)[0])
    function = curves.function(best)
    deviance = max(float(2 * (loss + _saturated_fit(k, n))), 0.0)
    data = rng.binomial(n.astype(int), function.probability(x), (draws, len(x))).astype(float)
    # Both deviances come from the grid, so that simulated data and answers are fitted equally well.
    on_net, again = (2 * (_saturated_fit(each, n) - net.profile(each, n).max(axis=1)) for each in (k[None], data))
    low, high = threshold_limits(net, k, n, rng=rng, draws=limit_draws) if limit_draws else (np.nan, np.nan)
    return PsychometricFit(
        function=function,
        threshold_low=low,
        threshold_high=high,
        deviance=deviance,
        # The observed data count as one draw, so that p is never 0.
        deviance_p=float((1 + np.count_nonzero(again >= on_net)) / (1 + draws)),
    )


def fit_threshold(
    level: Array,
    correct: Array,
    total: Array,
    *,
    guess: float,
    shape: CurveShape,
    near: Psychometric,
    lapse_most: float = 0.05,
) -> float:
    """Threshold from one start near a known fit, for the jackknife; arguments as `fit_psychometric`."""
    x, k, n = _merge_levels(level, correct, total)
    curves = CurveFamily(x=x, guess=guess, lapse_most=lapse_most, shape=shape)
    unit = 1.0 if shape == "weibull" else float(np.ptp(x)) or 1.0
    start = np.array([curves.place(near.threshold), np.log(near.slope * unit), near.lapse])
    return curves.function(_maximise(curves, k, n, start)[0]).threshold


def _maximise(curves: CurveFamily, right: Array, total: Array, start: Array) -> tuple[Array, float]:
    """Parameters at the maximum of the likelihood near a start, and the negative log likelihood."""
    from scipy.optimize import minimize

    def loss(z: Array) -> float:
        yes, no = curves.logarithms(z)
        return -float(right @ yes + (total - right) @ no)

    low, high = np.array(curves.box).T
    found = minimize(loss, np.clip(start, low, high), method="L-BFGS-B", bounds=curves.box)
    return np.asarray(found.x, np.float64), float(found.fun)


def _saturated_fit(right: Array, total: Array) -> Array:
    """Log likelihood of the saturated model, with a separate rate for each level."""
    with np.errstate(divide="ignore", invalid="ignore"):
        hits = np.where(right > 0, right * np.log(right / total), 0)
        misses = np.where(right < total, (total - right) * np.log1p(-right / total), 0)
    return np.asarray((hits + misses).sum(axis=-1), np.float64)


def _merge_levels(level: Any, correct: Any, total: Any) -> tuple[Array, Array, Array]:
    x, k, n = (np.asarray(values, float) for values in (level, correct, total))
    if not x.shape == k.shape == n.shape or x.ndim != 1 or not x.size:
        raise ShapeError(f"answers: expected three sequences of one length, got {x.shape}, {k.shape}, {n.shape}")
    if (n < 1).any() or (k < 0).any() or (k > n).any() or not np.isfinite(x).all():
        raise InputError("answers: expected finite levels and 0 <= correct <= total with total >= 1")
    values, where = np.unique(x, return_inverse=True)
    hits, trials = (np.asarray(np.bincount(where, weights=w), np.float64) for w in (k, n))
    return values, hits, trials
