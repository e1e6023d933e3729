"""Confusion matrices: precision, recall, F, kappa, mutual information and permutation tests."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError, ShapeError
from midair.study.statistics.columns import levels
from midair.study.statistics.resample import Chance, percentile_p

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pandas import DataFrame

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
    from pandas import DataFrame

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
    from scipy.stats import norm

    k, n = np.asarray(hits, float), np.asarray(total, float)
    if (n < 1).any() or (k < 0).any() or (k > n).any():
        raise InputError(f"proportion: expected 0 <= hits <= total and total >= 1, got {hits} of {total}")
    z = float(norm.ppf((1 + level) / 2))
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


def cohen_kappa(counts: NDArray[Any]) -> float:
    """Chance-corrected agreement of answers with objects (Cohen, 1960): (share - chance) / (1 - chance).

    `counts` has the shape (presented, answered); answers beyond the objects are wrong. 1 if all answers are correct, 0
    at the agreement expected from the marginal counts.
    """
    counts = np.asarray(counts, float)
    if counts.ndim != 2 or counts.shape[0] > counts.shape[1] or counts.sum() <= 0:
        raise ShapeError(f"counts: expected a table with answers, got shape {counts.shape}")
    share = counts / counts.sum()
    chance = float(share.sum(axis=1) @ share.sum(axis=0)[: len(counts)])
    return 1.0 if chance == 1 else (float(np.trace(share)) - chance) / (1 - chance)


def mutual_information(counts: NDArray[Any]) -> tuple[float, float]:
    """Mutual information between answer and object, in bits, from the number of trials (presented, answered).

    Returns the plug-in estimate, and the estimate minus its bias (r - 1)(c - 1) / (2 n ln 2), at least 0 (Miller,
    1955), with r and c the numbers of non-empty rows and columns. The maximum is log2 of the number of objects.
    """
    joint = np.asarray(counts, float)
    if joint.ndim != 2 or joint.sum() <= 0:
        raise ShapeError(f"counts: expected a table with answers, got shape {joint.shape}, sum {joint.sum():g}")
    n = joint.sum()
    rows, columns = joint.sum(axis=1), joint.sum(axis=0)
    seen = joint > 0
    plain = float((joint[seen] / n * np.log2(joint[seen] * n / np.outer(rows, columns)[seen])).sum())
    bias = (np.count_nonzero(rows) - 1) * (np.count_nonzero(columns) - 1) / (2 * n * np.log(2))
    return max(plain, 0.0), max(plain - bias, 0.0)


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
