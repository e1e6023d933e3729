"""Power and sample size: closed form for the paired t-test, simulation for all other tests.

And the statistics that follow from the numbers printed in section 5.3 of the paper.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np
import scipy
from pandas import DataFrame

from midair.errors import InputError
from midair.progress import report_progress
from midair.study.statistics.anova import noncentral_t_limits
from midair.study.statistics.confusion import Chance, Confusion, chance_macro_f, f_measure, wilson
from midair.study.statistics.detection import d_prime_choice, proportion_correct
from midair.study.statistics.paired import bayes_factor, equivalence, holm, order_rank
from midair.validation import within

Experiment = Callable[[int, np.random.Generator], float]
"""Function of the number of participants and a random generator that returns the p-value of the planned test."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Power:
    """Power estimated from simulated studies."""

    power: float
    low: float
    high: float
    """`power`, `low`, `high`: share of simulated studies with p < alpha, and its 95 % limits."""
    participants: int
    runs: int
    """Number of simulated studies."""


def power_paired_t(participants: int, *, d_z: float, alpha: float = 0.05) -> float:
    """Power of a two-sided paired t-test, from the noncentral t distribution.

    `d_z` is the true mean difference over the standard deviation of the differences, `alpha` the significance level.
    """
    within(participants, "participants", 2)
    edge = float(scipy.stats.t.ppf(1 - alpha / 2, participants - 1))
    shift = abs(d_z) * participants**0.5
    # A two-sided test also rejects on the opposite side, which matters for small effects.
    return float(
        scipy.stats.nct.sf(edge, participants - 1, shift) + scipy.stats.nct.cdf(-edge, participants - 1, shift)
    )


def participants_for_paired_t(*, d_z: float, power: float = 0.8, alpha: float = 0.05, most: int = 10_000) -> int:
    """Smallest number of pairs that reaches a power; raises InputError if `most` pairs do not reach it."""
    low, high = 1, 2
    while power_paired_t(high, d_z=d_z, alpha=alpha) < power:
        low, high = high, 2 * high
        if low > most:
            raise InputError(f"power: expected to reach {power:g} with d_z = {d_z:g} and {most} pairs, got less")
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if power_paired_t(middle, d_z=d_z, alpha=alpha) >= power else (middle, high)
    return high


def power_median(participants: int, *, distance: float, alpha: float = 0.05) -> float:
    """Probability that the limits of a median by order statistics exclude a bound (sign test; normal values).

    `distance` is that of the bound from the true median, over the standard deviation of the values.
    """
    within(participants, "participants", 2)
    rank, beyond = order_rank(participants, alpha=alpha) - 1, float(scipy.stats.norm.cdf(-abs(distance)))
    return float(sum(scipy.stats.binom.cdf(rank, participants, share) for share in (beyond, 1 - beyond)))


def participants_for_median(*, distance: float, power: float = 0.8, alpha: float = 0.05, most: int = 10_000) -> int:
    """Smallest number of people for `power_median`; raises InputError if `most` people do not reach it."""
    for many in range(2, most + 1):
        if power_median(many, distance=distance, alpha=alpha) >= power:
            return many
    raise InputError(f"power: expected to reach {power:g} with a distance of {distance:g} and {most} people, got less")


def simulated_power(
    experiment: Experiment, participants: int, *, rng: np.random.Generator, runs: int = 500, alpha: float = 0.05
) -> Power:
    """Share of simulated studies whose planned test has p < alpha."""
    within(runs, "runs", 1)
    found = sum(experiment(participants, rng) < alpha for _ in report_progress(range(runs), runs))
    low, high = wilson(found, runs)
    return Power(power=found / runs, low=float(low), high=float(high), participants=participants, runs=runs)


