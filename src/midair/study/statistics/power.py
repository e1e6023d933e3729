"""How many people a study needs: by formula for the paired t, by simulation for everything else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.study.statistics.confusion import wilson
from midair.study.statistics.detection import proportion_correct

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pandas import DataFrame

Array = NDArray[np.float64]
Experiment = Callable[[int, np.random.Generator], float]
"""From a number of people and a source of chance to the p-value of the planned test."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Power:
    """Chance that a test finds what is there.

    Attributes
    ----------
    power, low, high : float
        Share of simulated studies with p < alpha, and its 95 % limits.
    participants, runs : int
        People in each study, and studies.
    """

    power: float
    low: float
    high: float
    participants: int
    runs: int


def power_paired_t(participants: int, *, d_z: float, alpha: float = 0.05) -> float:
    """Power of a two-sided paired t-test, from the noncentral t distribution.

    Parameters
    ----------
    participants : int
        Pairs.
    d_z : float
        True mean difference over the standard deviation of differences.
    alpha : float
        Level of the test.
    """
    from scipy.stats import nct
    from scipy.stats import t as t_distribution

    if participants < 2:
        raise InputError(f"participants: expected two or more, got {participants}")
    edge = float(t_distribution.ppf(1 - alpha / 2, participants - 1))
    shift = abs(d_z) * participants**0.5
    # A two-sided test also rejects on the wrong side, which counts when the effect is small.
    return float(nct.sf(edge, participants - 1, shift) + nct.cdf(-edge, participants - 1, shift))


def participants_for_paired_t(*, d_z: float, power: float = 0.8, alpha: float = 0.05, most: int = 10_000) -> int:
    """Smallest number of pairs that reaches a power.

    Raises
    ------
    InputError
        If `most` pairs do not.
    """
    low, high = 1, 2
    while power_paired_t(high, d_z=d_z, alpha=alpha) < power:
        low, high = high, 2 * high
        if low > most:
            raise InputError(f"power: expected to reach {power:g} with d_z = {d_z:g} below {most} pairs; it needs more")
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if power_paired_t(middle, d_z=d_z, alpha=alpha) >= power else (middle, high)
    return high


def simulated_power(
    experiment: Experiment, participants: int, *, rng: np.random.Generator, runs: int = 500, alpha: float = 0.05
) -> Power:
    """Share of simulated studies whose planned test comes out below alpha."""
    if runs < 1:
        raise InputError(f"runs: expected 1 or more, got {runs}")
    found = sum(experiment(participants, rng) < alpha for _ in range(runs))
    low, high = wilson(found, runs)
    return Power(power=found / runs, low=float(low), high=float(high), participants=participants, runs=runs)


def power_curve(
    experiment: Experiment, candidates: Sequence[int], *, rng: np.random.Generator, runs: int = 500, alpha: float = 0.05
) -> DataFrame:
    """Power for several numbers of people: columns participants, power, low, high."""
    from pandas import DataFrame

    found = [simulated_power(experiment, n, rng=rng, runs=runs, alpha=alpha) for n in candidates]
    return DataFrame(map(asdict, found), columns=["participants", "power", "low", "high"])


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentificationExperiment:
    """People tell objects apart better than chance: t-test of each person's share of right answers against 1/m.

    Attributes
    ----------
    objects, trials : int
        m alternatives, and trials a person.
    d_prime : float
        Mean over people.
    spread : float
        Standard deviation of d' over people.
    """

    objects: int
    trials: int
    d_prime: float
    spread: float = 0.3

    def __call__(self, participants: int, rng: np.random.Generator) -> float:
        """P-value of one simulated study, one-sided; 1 if everyone is right equally often, at chance or below."""
        from scipy.stats import t as t_distribution

        d = rng.normal(self.d_prime, self.spread, participants)
        share = rng.binomial(self.trials, proportion_correct(d, alternatives=self.objects)) / self.trials
        above = float(share.mean()) - 1 / self.objects
        error = float(share.std(ddof=1)) / participants**0.5
        if error == 0:
            return 0.0 if above > 0 else 1.0
        return float(t_distribution.sf(above / error, participants - 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class RatingExperiment:
    """One within-participant factor moves a rating: p_GG of the repeated-measures analysis of variance.

    Attributes
    ----------
    means : tuple of float
        True mean rating at each level of the factor.
    noise : float
        Standard deviation of the mean rating of one person in one cell, the person's own level left out.
    person : float
        Standard deviation of people's levels.
    """

    means: tuple[float, ...]
    noise: float = 1.0
    person: float = 0.8

    def __call__(self, participants: int, rng: np.random.Generator) -> float:
        """P-value of one simulated study."""
        from midair.study.statistics.anova import rm_anova

        size = len(self.means)
        y = np.array(self.means) + rng.normal(0, self.noise, (participants, size))
        y = y + rng.normal(0, self.person, (participants, 1))
        who, level = np.indices(y.shape)
        table = {"y": y.ravel(), "who": who.ravel(), "level": level.ravel()}
        return float(rm_anova(table, value="y", participant="who", within=["level"])["p_GG"].iloc[0])
