"""Permutation tests and jackknife intervals over participants; confusion matrices: precision, recall, F."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray
from pandas import DataFrame

from midair.array_types import Array
from midair.errors import InputError, ShapeError
from midair.study.statistics.columns import levels
from midair.validation import one_of

Scale = Literal["plain", "share", "positive"]
"""Unbounded values; between 0 and 1; above 0."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chance:
    """Statistic with its distribution under the null hypothesis."""

    value: float
    """Observed value."""
    distribution: Array
    """Values under the null hypothesis, shape (draw,)."""
    p: float
    """Share of the distribution at least as extreme as the value, which counts as one draw."""

    @property
    def mean(self) -> float:
        """Mean of the distribution."""
        return float(self.distribution.mean())

    @property
    def range95(self) -> tuple[float, float]:
        """2.5th and 97.5th percentile of the distribution."""
        low, high = np.quantile(self.distribution, [0.025, 0.975])
        return float(low), float(high)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Interval:
    """Statistic with its confidence interval."""

    value: Array
    low: Array
    high: Array
    """`value`, `low`, `high` have the same shape."""
    level: float
    """Confidence level."""
    people: int
    """Number of participants."""


def percentile_p(value: float, distribution: Array) -> float:
    """Share of a distribution at or above a value, the value included (Phipson and Smyth, 2010)."""
    # Draws equal to the value up to rounding are counted.
    slack = 1e-12 * max(1.0, abs(value))
    return float((1 + np.count_nonzero(distribution >= value - slack)) / (1 + len(distribution)))


def sign_flip(z: NDArray[Any], *, rng: np.random.Generator, draws: int = 10_000) -> float:
    """Two-sided p-value of a nonzero mean by flipping the signs of whole participants.

    `z`, shape (participant,) or (participant, contrast), holds a difference or the contrasts of one effect, symmetric
    about zero under the null hypothesis. The p-value is the share of sign patterns for which ``|sum of z|`` is at least
    as large as observed: exact over all 2^n patterns for up to 13 participants, `draws` random patterns for more.
    """
    z = np.asarray(z, float).reshape(len(z), -1)
    if len(z) < 2:
        raise InputError(f"participants: expected two or more to flip signs, got {len(z)}")
    observed = float((z.sum(axis=0) ** 2).sum())
    # All 2^13 sign patterns are fewer than the random ones.
    if len(z) <= 13:
        turns = 1.0 - 2.0 * ((np.arange(2 ** len(z))[:, None] >> np.arange(len(z))) & 1)
        size = ((turns @ z) ** 2).sum(axis=1)
        return float(np.mean(size >= observed * (1 - 1e-9)))
    size = ((rng.choice([-1.0, 1.0], size=(draws, len(z))) @ z) ** 2).sum(axis=1)
    return percentile_p(observed, size)


def limits_over_people(
    statistic: Callable[[NDArray[Any]], Any],
    by_person: NDArray[Any],
    *,
    scale: Scale = "plain",
    level: float = 0.95,
    answers: Callable[[NDArray[Any]], Any] | None = None,
    added: tuple[float, float] = (1.0, 1.0),
    independent: bool = True,
) -> Interval:
    """Confidence interval of a statistic over participants: the jackknife with Student's t (Efron and Stein, 1981).

    The statistic is recomputed without each participant. On an unbounded scale (logit of a share, logarithm of a
    positive value) its standard error is sqrt((n - 1) / n sum (without_i - mean)^2), and
    the limits are the t quantile with n - 1 degrees of freedom times that error away. Two corrections improve the
    coverage: shares are shrunk towards one half by `added` wrong and correct answers (otherwise the coverage rises to
    0.98 near a share of 1); and if fewer answers are wrong (or correct) than there are participants, the limits are at
    least as wide as those of independent answers (otherwise the coverage is 0.92). For F with five participants the
    coverage of a nominal 0.95 is 0.94 to 0.97; a bootstrap over participants (BCa) reaches 0.83 to 0.86
    (docs/decisions/0034-analysis.md). Raises InputError if there are fewer than five participants, where the coverage
    is too low, or the scale is unknown.

    `statistic` is a function of an array like `by_person`, shape (participant, ...), for any number of participants,
    that returns a number or an array; `answers` such a function that returns the number of answers behind a "share".
    `added` are the answers of each kind added for the centre of the interval, and for its width;
    `independent` answers have a binomial variance where few are wrong. The interval has the shape of the statistic; its
    limits are NaN if the statistic is at its bound or equal without any participant.
    """
    one_of(scale, Scale, "scale")
    people = len(by_person)
    if people < 5:
        raise InputError(
            f"limits over participants: expected five participants or more, got {people}; with fewer, the coverage is"
            " below the nominal level"
        )
    value = np.asarray(statistic(by_person), float)
    others = [np.delete(by_person, i, axis=0) for i in range(people)]
    without = np.array([statistic(rest) for rest in others], float)
    if answers is not None and scale == "share":
        total, left = np.asarray(answers(by_person), float), np.array([answers(rest) for rest in others], float)
        middle = _to_open_scale(_shrink(value, total, added[0]), scale)
        moved = _to_open_scale(_shrink(without, left, added[1]), scale)
    else:
        middle, moved = _to_open_scale(value, scale), _to_open_scale(without, scale)
    error = np.sqrt((people - 1) / people * ((moved - moved.mean(axis=0)) ** 2).sum(axis=0))
    half = error * float(scipy.stats.t.ppf((1 + level) / 2, people - 1))
    if answers is not None and independent and scale == "share":
        half = np.maximum(half, _binomial_half(value, np.asarray(answers(by_person), float), people, level))
    # At a bound, or if all leave-one-out values are equal, the standard error is unknown.
    known = (error > 1e-12) & (_to_open_scale(value, scale, reach=np.inf) == _to_open_scale(value, scale))
    low, high = (np.where(known, _from_open_scale(middle + side * half, scale), np.nan) for side in (-1, 1))
    # The centre is shrunk, so the limits are extended to include the statistic itself.
    low, high = np.minimum(low, value), np.maximum(high, value)
    return Interval(value=value, low=low, high=high, level=level, people=people)


