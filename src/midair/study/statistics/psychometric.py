"""Logistic psychometric functions of the logarithm of the level: maximum likelihood fit, limits, and QUEST+."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError, ShapeError

WIDEST = 25.0
"""Largest ratio of the limits of a threshold that is reported."""
MISFIT = 0.01
"""Smallest p-value of the misfit of a threshold that is reported."""
SLOPES = (1.0, 20.0)
"""Smallest and largest slope of a fit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Psychometric:
    """psi(x) = guess + (1 - guess - lapse) F(x) with F(x) = 1 / (1 + (threshold / x)^slope), for levels x of 0 or more.

    F is the logistic function of slope (log x - log threshold): 0 at the level 0, 1/2 at the threshold.
    """

    threshold: float
    """In the unit of x."""
    slope: float
    guess: float = 0.0
    """Guess rate; 1/m with m alternatives, the false-alarm rate of yes-no answers."""
    lapse: float = 0.0
    """Lapse rate."""

    def __post_init__(self) -> None:
        if min(self.guess, self.lapse) < 0 or self.guess + self.lapse >= 1:
            raise InputError(f"guess and lapse: expected 0 or more, together below 1, got {self.guess}, {self.lapse}")
        if self.threshold <= 0 or self.slope <= 0:
            raise InputError(f"threshold and slope: expected above 0, got {self.threshold:g} and {self.slope:g}")

    def probability(self, level: Any) -> Array:
        """Probability of the answer at each level, same shape."""
        return self.guess + (1 - self.guess - self.lapse) * _rise(level, np.log(self.threshold), self.slope)


def _rise(level: Any, place: Any, slope: Any) -> Array:
    with np.errstate(divide="ignore"):
        return np.asarray(scipy.special.expit(slope * (np.log(np.asarray(level, float)) - place)))


@dataclass(frozen=True, slots=True, kw_only=True)
class PsychometricFit:
    """Fitted psychometric function with its uncertainty."""

    function: Psychometric
    """Function at the maximum of the likelihood."""
    low: float
    high: float
    """`low`, `high`: 95 % limits of the threshold for independent trials; 0 or infinite if the answers give none."""
    p_misfit: float
    """Share of data sets simulated from the function whose deviance from it is as large."""
    levels: tuple[float, float]
    """Lowest and highest level above 0."""

    @property
    def refusal(self) -> str:
        """Reason why the answers give no threshold on these levels; empty if they do."""
        (lowest, highest), threshold = self.levels, self.function.threshold
        if self.p_misfit < MISFIT:
            return f"refused: the model of the answers does not fit (p = {self.p_misfit:.3f}, limit {MISFIT:g})"
        if not lowest <= threshold <= highest:
            side = "above" if threshold > highest else "below"
            return f"refused: the threshold is {side} the levels {lowest:g} to {highest:g}"
        if self.low * WIDEST < self.high:
            return (
                f"refused: the answers determine it only to {self.low:.3g} to {self.high:.3g}, more than a factor of"
                f" {WIDEST:g}"
            )
        return ""

    @property
    def ranked(self) -> float:
        """Threshold, or inf or -inf where it is beyond the levels; NaN where it is refused for another reason."""
        if not self.refusal:
            return self.function.threshold
        (lowest, highest), threshold = self.levels, self.function.threshold
        if self.p_misfit < MISFIT or lowest <= threshold <= highest:
            return np.nan
        return np.inf if threshold > highest else -np.inf


