"""The paper's published statistics (section 5.3), made again from what is printed, and what they can support."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from midair.study.statistics.confusion import f_measure, wilson
from midair.study.statistics.detection import d_prime_choice
from midair.study.statistics.paired import bayes_factor
from midair.study.statistics.power import power_paired_t
from midair.study.statistics.resample import Chance

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, slots=True, kw_only=True)
class Published:
    """What section 5.3 prints.

    Attributes
    ----------
    t : float
        Student's t of the paired test over objects, two surfaces.
    objects : int
        Pairs of that test, and alternatives of the choice.
    people : int
        Participants.
    real_trials, scored_trials : int
        Number of trials of each participant: with real objects, and of each surface.
    real_correct : float
        "over 95 %": share of right answers with real objects.
    """

    t: float = 1.60
    objects: int = 3
    people: int = 10
    real_trials: int = 12
    scored_trials: int = 12
    real_correct: float = 0.95

    @property
    def trials_an_object(self) -> int:
        """Answers to each object of one surface, over all people."""
        return self.people * self.scored_trials // self.objects


def derive(published: Published | None = None) -> DataFrame:
    """Everything that follows from the printed numbers alone.

    Returns
    -------
    DataFrame
        Columns quantity, value, low, high (95 % limits, NaN where there are none).
    """
    from pandas import DataFrame
    from scipy.stats import t as t_distribution

    paper = published or Published()
    n, d_z = paper.objects, paper.t / paper.objects**0.5
    low, high = _effect_limits(paper.t, n)
    trials = paper.people * paper.real_trials
    # "Over 95 %": the next whole number of answers above it.
    fewest = int(np.floor(paper.real_correct * trials)) + 1
    share = wilson(fewest, trials)
    sense = d_prime_choice(fewest, trials, alternatives=n)
    margin = d_z + float(t_distribution.ppf(0.95, n - 1)) / n**0.5
    rows = [
        ("p of t(2) = 1.60, two-sided", 2 * float(t_distribution.sf(paper.t, n - 1)), np.nan, np.nan),
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


def chance_of_published(
    value: float = 1 / 3, *, rng: np.random.Generator, draws: int = 20_000, published: Published | None = None
) -> Chance:
    """Macro F of people who answer at random, for as many trials as the paper had on one surface.

    Parameters
    ----------
    value : float
        A macro F to hold against it.
    rng : Generator
        Draws the answers.
    draws : int
        Number of studies.
    published : Published, optional
        Numbers of trials and objects.
    """
    paper = published or Published()
    size = paper.objects
    counts = rng.multinomial(paper.trials_an_object, [1 / size] * size, size=(draws, size))
    distribution = f_measure(counts).mean(axis=-1)
    return Chance(value=value, distribution=distribution, p=float(np.mean(distribution >= value)))


def _effect_limits(t: float, n: int) -> tuple[float, float]:
    """Limits (95 %) of d_z: the noncentral t distributions of which t is the 2.5th and the 97.5th percentile."""
    from scipy.optimize import brentq
    from scipy.stats import nct

    def excess(shift: float, share: float) -> float:
        return float(nct.cdf(t, n - 1, shift)) - share

    low, high = (float(brentq(excess, -30, 60, args=(share,))) for share in (0.975, 0.025))
    return low / n**0.5, high / n**0.5