def _binomial_half(share: Array, total: Array, people: int, level: float) -> Array:
    """Half-width for independent answers on the logit scale; 0 unless one kind is rarer than the participants.

    The logit of a share p of n answers has the variance 1 / (n p (1 - p)).
    """
    few = total * np.minimum(share, 1 - share) < people
    drawn = (share * total + 1) / (total + 2)
    error = 1 / np.sqrt((total + 2) * drawn * (1 - drawn))
    return np.where(few, float(scipy.stats.norm.ppf((1 + level) / 2)) * error, 0.0)


def _shrink(share: Array, total: Array, added: float) -> Array:
    """A share after `added` answers of both kinds are added."""
    return (share * total + added) / (total + 2 * added)


def _to_open_scale(value: Array, scale: Scale, *, reach: float = 7.0) -> Array:
    """Transform to an unbounded scale; values at a bound become `reach` (7: a share of 0.999)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        if scale == "share":
            return np.clip(np.log(value) - np.log1p(-value), -reach, reach)
        return np.log(value) if scale == "positive" else value


def _from_open_scale(value: Array, scale: Scale) -> Array:
    """Inverse of `_to_open_scale`."""
    if scale == "share":
        return 1 / (1 + np.exp(-value))
    return np.exp(value) if scale == "positive" else value


Counts = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Confusion:
    """Confusion matrix of each participant."""

    by_person: Counts
    """Number of trials, shape (participant, presented, answered); foils are the last columns."""
    labels: tuple[Any, ...]
    """Names of the objects, for both axes."""
    participants: tuple[Any, ...]
    foils: tuple[Any, ...] = ()
    """Names of possible answers that were never presented."""

    @property
    def counts(self) -> Counts:
        """Sum over participants, shape (presented, answered)."""
        return self.by_person.sum(axis=0)

    @property
    def accuracy(self) -> float:
        """Share of correct answers."""
        return float(np.trace(self.counts) / self.counts.sum())

    @property
    def f_measure(self) -> Array:
        """F of each object over all participants, shape (object,)."""
        return f_measure(self.counts)

    @property
    def macro_f(self) -> float:
        """Mean F over the objects."""
        return float(self.f_measure.mean())

    @property
    def macro_f_by_person(self) -> Array:
        """Macro F of each participant, shape (participant,)."""
        return f_measure(self.by_person).mean(axis=-1)


def confusion_matrix(
    presented: Sequence[Any] | NDArray[Any],
    answered: Sequence[Any] | NDArray[Any],
    *,
    participant: Sequence[Any] | NDArray[Any] | None = None,
    labels: Sequence[Any] | None = None,
    foils: Sequence[Any] = (),
) -> Confusion:
    """Count the answers to each object by participant.

    `presented` and `answered` name an object for each trial, `participant` its participant (one if None). `labels` are
    the objects in the wanted order, by default those presented in order of appearance; `foils` are possible answers
    that are never correct and count as wrong. Raises ShapeError if the lengths differ or are 0; InputError if an object
    was never presented, or an answer is no known object.
    """
    truth, answer = np.asarray(presented), np.asarray(answered)
    who = np.zeros(len(truth), int) if participant is None else np.asarray(participant)
    if truth.shape != answer.shape or truth.shape != who.shape or truth.size == 0:
        raise ShapeError(f"trials: expected equal lengths above 0, got {truth.size}, {answer.size}, {who.size}")
    order = list(labels) if labels is not None else levels(truth)[0]
    if len(order) < 2:
        raise InputError(f"objects: expected two or more to identify, got {order}")
    if missing := set(order) - set(truth.tolist()):
        raise InputError(f"objects: expected each to be presented, got no trial of {sorted(map(str, missing))}")
    people, person = levels(who)
    possible = [*order, *foils]
    shape = (len(people), len(order), len(possible))
    where = np.ravel_multi_index(
        (person, _label_indices(truth, order, "presented"), _label_indices(answer, possible, "answered")), shape
    )
    counts = np.bincount(where, minlength=int(np.prod(shape))).reshape(shape)
    return Confusion(by_person=counts, labels=tuple(order), participants=tuple(people), foils=tuple(foils))


def f_measure(counts: NDArray[Any]) -> Array:
    """F of each object: 2 hits / (presented + answered), the harmonic mean of precision and recall.

    From counts of shape (..., presented, answered) to (..., object); 0 for an object that was neither presented nor
    answered.
    """
    counts = np.asarray(counts, float)
    hits = np.diagonal(counts, axis1=-2, axis2=-1)
    both = counts.sum(axis=-1) + counts.sum(axis=-2)[..., : counts.shape[-2]]
    return np.asarray(2 * hits / np.maximum(both, 1e-300))


def scores(confusion: Confusion, *, level: float = 0.95) -> DataFrame:
    """Precision, recall and F of each object.

    Columns object, presented, answered, precision, recall, recall_low, recall_high, F, note. The interval of recall is
    Wilson's, which assumes independent trials; see `limits_over_people` for intervals over participants. The precision
    of an object that was never answered is NaN, and `note` says so.
    """
    counts = confusion.counts
    hits, given, said = np.diagonal(counts), counts.sum(axis=1), counts.sum(axis=0)[: len(counts)]
    low, high = wilson(hits, given, level=level)
    return DataFrame(
        {
            "object": list(confusion.labels),
            "presented": given,
            "answered": said,
            "precision": np.where(said > 0, hits / np.maximum(said, 1), np.nan),
            "recall": hits / given,
            "recall_low": low,
            "recall_high": high,
            "F": confusion.f_measure,
            "note": np.where(said > 0, "", "never answered: precision is undefined"),
        }
    )


def wilson(hits: Any, total: Any, *, level: float = 0.95) -> tuple[Array, Array]:
    """Wilson's (1927) confidence interval of a proportion; arrays broadcast.

    Raises InputError if a total is below 1 or hits lie outside 0 to total.
    """
    k, n = np.asarray(hits, float), np.asarray(total, float)
    if (n < 1).any() or (k < 0).any() or (k > n).any():
        raise InputError(f"proportion: expected 0 <= hits <= total and total >= 1, got {hits} of {total}")
    z = float(scipy.stats.norm.ppf((1 + level) / 2))
    middle = (k + z**2 / 2) / (n + z**2)
    half = z / (n + z**2) * np.sqrt(k * (n - k) / n + z**2 / 4)
    # With 0 or all hits, rounding can move a limit slightly outside 0 to 1.
    return np.maximum(middle - half, 0), np.minimum(middle + half, 1)


def chance_macro_f(confusion: Confusion, *, rng: np.random.Generator, draws: int = 10_000) -> Chance:
    """Permutation test of macro F against answers that are independent of the objects (one-sided p-value).

    Each participant's answers are shuffled over that participant's trials, which keeps the number of presentations and
    answers of each object.
    """
    total = np.zeros((draws, *confusion.counts.shape))
    for counts in confusion.by_person:
        total += _permuted_counts(counts, rng, draws)
    distribution = f_measure(total).mean(axis=-1)
    p = percentile_p(confusion.macro_f, distribution)
    return Chance(value=confusion.macro_f, distribution=distribution, p=p)


def _label_indices(values: NDArray[Any], order: list[Any], name: str) -> Counts:
    number = {label: i for i, label in enumerate(order)}
    unknown = [value for value in values.tolist() if value not in number]
    if unknown:
        raise InputError(f"{name}: expected one of {', '.join(map(str, order))}, got {unknown[0]!r}; give `labels`")
    return np.array([number[value] for value in values.tolist()], np.int64)


def _permuted_counts(counts: Counts, rng: np.random.Generator, draws: int) -> Counts:
    """Confusion matrices of one participant with shuffled answers, shape (draw, presented, answered)."""
    objects, answers = counts.shape
    truth = np.repeat(np.arange(objects), counts.sum(axis=1))
    answer = np.repeat(np.arange(answers), counts.sum(axis=0))
    shuffled = rng.permuted(np.broadcast_to(answer, (draws, answer.size)), axis=1)
    # A combined index of draw, object and answer counts all draws in one call.
    where = (np.arange(draws)[:, None] * objects + truth) * answers + shuffled
    return np.bincount(where.ravel(), minlength=draws * objects * answers).reshape(draws, objects, answers)