def fit_psychometric(
    level: Sequence[float] | Array,
    correct: Sequence[int] | NDArray[Any],
    total: Sequence[int] | NDArray[Any],
    *,
    rng: np.random.Generator,
    guess: float | None = 0.0,
    lapse_most: float = 0.05,
    draws: int = 400,
) -> PsychometricFit:
    """Fit threshold, slope and lapse by maximum likelihood (Wichmann and Hill, 2001).

    At each `level` (levels may repeat) `correct` of `total` answers are counted: 0/1 and ones for single trials. The
    lapse rate is at most `lapse_most`, the guess rate `guess`; None fits it as a false-alarm rate of at most 0.6, for
    which the level 0 has the answers to blanks. Where all functions of a side are equally likely, the threshold is at
    its end: e^3 times the highest level, or e^-3 times the lowest.

    The limits are those of the likelihood ratio at the .99 quantile of chi2: at that of .95 they cover 81 to 92 % of
    the thresholds of 180 adaptive trials, since the same answers choose levels, slope and lapse rate. `rng` draws
    `draws` data sets for the misfit, which are not fitted again: p is rather too large. Raises ShapeError if the
    lengths differ; InputError if there are fewer than three levels above 0.
    """
    x, k, n = _merge_levels(level, correct, total)
    shown = x[x > 0]
    if len(shown) < 3:
        raise InputError(f"levels: expected three or more above 0 for a fit, got {len(shown)}; present more levels")
    if not 0 <= lapse_most < 0.5:
        raise InputError(f"lapse_most: expected 0 to below 0.5, got {lapse_most:g}")
    ends = (np.log(shown[0]) - 3, np.log(shown[-1]) + 3)
    box = [ends, (np.log(SLOPES[0]), np.log(SLOPES[1])), (0.0, lapse_most)]
    box.append((0.0, 0.6) if guess is None else (guess, guess))

    def chance(z: Array) -> Array:
        p = z[3] + (1 - z[3] - z[2]) * _rise(x, z[0], np.exp(z[1]))
        return np.clip(p, 1e-9, 1 - 1e-9)

    def loss(z: Array) -> float:
        p = chance(z)
        return -float(k @ np.log(p) + (n - k) @ np.log1p(-p))

    def best_near(start: Array, place: float | None = None) -> tuple[Array, float]:
        """Maximum of the likelihood near a start, at a fixed log threshold if `place` is given."""
        bounds = box if place is None else [(place, place), *box[1:]]
        start = np.clip(start, *np.array(bounds).T)
        found = scipy.optimize.minimize(loss, start, method="L-BFGS-B", bounds=bounds)
        return np.asarray(found.x, np.float64), float(found.fun)

    first = (
        float(np.clip(k[x == 0].sum() / n[x == 0].sum(), 0.01, 0.5)) if guess is None and x[0] == 0 else guess or 0.0
    )
    starts = [
        np.array([place, np.log(slope), lapse_most / 3, first])
        for place in np.linspace(*ends, 13)
        for slope in (1, 3, 8)
    ]
    starts.sort(key=loss)
    best, least = min((best_near(start) for start in starts[:3]), key=lambda found: found[1])
    function = Psychometric(
        threshold=float(np.exp(best[0])), slope=float(np.exp(best[1])), lapse=float(best[2]), guess=float(best[3])
    )
    critical = float(scipy.stats.chi2.ppf(0.99, 1)) / 2

    def limit(end: float) -> float:
        near = best

        def excess(place: float) -> float:
            nonlocal near
            near, height = best_near(near, place)
            return height - least - critical

        if abs(end - best[0]) < 1e-9 or excess(end) <= 0:
            return np.inf if end > best[0] else 0.0
        near = best
        return float(np.exp(scipy.optimize.brentq(excess, best[0], end, xtol=1e-3)))

    p = chance(best)
    drawn = rng.binomial(n.astype(int), p, (draws, len(x)))
    deviance, known = _deviance(k, n, p), _deviance(drawn, n, p)
    return PsychometricFit(
        function=function,
        low=limit(ends[0]),
        high=limit(ends[1]),
        # The observed data count as one draw, so that p is never 0.
        p_misfit=float((1 + np.count_nonzero(known >= deviance - 1e-9)) / (1 + draws)),
        levels=(float(shown[0]), float(shown[-1])),
    )


def next_level(levels: Array, correct: Array, total: Array, *, guess: float, lapse: float = 0.03) -> int:
    """Index of the level whose answer has the least expected entropy of the threshold (QUEST+, Watson, 2017).

    Slope and lapse rate count for nothing (Prins, 2013). `correct` of `total` answers were counted at each of the
    `levels` so far. The prior is uniform over the logarithms of thresholds, from half of the lowest to twice the
    highest level, and of slopes from 1 to 8.
    """
    place = np.linspace(np.log(levels[0] / 2), np.log(levels[-1] * 2), 41)
    slope = np.geomspace(1, 8, 4)
    chance = guess + (1 - guess - lapse) * _rise(levels[:, None, None], place[:, None], slope)
    height = np.tensordot(correct, np.log(chance), 1) + np.tensordot(total - correct, np.log1p(-chance), 1)
    weight = np.exp(height - height.max())
    weight /= weight.sum()
    entropy = np.zeros(len(levels))
    for answer in (chance, 1 - chance):
        joint = (answer * weight).sum(axis=2)
        share = joint.sum(axis=1)
        entropy += share * np.log(share) - (joint * np.log(np.maximum(joint, 1e-300))).sum(axis=1)
    return int(entropy.argmin())


def _deviance(counted: Array | NDArray[Any], total: Array, chance: Array) -> Array:
    """Deviance of counts, shape (..., level), from the model with a separate rate for each level."""
    missed, expected = total - counted, total * chance
    fit = scipy.special.xlogy(counted, expected) + scipy.special.xlogy(missed, total - expected)
    whole = scipy.special.xlogy(counted, counted) + scipy.special.xlogy(missed, missed) - fit
    return np.asarray(2 * whole.sum(axis=-1))


def _merge_levels(level: Any, correct: Any, total: Any) -> tuple[Array, Array, Array]:
    x, k, n = (np.asarray(values, float) for values in (level, correct, total))
    if not x.shape == k.shape == n.shape or x.ndim != 1 or not x.size:
        raise ShapeError(f"answers: expected three sequences of one length, got {x.shape}, {k.shape}, {n.shape}")
    if (n < 1).any() or (k < 0).any() or (k > n).any() or not (np.isfinite(x) & (x >= 0)).all():
        raise InputError("answers: expected levels of 0 or more and 0 <= correct <= total with total >= 1")
    values, where = np.unique(x, return_inverse=True)
    hits, trials = (np.asarray(np.bincount(where, weights=w), np.float64) for w in (k, n))
    return values, hits, trials
