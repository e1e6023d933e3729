"""Posterior of one person's threshold, with false alarms, side bias, lapses and slope unknown."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError, ShapeError
from midair.study.statistics.psychometric_fit import sigmoid

ThresholdTask = Literal["detection", "two sides", "choice"]
"""Signal or blank ("yes" or "no"); which of two sides, positions or intervals; one of three alternatives or more."""

WIDEST = 25.0
"""Largest ratio of the limits of a threshold that is reported."""
MISFIT = 0.01
"""Smallest posterior predictive p-value of a threshold that is reported."""
PRIORS = (
    "Priors: log threshold uniform from half of the lowest to twice the highest level; log slope uniform from 0.8 to"
    " 10; lapse rate Beta(1, 13) on six values from 0 to the limit of the plan; false-alarm rate Beta(1, 3) up to"
    " 0.6 (yes or no); side bias normal with standard deviation 3, up to 1.75 (two sides)."
)
"""Priors of `ThresholdModel`, for reports."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ThresholdEstimate:
    """Threshold of one person."""

    threshold: float
    """Median of the posterior, in the unit of the levels; F is 1 - 1/e there."""
    sd: float
    """Standard deviation of the posterior, in the unit of the levels."""
    low: float
    high: float
    """`low`, `high`: 2.5 and 97.5 % quantiles of the posterior."""
    bias: float
    """Posterior mean of the false-alarm rate (detection) or of the side bias in standard deviations (two sides); NaN
    for a choice."""
    lapse: float
    """Posterior mean of the lapse rate."""
    p_misfit: float
    """Posterior predictive p-value of the deviance; small values show that the model does not fit."""

    def refusal(self, levels: Array) -> str:
        """Reason why the answers give no threshold on these levels; empty if they do."""
        if self.p_misfit < MISFIT:
            return f"refused: the model of the answers does not fit (p = {self.p_misfit:.3f}, limit {MISFIT:g})"
        if not levels[0] <= self.threshold <= levels[-1]:
            return (
                f"refused: the threshold is beyond the levels {levels[0]:g} to {levels[-1]:g} (estimate"
                f" {self.threshold:.3g})"
            )
        if self.high / self.low > WIDEST:
            return (
                f"refused: the answers determine it only to {self.low:.3g} to {self.high:.3g}, a factor of"
                f" {self.high / self.low:.2g} (limit {WIDEST:g})"
            )
        return ""

    def ranked(self, levels: Array) -> float:
        """Threshold, or inf or -inf where it is beyond the levels; NaN where it is refused for another reason."""
        beyond = np.inf if self.threshold > levels[-1] else -np.inf if self.threshold < levels[0] else np.nan
        return self.threshold if not self.refusal(levels) else np.nan if self.p_misfit < MISFIT else float(beyond)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ThresholdModel:
    """Probability of each answer for a grid of observers, with their prior.

    F(x) = 1 - exp(-(x / threshold)^slope), Weibull. Probability of the counted answer, by `task`:

    - "detection", "yes" at level x: a + (1 - a - lapse) F(x), with the false-alarm rate a; "yes" to a blank: a.
    - "two sides", first side where it is correct: lapse + (1 - 2 lapse) Phi(z(x) + b); where the second side is
      correct: 1 - lapse - (1 - 2 lapse) Phi(z(x) - b); without a difference: lapse + (1 - 2 lapse) Phi(b). Here z(x) =
      Phi^-1(1/2 + F(x) / 2), so that an unbiased observer has (1 + F) / 2 correct answers, and b is the side bias in
      standard deviations of the difference of the two internal values (Macmillan and Creelman, 2005, chapter 7).
    - "choice", correct answer of m alternatives: 1/m + (1 - 1/m - lapse) F(x).

    `PRIORS` states the priors; the limit of the lapse rate is `lapse_most`. The steps of the grid suit blocks of up to
    about 500 trials.
    """

    task: ThresholdTask
    levels: Array
    """Shape (level,): rising, above 0."""
    alternatives: int = 2
    """m, for "choice"."""
    lapse_most: float
    """Largest lapse rate."""
    coarse: bool = False
    """Whether the grid is coarse, for the choice of the next level."""
    axes: tuple[Array, Array, Array, Array] = field(init=False)
    """Log thresholds, log slopes, lapse rates, and false-alarm rates or side biases."""
    chance: Array = field(init=False)
    """Shape (cell, observer): probability of the counted answer. Cells: the levels (detection, choice), or the levels
    with the first and then with the second side correct (two sides); then blanks, except in a choice."""
    logarithms: tuple[Array, Array] = field(init=False)
    """Logarithms of `chance` and of its complement."""
    log_prior: Array = field(init=False)
    """Shape (observer,)."""

    def __post_init__(self) -> None:
        if self.levels.ndim != 1 or not self.levels.size or self.levels.min() <= 0:
            raise InputError(f"levels: expected a list of numbers above 0, got shape {self.levels.shape}")
        if not 0 <= self.lapse_most < 0.5 or self.alternatives < 2:
            raise InputError(
                f"threshold: expected lapse_most from 0 to below 0.5 and two alternatives or more, got"
                f" {self.lapse_most:g} and {self.alternatives}"
            )
        places, slopes = (25, np.geomspace(1, 6, 3)) if self.coarse else (121, np.geomspace(0.8, 10, 7))
        axes = (
            np.linspace(np.log(self.levels[0] / 2), np.log(self.levels[-1] * 2), places),
            np.log(slopes),
            np.linspace(0.15, 0.55, 2) * self.lapse_most if self.coarse else np.linspace(0, self.lapse_most, 6),
            self._biases(),
        )
        grid = np.meshgrid(*axes, indexing="ij")
        chance = self._chance(*(each.ravel() for each in grid))
        bias = grid[3].ravel()
        prior = (35 if self.coarse else 12) * np.log1p(-grid[2].ravel())
        if self.task == "detection":
            prior += 2 * np.log1p(-bias)
        elif self.task == "two sides":
            prior -= (bias / 3) ** 2 / 2
        object.__setattr__(self, "axes", axes)
        chance = np.clip(chance, 1e-6, 1 - 1e-6)
        object.__setattr__(self, "chance", chance)
        object.__setattr__(self, "logarithms", (np.log(chance), np.log1p(-chance)))
        object.__setattr__(self, "log_prior", prior)

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.chance)

    def posterior(self, counted: Array, total: Array) -> Array:
        """Weights of the observers, shape (..., observer) with sum 1, after answers of shape (..., cell)."""
        if counted.shape != total.shape or counted.shape[-1:] != (self.cells,):
            raise ShapeError(f"answers: expected counts in {self.cells} cells, got {counted.shape}, {total.shape}")
        yes, no = self.logarithms
        height = self.log_prior + counted @ yes + (total - counted) @ no
        weight = np.exp(height - height.max(axis=-1, keepdims=True))
        return weight / weight.sum(axis=-1, keepdims=True)

    def next_level(self, weight: Array) -> NDArray[np.int64]:
        """Index of the level whose answer has the least expected entropy of the threshold, for each set of weights.

        The entropy is that of the threshold alone, without slope, lapses and bias (Prins, 2013, Journal of Vision
        13(7):3); with two sides, that of the mean over the sides.
        """
        places, levels = len(self.axes[0]), len(self.levels)
        whole = weight.reshape(-1, places, weight.shape[-1] // places).transpose(1, 0, 2)
        entropy = np.zeros((whole.shape[1], self.cells))
        for chance in (self.chance, 1 - self.chance):
            joint = whole @ chance.reshape(self.cells, places, -1).transpose(1, 2, 0)
            share = joint.sum(axis=0)
            entropy += share * np.log(share) - (joint * np.log(np.maximum(joint, 1e-300))).sum(axis=0)
        if self.task == "two sides":
            entropy[:, :levels] += entropy[:, levels : 2 * levels]
        return np.asarray(entropy[:, :levels].argmin(axis=1)).reshape(weight.shape[:-1])

    def estimate(
        self, counted: Array, total: Array, *, rng: np.random.Generator, draws: int = 400
    ) -> ThresholdEstimate:
        """Threshold from answers of shape (cell,); `rng` draws the data sets of the posterior predictive p-value."""
        weight = self.posterior(counted, total)
        whole = weight.reshape([len(axis) for axis in self.axes])
        middle, low, high = (float(each) for each in self.summary(weight))
        marginal = whole.sum(axis=(1, 2, 3))
        strength = np.exp(self.axes[0])
        sd = np.sqrt(marginal @ strength**2 - (marginal @ strength) ** 2)
        drawn = self.chance[:, rng.choice(len(weight), size=draws, p=weight)].T
        data = rng.binomial(total.astype(int), drawn).astype(float)
        seen, known = _deviance(counted, total, drawn), _deviance(data, total, drawn)
        return ThresholdEstimate(
            threshold=middle,
            sd=float(sd),
            low=low,
            high=high,
            bias=float("nan") if self.task == "choice" else float(whole.sum(axis=(0, 1, 2)) @ self.axes[3]),
            lapse=float(whole.sum(axis=(0, 1, 3)) @ self.axes[2]),
            p_misfit=float(np.mean(known >= seen)),
        )

    def summary(self, weight: Array) -> Array:
        """Median, 2.5 and 97.5 % quantiles of the threshold, shape (3, ...), for weights (..., observer)."""
        places = self.axes[0]
        marginal = weight.reshape(*weight.shape[:-1], len(places), -1).sum(axis=-1)
        step = places[1] - places[0]
        edges = np.r_[places[0] - step / 2, places + step / 2]
        below = np.concatenate([np.zeros((*marginal.shape[:-1], 1)), marginal.cumsum(axis=-1)], axis=-1)
        flat = below.reshape(-1, below.shape[-1])
        found = np.array([np.interp((0.5, 0.025, 0.975), one, edges) for one in flat])
        return np.exp(found.T.reshape(3, *marginal.shape[:-1]))

    def _biases(self) -> Array:
        if self.task == "detection":
            return np.array([0.02, 0.1, 0.3]) if self.coarse else (np.arange(12) + 0.5) / 12 * 0.6
        if self.task == "two sides":
            return np.linspace(-0.8, 0.8, 3) if self.coarse else np.linspace(-1.75, 1.75, 15)
        return np.array([1 / self.alternatives])

    def _chance(self, place: Array, slope: Array, lapse: Array, bias: Array) -> Array:
        from scipy.special import ndtr, ndtri

        rise = sigmoid(self.levels[:, None], np.exp(place), np.exp(slope), "weibull")
        if self.task == "choice":
            return bias + (1 - bias - lapse) * rise
        if self.task == "detection":
            return np.vstack([bias + (1 - bias - lapse) * rise, bias])
        z = ndtri(np.minimum(0.5 + rise / 2, 1 - 1e-12))
        kept = 1 - 2 * lapse
        return np.vstack([lapse + kept * ndtr(z + bias), 1 - lapse - kept * ndtr(z - bias), lapse + kept * ndtr(bias)])


def _deviance(counted: Array, total: Array, chance: Array) -> Array:
    """Deviance of counts from the saturated model, shape (draw,), for chances of shape (draw, cell)."""
    from scipy.special import xlogy

    missed, expected = total - counted, total * chance
    fit = xlogy(counted, expected) + xlogy(missed, total - expected)
    return np.asarray(2 * (xlogy(counted, counted) + xlogy(missed, missed) - fit).sum(axis=-1))
