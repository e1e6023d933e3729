"""How many people a study needs: by formula for the paired t, by simulation for everything else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.progress import passing
from midair.study.statistics.confusion import Confusion, chance_macro_f, wilson
from midair.study.statistics.detection import proportion_correct
from midair.study.statistics.paired import equivalence, holm

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
    found = sum(experiment(participants, rng) < alpha for _ in passing(range(runs), runs))
    low, high = wilson(found, runs)
    return Power(power=found / runs, low=float(low), high=float(high), participants=participants, runs=runs)


def power_curve(
    experiment: Experiment, candidates: Sequence[int], *, rng: np.random.Generator, runs: int = 500, alpha: float = 0.05
) -> DataFrame:
    """Power for several numbers of people: columns participants, power, low, high."""
    from pandas import DataFrame

    # A study of more people takes longer to simulate.
    each = passing(candidates, sum(candidates), weight=lambda n: n)
    found = [simulated_power(experiment, n, rng=rng, runs=runs, alpha=alpha) for n in each]
    return DataFrame(map(asdict, found), columns=["participants", "power", "low", "high"])


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentificationExperiment:
    """People tell objects apart better than chance: the test of the report, macro F against shuffled answers.

    Attributes
    ----------
    objects, trials : int
        m alternatives, and trials a person, which is rounded to a whole number for each object.
    d_prime : float
        Mean over people.
    spread : float
        Standard deviation of d' over people.
    draws : int
        Shuffles; fewer than those of the report cost little power, and keep the level of the test.
    """

    objects: int
    trials: int
    d_prime: float
    spread: float = 0.3
    draws: int = 199

    def __call__(self, participants: int, rng: np.random.Generator) -> float:
        """P-value of one simulated study, one-sided."""
        d = rng.normal(self.d_prime, self.spread, participants)
        right = proportion_correct(d, alternatives=self.objects)
        each = max(round(self.trials / self.objects), 1)
        shares = np.repeat((1 - right)[:, None] / (self.objects - 1), self.objects, axis=1)
        tables = []
        for thing in range(self.objects):
            chances = shares.copy()
            chances[:, thing] = right
            tables.append(rng.multinomial(each, chances))
        confusion = Confusion(
            by_person=np.stack(tables, axis=1),
            labels=tuple(range(self.objects)),
            participants=tuple(range(participants)),
        )
        return chance_macro_f(confusion, rng=rng, draws=self.draws).p


@dataclass(frozen=True, slots=True, kw_only=True)
class RatingExperiment:
    """One factor moves a rating: p_Holm of its effect in the analysis of variance of all factors, as in the report.

    Attributes
    ----------
    means : tuple of float
        True mean rating at each level of the factor.
    others : tuple of int
        Number of levels of each further factor, none of which matters; Holm corrects for all effects together, seven
        with two further factors.
    groups : tuple of int
        Number of levels of each factor between people, none of which matters; people are spread over them evenly.
    noise : float
        Standard deviation of the mean rating of one person at one level of the factor, over the cells of the others,
        the person's own level left out.
    person : float
        Standard deviation of people's levels.
    """

    means: tuple[float, ...]
    others: tuple[int, ...] = ()
    groups: tuple[int, ...] = ()
    noise: float = 1.0
    person: float = 0.8

    def __call__(self, participants: int, rng: np.random.Generator) -> float:
        """P-value of one simulated study."""
        from midair.study.statistics.anova import rm_anova

        shape = (participants, len(self.means), *self.others)
        y = rng.normal(0, self.noise * float(np.prod(self.others)) ** 0.5, shape)
        y += rng.normal(0, self.person, (participants, *[1] * (len(shape) - 1)))
        y += np.array(self.means).reshape(1, -1, *[1] * len(self.others))
        who, *cells = (where.ravel() for where in np.indices(shape))
        names = [f"factor{number}" for number in range(len(cells))]
        table = {"y": y.ravel(), "who": who, **dict(zip(names, cells, strict=True))}
        between = [f"group{number}" for number in range(len(self.groups))]
        if between:
            member = np.unravel_index(who % int(np.prod(self.groups)), self.groups)
            table |= dict(zip(between, member, strict=True))
        found = rm_anova(table, value="y", participant="who", within=names, between=between)
        return float(holm(found["p_GG"].to_numpy())[found["effect"].tolist().index(names[0])])


@dataclass(frozen=True, slots=True, kw_only=True)
class EquivalenceExperiment:
    """Two conditions between which people differ, but not on average: the report's two one-sided tests.

    Attributes
    ----------
    margin : float
        Largest difference that does not matter, in standard deviations of people's differences.
    """

    margin: float

    def __call__(self, participants: int, rng: np.random.Generator) -> float:
        """P-value of one simulated study."""
        return equivalence(rng.normal(size=participants), np.zeros(participants), margin=self.margin).p
