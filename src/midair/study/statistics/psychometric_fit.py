"""Psychometric functions, the probability of an answer by stimulus level, and their maximum likelihood fit."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError, ShapeError
from midair.validation import one_of

CurveShape = Literal["logistic", "normal", "weibull"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Psychometric:
    """psi(x) = guess + (1 - guess - lapse) F(x)."""

    threshold: float
    """In the unit of x: F is 1/2 there for "logistic" and "normal", 1 - 1/e for "weibull"."""
    slope: float
    """"logistic": F = 1 / (1 + exp(-slope (x - threshold))); "normal": Phi(slope (x - threshold)); "weibull": 1 -
    exp(-(x / threshold)^slope)."""
    guess: float = 0.0
    """Guess rate; 1/m with m alternatives."""
    lapse: float = 0.0
    """Lapse rate."""
    shape: CurveShape = "logistic"
    """Shape of F."""

    def __post_init__(self) -> None:
        one_of(self.shape, CurveShape, "shape")
        if min(self.guess, self.lapse) < 0 or self.guess + self.lapse >= 1:
            raise InputError(f"guess and lapse: expected 0 or more, together below 1, got {self.guess}, {self.lapse}")

    def probability(self, level: Any) -> Array:
        """Probability of the answer at each level, same shape."""
        return self.guess + (1 - self.guess - self.lapse) * sigmoid(level, self.threshold, self.slope, self.shape)


def sigmoid(level: Any, threshold: Any, slope: Any, shape: CurveShape) -> Array:
    """F of `Psychometric`, 0 to 1; all arguments broadcast."""
    x = np.asarray(level, float)
    if shape == "weibull":
        with np.errstate(divide="ignore"):
            rise = slope * np.log(np.maximum(x, 0) / threshold)
        # F is exactly 1 in float64 well below 50; far above 50 the exponential overflows.
        return np.asarray(-np.expm1(-np.exp(np.minimum(rise, 50))))
    z = slope * (x - threshold)
    return np.asarray(scipy.special.expit(z) if shape == "logistic" else scipy.special.ndtr(z))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CurveFamily:
    """Functions that may be fitted, with the parameters place (rescaled or log threshold), log slope and lapse."""

    x: Array
    """Levels in rising order, shape (level,)."""
    guess: float
    lapse_most: float
    shape: CurveShape

    @property
    def box(self) -> list[tuple[float, float]]:
        """Bounds of place, log slope and lapse."""
        top = np.log(max(float(self.x.max()), 1e-12))
        place = (top - 8, top + 3) if self.shape == "weibull" else (-2.0, 3.0)
        return [place, (-3.0, 6.0), (0.0, self.lapse_most)]

    def function(self, z: Array) -> Psychometric:
        """Function with these three parameters."""
        threshold, slope = (float(each) for each in self._unpack(z[0], z[1]))
        return Psychometric(
            threshold=threshold, slope=slope, guess=self.guess, lapse=float(np.clip(z[2], 0, 1)), shape=self.shape
        )

    def logarithms(self, z: Array) -> tuple[Array, Array]:
        """Log probabilities of the answer and of its absence, shape (level, ...) for z of shape (3, ...)."""
        threshold, slope = self._unpack(z[0], z[1])
        x = self.x.reshape(-1, *[1] * (z.ndim - 1))
        p = self.guess + (1 - self.guess - z[2]) * sigmoid(x, threshold, slope, self.shape)
        # Answers of probability 0 get a large but finite log loss.
        p = np.clip(p, 1e-9, 1 - 1e-9)
        return np.log(p), np.log1p(-p)

    def place(self, threshold: float) -> float:
        """Place parameter of a threshold."""
        if self.shape == "weibull":
            return float(np.log(threshold))
        return (threshold - float(self.x[0])) / self._span

    def _unpack(self, place: Any, slope: Any) -> tuple[Any, Any]:
        if self.shape == "weibull":
            return np.exp(place), np.exp(slope)
        return self.x[0] + self._span * place, np.exp(slope) / self._span

    @property
    def _span(self) -> float:
        return float(np.ptp(self.x)) or 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CurveGrid:
    """Psychometric functions on a grid of places, log slopes and lapses."""

    curves: CurveFamily
    axes: tuple[Array, Array, Array]
    """Places, log slopes, lapses."""
    logit: Array
    no: Array
    """`logit`, `no`: log odds of the answer and log probability of its absence, shape (level, place, slope and lapse).
    """

    def likelihood(self, right: Array, total: Array, place: int) -> Array:
        """Log likelihood of the functions at a place, shape (data set, slope and lapse)."""
        return right @ self.logit[:, place] + total @ self.no[:, place]

    def profile(self, right: Array, total: Array) -> Array:
        """Profile log likelihood, shape (data set, place), for correct answers of shape (data set, level)."""
        return np.stack([self.likelihood(right, total, i).max(axis=1) for i in range(len(self.axes[0]))], axis=1)

    def best(self, right: Array, total: Array) -> Array:
        """Place, log slope and lapse at the maximum, shape (data set, 3)."""
        place = self.profile(right, total).argmax(axis=1)
        found: list[list[float]] = []
        for row, i in zip(right, place, strict=True):
            slope, lapse = divmod(int(self.likelihood(row, total, int(i)).argmax()), len(self.axes[2]))
            found.append([float(self.axes[0][i]), float(self.axes[1][slope]), float(self.axes[2][lapse])])
        return np.array(found)


def grid_around(curves: CurveFamily, right: Array, total: Array) -> CurveGrid:
    """Grid over all functions that are compatible with the answers.

    It starts with the bounds of the family and is narrowed four times to the functions whose likelihood is within
    exp(-10) of the maximum, so that its resolution suits any number of answers.
    """
    box = curves.box
    net = _make_grid(curves, box)
    for _ in range(4):
        heights = np.stack([net.likelihood(right, total, i) for i in range(len(net.axes[0]))])
        heights = heights.reshape([len(axis) for axis in net.axes])
        likely = heights > heights.max() - 10
        box = []
        for number, axis in enumerate(net.axes):
            inside = np.flatnonzero(likely.any(axis=tuple({0, 1, 2} - {number})))
            # One grid step more on either side: the maximum may lie between two points.
            box.append((float(axis[max(inside[0] - 1, 0)]), float(axis[min(inside[-1] + 1, len(axis) - 1)])))
        net = _make_grid(curves, box)
    return net


def threshold_limits(
    net: CurveGrid, right: Array, total: Array, *, rng: np.random.Generator, draws: int = 400, level: float = 0.95
) -> tuple[float, float]:
    """Confidence limits of the threshold: the likelihood ratio there equals its bootstrapped critical value.

    The likelihood ratio of the maximum to the profile follows chi2 only for many trials; with 40 to 160 trials it is
    larger. So the critical value at each candidate threshold is a quantile of the ratios of data simulated from the
    best function with that threshold (an inverted parametric bootstrap test).

    `right` and `total` have shape (level,). Returns the low and high limit in the unit of the levels; 0 (or -inf) and
    inf if the grid ends before the ratio reaches the critical value: the answers then give no limit on that side.
    """
    seed = int(rng.integers(2**63))
    profile = net.profile(right[None], total)[0]
    ratio = 2 * (profile.max() - profile)
    best = int(ratio.argmin())

    @cache
    def excess(place: int) -> float:
        # The same random numbers at every place (common random numbers) make the ratio a smooth function of it.
        return float(ratio[place] - critical_ratio(net, right, total, place, np.random.default_rng(seed), draws, level))

    found: list[float] = []
    for side, end in ((-1, 0), (1, len(profile) - 1)):
        inside, outside = best, end
        if excess(end) <= 0:
            plain = -np.inf if net.curves.shape != "weibull" else 0.0
            found.append(plain if side < 0 else np.inf)
            continue
        critical = float(scipy.stats.chi2.ppf(level, 1))
        while abs(outside - inside) > 1:
            # No bisection: the critical ratio changes slowly with the place, so its last value predicts the limit.
            between = range(inside + side, outside, side)
            middle = next((place for place in between if ratio[place] > critical), between[-1])
            critical = float(ratio[middle]) - excess(middle)
            inside, outside = (inside, middle) if ratio[middle] > critical else (middle, outside)
        near, far = excess(inside), excess(outside)
        share = -near / (far - near)
        place = net.axes[0][inside] + share * (net.axes[0][outside] - net.axes[0][inside])
        found.append(net.curves.function(np.array([place, 0.0, 0.0])).threshold)
    return found[0], found[1]


def critical_ratio(
    net: CurveGrid, right: Array, total: Array, place: int, rng: np.random.Generator, draws: int, level: float
) -> float:
    """Quantile `level` of the likelihood ratios of data simulated from the best function at a place."""
    function = int(net.likelihood(right, total, place).argmax())
    chance = np.exp(net.logit[:, place, function] + net.no[:, place, function])
    data = rng.binomial(total.astype(int), chance, (draws, len(total))).astype(float)
    # Every second place is accurate enough for the maximum; the limits need the full grid.
    known = net.likelihood(data, total, place).max(axis=1)
    greatest = np.max(
        [net.likelihood(data, total, i).max(axis=1) for i in range(place % 2, len(net.axes[0]), 2)], axis=0
    )
    return float(np.quantile(2 * (greatest - known), level))


def _make_grid(curves: CurveFamily, box: list[tuple[float, float]]) -> CurveGrid:
    # A coarse grid of slope and lapse adds no bias, since simulated data use the same grid.
    places, slopes, lapses = (
        np.linspace(low, high, count) for (low, high), count in zip(box, (81, 21, 4), strict=True)
    )
    z = np.stack(np.meshgrid(places, slopes, lapses, indexing="ij")).reshape(3, -1)
    yes, no = (each.reshape(len(curves.x), len(places), -1) for each in curves.logarithms(z))
    return CurveGrid(curves=curves, axes=(places, slopes, lapses), logit=yes - no, no=no)


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

    At each `level` (levels may repeat) `correct` of `total` answers are counted: 0/1 and ones for single trials. The
    guess rate is known, the lapse rate at most `lapse_most`. `rng` draws `draws` data sets for the deviance, and
    `limit_draws` per threshold for its limits (0: no limits). Raises ShapeError if the lengths differ; InputError if
    there are fewer than three levels, or the answers do not increase with the level.
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

    def loss(z: Array) -> float:
        yes, no = curves.logarithms(z)
        return -float(right @ yes + (total - right) @ no)

    low, high = np.array(curves.box).T
    found = scipy.optimize.minimize(loss, np.clip(start, low, high), method="L-BFGS-B", bounds=curves.box)
    return np.asarray(found.x, np.float64), float(found.fun)


def _saturated_fit(right: Array, total: Array) -> Array:
    """Log likelihood of the saturated model, with a separate rate for each level."""
    return np.asarray(
        (scipy.special.xlogy(right, right / total) + scipy.special.xlog1py(total - right, -right / total)).sum(axis=-1),
        np.float64,
    )


def _merge_levels(level: Any, correct: Any, total: Any) -> tuple[Array, Array, Array]:
    x, k, n = (np.asarray(values, float) for values in (level, correct, total))
    if not x.shape == k.shape == n.shape or x.ndim != 1 or not x.size:
        raise ShapeError(f"answers: expected three sequences of one length, got {x.shape}, {k.shape}, {n.shape}")
    if (n < 1).any() or (k < 0).any() or (k > n).any() or not np.isfinite(x).all():
        raise InputError("answers: expected finite levels and 0 <= correct <= total with total >= 1")
    values, where = np.unique(x, return_inverse=True)
    hits, trials = (np.asarray(np.bincount(where, weights=w), np.float64) for w in (k, n))
    return values, hits, trials
