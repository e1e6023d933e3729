"""Logistic mixed models of correct and wrong answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError
from midair.study.statistics.anova import contrasts, effects
from midair.study.statistics.columns import column, factors, frame_of, levels, numbers
from midair.study.statistics.cumulative import CumulativeFit, RandomEffects, fit_cumulative, likelihood_ratio_test

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pandas import DataFrame


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RightAnswers:
    """Correct answers by participant and cell, with the design matrix of the cells."""

    right: Array
    total: Array
    """Correct answers and all answers, shape (participant, cell)."""
    cells: Array
    """Contrasts of each cell, shape (cell, term), the intercept first."""
    effect: NDArray[np.int64]
    """Index of the effect of each term, shape (term,); 0 is the intercept."""
    names: tuple[str, ...]
    """Names of the effects without the intercept."""

    @property
    def people(self) -> int:
        """Number of participants."""
        return len(self.right)

    def fit(self, *, without: int = 0, start: CumulativeFit | None = None) -> CumulativeFit:
        """Fit the full model, or the model without one effect starting from a full fit.

        People differ in every term; not in the highest interaction if no participant has a cell twice. The threshold
        is minus the intercept.
        """
        answers = np.stack([self.total - self.right, self.right])
        correct, person, cell = np.nonzero(answers)
        count = answers[correct, person, cell].astype(np.int64)
        differ = np.flatnonzero((self.effect < max(self.effect.max(), 1)) | (self.total.max() > 1))
        value = self.cells[np.ix_(cell, differ)]
        random = RandomEffects(
            person=person,
            own=np.broadcast_to(np.arange(len(differ)), value.shape),
            value=value,
            factor=self.effect[differ],
        )
        kept = (self.effect != without) & (self.effect > 0) if without else self.effect > 0
        begin = None
        if start is not None:
            variance = np.maximum(start.spread, 0.05) ** 2
            begin = np.r_[start.threshold, start.coefficient[kept[self.effect > 0]], variance]
        return fit_cumulative(correct, count, self.cells[np.ix_(cell, kept)], random, begin)


def logistic_mixed(
    table: DataFrame | Mapping[str, Any],
    *,
    correct: str,
    participant: str,
    within: Sequence[str],
) -> DataFrame:
    """Test each effect on the probability of a correct answer in a logistic mixed model.

    correct ~ factors + (each effect | participant), with one standard deviation for the contrasts of an effect. Maximum
    likelihood by Laplace approximation; each effect is tested by the likelihood ratio LR of the model without it. With
    n participants and d contrasts

        F = (n - 1) (exp(LR / (n d)) - 1) with d and d (n - 1) degrees of freedom,

    the relation between LR and F in a linear model of the participants' contrasts. It accounts for the uncertainty of
    random effects from few participants; the chi2 test does not, and its false positive rate rises to 0.1 with six
    participants. For effects that do not vary between participants the F test is conservative. Raises InputError if
    answers are not 0 and 1, or all the same, or there is one participant.

    `table` has one row per answer, and cells may hold different numbers of answers; `correct` is a column of 0 and 1.
    Interactions of the factors `within` are tested too.

    Returns the columns effect, df, chi2, df2, F, p, spread, note. `spread`: root mean square over cells of the standard
    deviation of the effect between participants, in logits, NaN where it is not estimated. The note warns of cells with
    only correct (or only wrong) answers, whose logit is infinite.
    """
    from pandas import DataFrame

    data = right_answers(table, correct=correct, participant=participant, within=within)
    full = data.fit()
    note = _note(data, full)
    rows: list[dict[str, Any]] = []
    for number, name in enumerate(data.names, start=1):
        less = data.fit(without=number, start=full)
        statistic = max(2 * (full.log_likelihood - less.log_likelihood), 0.0)
        df = int((data.effect == number).sum())
        row = {"effect": name, **likelihood_ratio_test(statistic, df, data.people)}
        if number < len(full.spread):
            row["spread"] = float(full.spread[number]) * df**0.5
        rows.append({**row, "note": note if less.converged else "the optimiser did not converge: unreliable"})
    return DataFrame(rows)


def right_answers(
    table: DataFrame | Mapping[str, Any], *, correct: str, participant: str, within: Sequence[str]
) -> RightAnswers:
    """Count correct answers by participant and cell and build the contrasts; raises like `logistic_mixed`."""
    data = frame_of(table)
    y = numbers(data, correct)
    if not np.isin(y, (0.0, 1.0)).all():
        raise InputError(f"column {correct!r}: expected 0 and 1, got {np.unique(y)[:5].tolist()}")
    if len(np.unique(y)) < 2:
        raise InputError(f"column {correct!r}: expected both correct and wrong answers, got only {y[0]:g}")
    people, person = levels(column(data, participant))
    if len(people) < 2:
        raise InputError("participants: expected two or more for a mixed model, got 1")
    found = factors(data, within)
    shape = [len(order) for order, _ in found]
    size = int(np.prod(shape))
    cell = np.ravel_multi_index(tuple(number for _, number in found), shape) if shape else np.zeros(len(y), int)
    where, many = person * size + cell, len(people) * size
    right, total = (np.bincount(where, w, minlength=many).reshape(-1, size) for w in (y, np.ones(len(y))))
    if (empty := total.sum(axis=0) == 0).any():
        first = np.unravel_index(int(np.argmax(empty)), shape)
        what = ", ".join(f"{name}={order[i]}" for name, (order, _), i in zip(within, found, first, strict=True))
        raise InputError(f"cells: expected answers in every cell, got none at {what}; remove the cell or a factor")
    # Scaled to a mean square of 1 over the cells, so that coefficients do not depend on their number.
    blocks = [np.ones((size, 1))]
    blocks += [size**0.5 * contrasts(shape, effect).T for effect in effects(list(within))]
    return RightAnswers(
        right=np.asarray(right, np.float64),
        total=np.asarray(total, np.float64),
        cells=np.hstack(blocks),
        effect=np.repeat(np.arange(len(blocks)), [block.shape[1] for block in blocks]),
        names=tuple(":".join(within[i] for i in effect) for effect in effects(list(within))),
    )


def _note(data: RightAnswers, fit: CumulativeFit) -> str:
    right, total = data.right.sum(axis=0), data.total.sum(axis=0)
    if ((right == 0) | (right == total)).any():
        return "a cell has only correct or only wrong answers: its logit is infinite, the test unreliable"
    return "" if fit.converged else "the optimiser did not converge: unreliable"
