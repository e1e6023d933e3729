"""Statistics that follow from the numbers printed in section 5.3 of the paper."""

from dataclasses import dataclass

import numpy as np
import scipy
from pandas import DataFrame

from midair.study.statistics.anova import noncentral_t_limits
from midair.study.statistics.confusion import Chance, f_measure, wilson
from midair.study.statistics.detection import d_prime_choice
from midair.study.statistics.paired import bayes_factor
from midair.study.statistics.power import power_paired


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
        ("power of the test at d_z = 0.5", power_paired(n, effect=0.5), np.nan, np.nan),
        ("power of the test at d_z = 1", power_paired(n, effect=1.0), np.nan, np.nan),
        ("power of the test at d_z = 2", power_paired(n, effect=2.0), np.nan, np.nan),
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
