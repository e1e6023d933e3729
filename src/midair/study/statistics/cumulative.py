"""Mixed models with crossed random effects: cumulative-link for ratings, logistic for correct and wrong answers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from pandas import DataFrame

from midair.array_types import Array
from midair.errors import InputError
from midair.study.statistics.anova import contrasts, effects
from midair.study.statistics.columns import column, factors, frame_of, levels, numbers

Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CumulativeFit:
    """Maximum of the Laplace approximation of the likelihood; all numbers in logits."""

    parameters: Array
    """First threshold, logarithms of the steps to the others, coefficients, variances."""
    threshold: Array
    """Shape (category - 1,)."""
    coefficient: Array
    """Shape (term,)."""
    spread: Array
    """Shape (random factor,): standard deviation of its levels."""
    log_likelihood: float
    converged: bool


def cumulative_mixed(
    table: DataFrame | Mapping[str, Any],
    *,
    value: str,
    participant: str,
    within: Sequence[str],
    item: str = "",
    slopes: bool = True,
) -> DataFrame:
    """Test each effect on ordered answers, such as ratings, in a cumulative-link (proportional odds) mixed model.

    logit P(answer <= k) = threshold_k - (effects + random effects), which uses only the order of the categories. With
    two categories it is the logistic mixed model. Maximum likelihood by Laplace approximation, as clmm of R's ordinal
    and glmer of lme4. Random effects are normal: participant, with `slopes` participant x each effect (not the highest
    interaction if no participant has a cell twice), and `item`, crossed with them.

    Each effect is tested by the likelihood ratio LR of the model without it. With slopes and without items F is
    computed from LR as in `logistic_mixed`, which accounts for few participants; otherwise p is from chi2, which is too
    small with few participants or items.

    `table` has one row per answer, and cells may hold different numbers of answers. Column `value` holds numbers of
    which only the order matters; interactions of the factors `within` are tested too. `item` is the column of the
    stimulus or item, if its levels are a sample of many. Raises InputError if there are fewer than 2 or more than 30
    different answers, there is one participant or item, or a cell has no answer.

    Returns the columns effect, df, chi2, df2, F, p, spread, note. `spread`: standard deviation of the participant x
    effect levels, in logits. Values that do not apply are NaN.
    """
    data = frame_of(table)
    category = np.unique(numbers(data, value), return_inverse=True)[1].astype(np.int64)
    if not 1 <= category.max() < 30:
        raise InputError(f"column {value!r}: expected 2 to 30 different answers, got {category.max() + 1}")
    people, person = levels(column(data, participant))
    found = factors(data, within)
    shape = [len(order) for order, _ in found]
    cell = np.ravel_multi_index(tuple(number for _, number in found), shape)
    if empty := int((np.bincount(cell, minlength=int(np.prod(shape))) == 0).sum()):
        raise InputError(f"cells: expected answers in every cell, got none in {empty}; remove a factor")
    items = levels(column(data, item))[1] if item else None
    if any(factor is not None and factor.max() == 0 for factor in (person, items)):
        raise InputError("participants and items: expected two or more for a mixed model, got 1")

    often = len(np.unique(person * int(np.prod(shape)) + cell)) < len(cell)
    keys = np.stack([category, person, cell, np.zeros_like(cell) if items is None else items], axis=1)
    (category, person, cell, item_of), count = (each.T for each in np.unique(keys, axis=0, return_counts=True))
    places = np.unravel_index(cell, shape)
    blocks = [np.prod(shape) ** 0.5 * contrasts(shape, effect).T[cell] for effect in effects(list(within))]
    inside = [np.zeros_like(person)]
    if slopes:
        tested = effects(list(within))
        inside += [
            np.ravel_multi_index(tuple(places[i] for i in effect), [shape[i] for i in effect])
            for effect in (tested if often or len(tested) == 1 else tested[:-1])
        ]
    sizes = np.array([each.max() + 1 for each in inside])
    own = np.stack(inside, axis=1) + np.r_[0, np.cumsum(sizes)[:-1]]
    random = RandomEffects(
        person=person,
        own=own,
        value=np.ones(own.shape),
        factor=np.repeat(np.arange(len(sizes)), sizes),
        item=None if items is None else item_of,
    )
    full = fit_cumulative(category, count, np.hstack(blocks), random)
    cuts = int(category.max())
    terms = [block.shape[1] for block in blocks]
    rows: list[dict[str, Any]] = []
    for number, effect in enumerate(effects(list(within))):
        rest = [block for other, block in enumerate(blocks) if other != number]
        first = cuts + sum(terms[:number])
        begin = np.delete(full.parameters, slice(first, first + terms[number]))
        less = fit_cumulative(category, count, np.hstack([np.empty((len(cell), 0)), *rest]), random, begin)
        ratio = max(2 * (full.log_likelihood - less.log_likelihood), 0.0)
        row: dict[str, Any] = {"effect": ":".join(within[i] for i in effect)}
        row |= likelihood_ratio_test(ratio, terms[number], len(people) if slopes and not item else None)
        if slopes and number + 1 < len(inside):
            row["spread"] = float(full.spread[number + 1])
        done = full.converged and less.converged
        rows.append({**row, "note": "" if done else "the optimiser did not converge: unreliable"})
    return DataFrame(rows)


def likelihood_ratio_test(ratio: float, df: int, people: int | None) -> dict[str, Any]:
    """Columns df to spread (empty) of `logistic_mixed` for a likelihood ratio: chi2 if `people` is None."""
    if people is None:
        found = {"df2": np.nan, "F": np.nan, "p": float(scipy.stats.chi2.sf(ratio, df))}
    else:
        f, df2 = (people - 1) * float(np.expm1(ratio / (people * df))), df * (people - 1)
        found = {"df2": df2, "F": f, "p": float(scipy.stats.f.sf(f, df, df2))}
    return {"df": df, "chi2": ratio, **found, "spread": np.nan}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RandomEffects:
    """Random effects in each row: the sum of values times effects of its person, and of its item."""

    person: Indices
    """Shape (row,)."""
    own: Indices
    """Shape (row, entry): effects of the person that enter the row, by their index."""
    value: Array
    """Shape (row, entry): their factors."""
    factor: Indices
    """Shape (effect,): factor of each effect of a person; effects of one factor have a common variance."""
    item: Indices | None = None
    """Shape (row,), crossed with the people."""


def fit_cumulative(
    category: Indices, count: Indices, fixed: Array, random: RandomEffects, begin: Array | None = None
) -> CumulativeFit:
    """Fit logit P(category <= k) = threshold_k - fixed @ coefficient - sum of the random effects.

    `category` (row,) from 0; `count` (row,): number of equal answers; `fixed` (row, term) without an intercept; `begin`
    as `CumulativeFit.parameters`. Laplace approximation at the mode of the random effects, with an exact gradient.
    """
    model = _Likelihood(category, count, fixed, random)
    share = np.cumsum(np.bincount(category, count))[:-1] / count.sum()
    threshold = np.log(share / (1 - share))
    # Optimised over variances: the derivative by a standard deviation is 0 at 0, where the search would stop.
    # The bounds stop logits that diverge, far beyond values that answers can distinguish.
    cuts, terms, factors = len(threshold), fixed.shape[1], int(random.factor.max()) + 1 + (random.item is not None)
    if begin is None:
        begin = np.concatenate([threshold[:1], np.log(np.diff(threshold)), np.zeros(terms), np.full(factors, 0.25)])
    limits = [(-25.0, 25.0)] + [(-12.0, 4.0)] * (cuts - 1) + [(-25.0, 25.0)] * terms
    limits += [(1e-10, 400.0)] * factors
    found = scipy.optimize.minimize(
        model.loss, begin, jac=True, method="L-BFGS-B", bounds=limits, options={"maxiter": 1000, "ftol": 1e-12}
    )
    x = np.asarray(found.x, np.float64)
    variance = x[cuts + terms :]
    return CumulativeFit(
        parameters=x,
        threshold=np.cumsum(np.r_[x[0], np.exp(x[1:cuts])]),
        coefficient=x[cuts : cuts + terms],
        spread=np.where(variance > 1e-7, np.sqrt(variance), 0.0),
        log_likelihood=-float(found.fun),
        converged=bool(found.success) and bool(np.isfinite(x).all()),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Curvature:
    """Negative Hessian of the random effects: a block for each person, bordered by the items, which are independent."""

    within: Array
    """Shape (person, effect, effect): inverse of the block of a person."""
    border: Array
    """Shape (person, effect, item): that inverse times the border."""
    items: Array
    """Shape (item, item): inverse of the Schur complement of the people."""
    log_determinant: float

    def solve(self, right: Array) -> Array:
        """Product of the inverse with a vector."""
        people, size, _ = self.border.shape
        own, crossed = right[: people * size].reshape(people, size, 1), right[people * size :]
        common = self.items @ (crossed - np.tensordot(self.border, own[:, :, 0], ((0, 1), (0, 1))))
        return np.r_[(self.within @ own)[:, :, 0].ravel() - (self.border @ common).ravel(), common]

    def blocks(self) -> tuple[Array, Array]:
        """Blocks of the inverse: shapes (person, effect, effect) and (person, effect, item)."""
        across = self.border @ self.items
        return self.within + across @ self.border.transpose(0, 2, 1), -across


class _Likelihood:
    """Likelihood of one model; keeps the mode of the random effects as a warm start for the next call."""

    def __init__(self, category: Indices, count: Indices, fixed: Array, random: RandomEffects) -> None:
        self._category, self._count, self._fixed = category, count, fixed
        self._crossed = random.item is not None
        item = np.zeros_like(random.person) if random.item is None else random.item  # one item whose effect is 0
        people, size, items = int(random.person.max()) + 1, len(random.factor), int(item.max()) + 1
        self._shape = people, size, items
        own = random.person[:, None] * size + random.own
        self._where = np.c_[own, people * size + item]
        self._pair = own[:, :, None] * size + random.own[:, None, :]
        self._border, self._item = own * items + item[:, None], item
        self._value = np.c_[random.value, np.ones(len(item))]
        last = int(random.factor.max()) + 1
        self._factor = np.r_[np.tile(random.factor, people), np.full(items, last)]
        self._entry = np.c_[random.factor[random.own], np.full(len(item), last)]
        self._mode = np.zeros(len(self._factor))

    def loss(self, parameters: Array) -> tuple[float, Array]:
        """Negative log likelihood and its gradient by threshold, logarithms of their steps, coefficients, variances."""
        cuts, terms = int(self._category.max()), self._fixed.shape[1]
        steps = np.exp(parameters[1:cuts])
        cut = np.r_[-np.inf, np.cumsum(np.r_[parameters[0], steps]), np.inf]
        level = self._fixed @ parameters[cuts : cuts + terms]
        known = np.sqrt(parameters[cuts + terms :])
        scaled = self._value * (known if self._crossed else np.r_[known, 0.0])[self._entry]
        upper, lower = cut[self._category + 1] - level, cut[self._category] - level
        u, curvature = self._find_mode(upper, lower, scaled)

        shift = (u[self._where] * scaled).sum(axis=1)
        a, b, slope, weight = self._derivatives(upper - shift, lower - shift)
        block, across = curvature.blocks()
        own, common = scaled[:, :-1], scaled[:, -1]
        # Variance of each predictor by the inverse.
        width = np.einsum("ri,rij,rj->r", own, block.ravel()[self._pair], own)
        width += common * (2 * across.ravel()[self._border] * own).sum(axis=1)
        width += common**2 * np.diag(curvature.items)[self._item]
        # Derivative of the log determinant by the predictor, and through it by the mode.
        bend = -self._count * width * (a * (1 - a) * (1 - 2 * a) + b * (1 - b) * (1 - 2 * b))
        pull = curvature.solve(self._sum(bend, scaled))
        moved = (pull[self._where] * scaled).sum(axis=1)
        by_level = slope - (bend - weight * moved) / 2
        gap = 1 / np.expm1(np.minimum(upper - lower, 700))
        by_upper = self._count * (1 - a + gap - a * (1 - a) * (width * (1 - 2 * a) + moved) / 2)
        by_lower = self._count * (-b - gap - b * (1 - b) * (width * (1 - 2 * b) + moved) / 2)
        by_cut = np.bincount(self._category + 1, by_upper, len(cut)) + np.bincount(self._category, by_lower, len(cut))
        tail = np.cumsum(by_cut[-2:0:-1])[::-1]  # a step moves all thresholds above it
        each = self._sum(by_level, self._value) * u - pull * self._sum(slope, self._value) / 2
        diagonal = np.r_[np.diagonal(block, axis1=1, axis2=2).ravel(), np.diag(curvature.items)]
        shrink, by_spread = (np.bincount(self._factor, x)[: len(known)] for x in (1 - diagonal, each))
        value = self._log_joint(upper - shift, lower - shift, u) - curvature.log_determinant / 2
        by_variance = (by_spread - shrink / known) / (2 * known)
        return -float(value), -np.r_[tail[0], tail[1:] * steps, by_level @ self._fixed, by_variance]

    def _find_mode(self, upper: Array, lower: Array, scaled: Array) -> tuple[Array, _Curvature]:
        """Mode of the standardised random effects u, and the negative Hessian there."""
        u, rounds = self._mode, 0
        while True:
            shift = (u[self._where] * scaled).sum(axis=1)
            _, _, slope, weight = self._derivatives(upper - shift, lower - shift)
            curvature = self._curvature(weight, scaled)
            step = curvature.solve(self._sum(slope, scaled) - u)
            rounds += 1
            if np.abs(step).max() < 1e-9 or rounds == 60:
                break
            # Halved until the density increases: a full Newton step may pass the single maximum.
            height = self._log_joint(upper - shift, lower - shift, u)
            for _ in range(30):
                other = ((u + step)[self._where] * scaled).sum(axis=1)
                if self._log_joint(upper - other, lower - other, u + step) >= height - 1e-9:
                    break
                step = step / 2
            u = u + step
        self._mode = u
        return u, curvature

    def _curvature(self, weight: Array, scaled: Array) -> _Curvature:
        people, size, items = self._shape
        own, common = scaled[:, :-1], scaled[:, -1]
        products = (weight[:, None] * own)[:, :, None] * own[:, None, :]
        inner = np.bincount(self._pair.ravel(), products.ravel(), people * size**2).reshape(people, size, size)
        inner[:, np.arange(size), np.arange(size)] += 1
        products = (weight * common)[:, None] * own
        edge = np.bincount(self._border.ravel(), products.ravel(), people * size * items).reshape(self._shape)
        within = np.linalg.inv(inner)
        border = within @ edge
        schur = np.diag(1 + np.bincount(self._item, weight * common**2)) - np.tensordot(edge, border, ((0, 1), (0, 1)))
        log_determinant = np.linalg.slogdet(inner)[1].sum() + np.linalg.slogdet(schur)[1]
        return _Curvature(
            within=within,
            border=border,
            items=np.asarray(np.linalg.inv(schur), np.float64),
            log_determinant=float(log_determinant),
        )

    def _sum(self, values: Array, scale: Array) -> Array:
        """Sums of the values of the rows of each random effect, times the scale of its entry in the row."""
        sums = np.bincount(self._where.ravel(), (values[:, None] * scale).ravel(), len(self._factor))
        return np.asarray(sums, np.float64)

    def _derivatives(self, upper: Array, lower: Array) -> tuple[Array, Array, Array, Array]:
        """Logistic distribution at both ends of the category; slope and curvature of the log probability."""
        a, b = scipy.special.expit(upper), scipy.special.expit(lower)
        return a, b, self._count * (a + b - 1), self._count * (a * (1 - a) + b * (1 - b))

    def _log_joint(self, upper: Array, lower: Array, u: Array) -> float:
        """Log density of answers and u without its constant: F(a) - F(b) = F(a) F(-b) (1 - exp(b - a))."""
        with np.errstate(divide="ignore"):
            gap = np.log(-np.expm1(lower - upper))
        return float(
            self._count @ (scipy.special.log_expit(upper) + scipy.special.log_expit(-lower) + gap) - (u**2).sum() / 2
        )


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
    table: DataFrame | Mapping[str, Any], *, correct: str, participant: str, within: Sequence[str]
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