def power_curve(
    experiment: Experiment, candidates: Sequence[int], *, rng: np.random.Generator, runs: int = 500, alpha: float = 0.05
) -> DataFrame:
    """Power for several numbers of participants: columns participants, power, low, high."""
    # The simulation time grows with the number of participants.
    each = report_progress(candidates, sum(candidates), weight=lambda n: n)
    found = [simulated_power(experiment, n, rng=rng, runs=runs, alpha=alpha) for n in each]
    return DataFrame(map(asdict, found), columns=["participants", "power", "low", "high"])


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentificationExperiment:
    """Identification above chance: the permutation test of macro F that the report uses."""

    objects: int
    trials: int
    """Trials per participant, rounded to a multiple of `objects`, the number of alternatives."""
    d_prime: float
    """Mean d' over participants."""
    spread: float = 0.3
    """Standard deviation of d' over participants."""
    draws: int = 199
    """Permutations; fewer than in the report cost little power and keep the significance level."""

    def __call__(self, participants: int, rng: np.random.Generator) -> float:
        """One-sided p-value of one simulated study."""
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
    """Effect of one factor on a rating: its Holm-corrected p_GG in the analysis of variance of all factors."""

    means: tuple[float, ...]
    """True mean rating at each level of the factor."""
    others: tuple[int, ...] = ()
    """Levels of further within-subject factors without an effect; Holm's correction covers all effects."""
    groups: tuple[int, ...] = ()
    """Levels of between-subject factors without an effect; participants are assigned evenly."""
    noise: float = 1.0
    """Standard deviation of a participant's mean rating at one level of the factor, over the cells of the others,
    without the participant's own level."""
    person: float = 0.8
    """Standard deviation of the participants' levels."""

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
    """Two one-sided tests of conditions that have no mean difference."""

    margin: float
    """Equivalence margin, in standard deviations of the participants' differences."""

    def __call__(self, participants: int, rng: np.random.Generator) -> float:
        """P-value of one simulated study."""
        return equivalence(rng.normal(size=participants), np.zeros(participants), margin=self.margin).p


@dataclass(frozen=True, slots=True, kw_only=True)
class Published:
    """Numbers printed in section 5.3."""

    t: float = 1.60
    """Student's t of the paired test over objects, two surfaces."""
    objects: int = 3
    """Pairs of that test, and alternatives of the choice."""
    people: int = 10
    real_trials: int = 12
    """Trials per participant with real objects."""
    scored_trials: int = 12
    """Trials per participant and surface."""
    real_correct: float = 0.95
    """Share of correct answers with real objects, printed as "over 95 %"."""

    @property
    def trials_an_object(self) -> int:
        """Answers to each object of one surface, over all participants."""
        return self.people * self.scored_trials // self.objects


def published_statistics() -> DataFrame:
    """Statistics that follow from the printed numbers alone.

    Columns quantity, value, low, high (95 % limits, NaN where undefined).
    """
    paper = Published()
    n, d_z = paper.objects, paper.t / paper.objects**0.5
    low, high = (limit / n**0.5 for limit in noncentral_t_limits(paper.t, n - 1))
    trials = paper.people * paper.real_trials
    # "Over 95 %": the smallest number of answers above it.
    fewest = int(np.floor(paper.real_correct * trials)) + 1
    share = wilson(fewest, trials)
    sense = d_prime_choice(fewest, trials, alternatives=n)
    margin = d_z + float(scipy.stats.t.ppf(0.95, n - 1)) / n**0.5
    rows = [
        ("p of t(2) = 1.60, two-sided", 2 * float(scipy.stats.t.sf(paper.t, n - 1)), np.nan, np.nan),
        ("d_z over objects", d_z, low, high),
        ("power of the test at d_z = 0.5", power_paired_t(n, d_z=0.5), np.nan, np.nan),
        ("power of the test at d_z = 1", power_paired_t(n, d_z=1.0), np.nan, np.nan),
        ("power of the test at d_z = 2", power_paired_t(n, d_z=2.0), np.nan, np.nan),
        ("smallest margin of equivalence at .05, in standard deviations", margin, np.nan, np.nan),
        ("Bayes factor for a difference", bayes_factor(paper.t, n), np.nan, np.nan),
        (f"share right of real objects, at least {fewest} of {trials}", fewest / trials, *map(float, share)),
        (f"d' of real objects at {fewest} of {trials}", sense.d_prime, sense.low, sense.high),
    ]
    return DataFrame(rows, columns=["quantity", "value", "low", "high"])


def chance_of_published(value: float = 1 / 3, *, rng: np.random.Generator, draws: int = 20_000) -> Chance:
    """Macro F of participants who answer at random, with the paper's number of trials; `value` is compared."""
    paper = Published()
    size = paper.objects
    counts = rng.multinomial(paper.trials_an_object, [1 / size] * size, size=(draws, size))
    distribution = f_measure(counts).mean(axis=-1)
    return Chance(value=value, distribution=distribution, p=float(np.mean(distribution >= value)))
