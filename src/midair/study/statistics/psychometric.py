"""Psychometric functions: the chance of an answer against the strength of a stimulus."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError

Array = NDArray[np.float64]
CurveShape = Literal["logistic", "normal", "weibull"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Psychometric:
    """psi(x) = guess + (1 - guess - lapse) F(x).

    Attributes
    ----------
    threshold : float
        In the unit of x: F is 1/2 there for "logistic" and "normal", 1 - 1/e for "weibull".
    slope : float
        "logistic": F = 1 / (1 + exp(-slope (x - threshold))); "normal": Phi(slope (x - threshold)); "weibull":
        1 - exp(-(x / threshold)^slope).
    guess : float
        Chance of the answer without a stimulus; 1/m with m alternatives.
    lapse : float
        Chance of a slip.
    shape : {"logistic", "normal", "weibull"}
        F.
    """

    threshold: float
    slope: float
    guess: float = 0.0
    lapse: float = 0.0
    shape: CurveShape = "logistic"

    def __post_init__(self) -> None:
        if self.shape not in get_args(CurveShape):
            raise InputError(f"shape: expected one of {', '.join(get_args(CurveShape))}, got {self.shape!r}")
        if min(self.guess, self.lapse) < 0 or self.guess + self.lapse >= 1:
            raise InputError(f"guess and lapse: expected 0 or more, together below 1, got {self.guess}, {self.lapse}")

    def probability(self, level: Any) -> Array:
        """Chance of the answer at each level, same shape."""
        return self.guess + (1 - self.guess - self.lapse) * steepness(level, self.threshold, self.slope, self.shape)


@dataclass(frozen=True, slots=True, kw_only=True)
class PsychometricFit:
    """A psychometric function and how sure it is.

    Attributes
    ----------
    function : Psychometric
        The function at the maximum of the likelihood.
    threshold_low, threshold_high : float
        95 % limits of the threshold by parametric bootstrap.
    deviance : float
        Deviance from the saturated model; about the number of levels less that of parameters for a good fit.
    deviance_p : float
        Share of bootstrap data sets with a deviance as large.
    """

    function: Psychometric
    threshold_low: float
    threshold_high: float
    deviance: float
    deviance_p: float


def steepness(level: Any, threshold: Any, slope: Any, shape: CurveShape) -> Array:
    """F of `Psychometric`, 0 to 1; all arguments broadcast."""
    from scipy.special import expit, ndtr

    x = np.asarray(level, float)
    if shape == "weibull":
        with np.errstate(divide="ignore"):
            rise = slope * np.log(np.maximum(x, 0) / threshold)
        # Far below 50 F is 1 to the last digit; far above it the exponential overflows.
        return np.asarray(-np.expm1(-np.exp(np.minimum(rise, 50))))
    z = slope * (x - threshold)
    return np.asarray(expit(z) if shape == "logistic" else ndtr(z))


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
) -> PsychometricFit:
    """Fit threshold, slope and lapse by maximum likelihood (Wichmann and Hill, 2001).

    Parameters
    ----------
    level : sequence of float
        Strength of the stimulus; the same level may come more than once.
    correct, total : sequence of int
        Answers counted, and all answers, at each level; 0/1 and ones for single trials.
    rng : Generator
        Draws the bootstrap data sets.
    guess : float
        Known chance of the answer without a stimulus.
    shape : {"logistic", "normal", "weibull"}
        F.
    lapse_most : float
        Upper limit of the lapse.
    draws : int
        Bootstrap data sets.

    Raises
    ------
    ShapeError
        If the lengths differ.
    InputError
        If there are fewer than three levels, or the answers do not rise with the level.
    """
    x, k, n = _merge(level, correct, total)
    if len(x) < 3:
        raise InputError(f"levels: expected three or more, got {len(x)}; a function cannot be fitted to them")
    if shape == "weibull" and x.min() < 0:
        raise InputError(f"levels: expected 0 or more for a Weibull function, got {x.min():g}")
    rate = k / n
    if np.ptp(rate) == 0 or np.cov(x, rate, aweights=n)[0, 1] <= 0:
        raise InputError("answers: expected them to become more frequent with the level; there is no threshold in them")
    function, deviance, at = _fit(x, k, n, guess, shape, lapse_most)
    data = rng.binomial(n.astype(int), function.probability(x), (draws, len(x))).astype(float)
    again = [_fit(x, row, n, guess, shape, lapse_most, start=at) for row in data]
    low, high = np.quantile([f.threshold for f, _, _ in again], [0.025, 0.975])
    # The data count as one of the draws, so that p is never 0.
    share = (1 + sum(d >= deviance for _, d, _ in again)) / (1 + draws)
    return PsychometricFit(
        function=function,
        threshold_low=float(low),
        threshold_high=float(high),
        deviance=deviance,
        deviance_p=float(share),
    )


def fit_threshold(
    level: Array, correct: Array, total: Array, *, guess: float, shape: CurveShape, near: Psychometric
) -> float:
    """The threshold alone, from one start near a function that is known to fit: for resampling.

    Parameters
    ----------
    level, correct, total : ndarray
        As for `fit_psychometric`.
    guess, shape
        As for `fit_psychometric`.
    near : Psychometric
        Where to start.
    """
    x, k, n = _merge(level, correct, total)
    span = float(np.ptp(x)) or 1.0
    place = np.log(near.threshold) if shape == "weibull" else (near.threshold - x[0]) / span
    slope = np.log(near.slope * (1 if shape == "weibull" else span))
    found, _, _ = _fit(x, k, n, guess, shape, 0.05, start=np.array([place, slope, near.lapse]))
    return found.threshold


def _merge(level: Any, correct: Any, total: Any) -> tuple[Array, Array, Array]:
    x, k, n = (np.asarray(values, float) for values in (level, correct, total))
    if not x.shape == k.shape == n.shape or x.ndim != 1 or not x.size:
        raise ShapeError(f"answers: expected three sequences of one length, got {x.shape}, {k.shape}, {n.shape}")
    if (n < 1).any() or (k < 0).any() or (k > n).any() or not np.isfinite(x).all():
        raise InputError("answers: expected finite levels and 0 <= correct <= total with total >= 1")
    values, where = np.unique(x, return_inverse=True)
    hits, trials = (np.asarray(np.bincount(where, weights=w), np.float64) for w in (k, n))
    return values, hits, trials


def _fit(
    x: Array, k: Array, n: Array, guess: float, shape: CurveShape, lapse_most: float, *, start: Array | None = None
) -> tuple[Psychometric, float, Array]:
    """Function, deviance, and where the optimiser ended; from one start if given, from six if not."""
    from scipy.optimize import minimize

    span = float(np.ptp(x))

    def unpack(z: Array) -> tuple[float, float, float]:
        threshold = float(np.exp(z[0])) if shape == "weibull" else float(x[0] + span * z[0])
        slope = float(np.exp(z[1])) / (1 if shape == "weibull" else span)
        return threshold, slope, float(z[2])

    def loss(z: Array) -> float:
        threshold, slope, lapse = unpack(z)
        p = guess + (1 - guess - lapse) * steepness(x, threshold, slope, shape)
        # An answer that a function thinks impossible must cost much, but not infinitely much.
        p = np.clip(p, 1e-9, 1 - 1e-9)
        return -float((k * np.log(p) + (n - k) * np.log1p(-p)).sum())

    top = np.log(max(float(x.max()), 1e-12))
    middle = (top - 3, top) if shape == "weibull" else (0.3, 0.7)
    place = (top - 8, top + 3) if shape == "weibull" else (-2.0, 3.0)
    box = [place, (-3.0, 6.0), (0.0, lapse_most)]
    grid = [np.array([m, s, lapse_most / 4]) for m in (*middle, sum(middle) / 2) for s in (0.7, 2.3)]
    starts = grid if start is None else [start]
    found = min((minimize(loss, z, method="L-BFGS-B", bounds=box) for z in starts), key=lambda result: result.fun)
    threshold, slope, lapse = unpack(np.asarray(found.x, np.float64))
    with np.errstate(divide="ignore", invalid="ignore"):
        best = np.where(k > 0, k * np.log(k / n), 0) + np.where(k < n, (n - k) * np.log1p(-k / n), 0)
    function = Psychometric(threshold=threshold, slope=slope, guess=guess, lapse=lapse, shape=shape)
    return function, max(2 * (float(found.fun) + float(best.sum())), 0.0), np.asarray(found.x, np.float64)
