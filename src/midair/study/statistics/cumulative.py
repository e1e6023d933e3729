"""Cumulative-link mixed models of ratings, and logistic ones of two answers, with crossed random effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError
from midair.study.statistics.anova import contrasts, effects
from midair.study.statistics.columns import column, frame_of, levels, numbers

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pandas import DataFrame

Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CumulativeFit:
    """Maximum of the Laplace approximation of the likelihood; all numbers in logits."""

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

    Parameters
    ----------
    table : DataFrame or dict of arrays
        One row per answer; cells may hold different numbers of answers.
    value : str
        Column of the answers: numbers of which only the order matters, 2 to 30 different ones.
    participant : str
        Column of the participant.
    within : sequence of str
        Columns of the factors; their interactions are tested too.
    item : str
        Column of the stimulus or item, if its levels are a sample of many; none by default.
    slopes : bool
        Whether effects vary between participants.

    Returns
    -------
    DataFrame
        Columns effect, df, chi2, df2, F, p, spread, note. `spread`: standard deviation of the participant x effect
        levels, in logits. Values that do not apply are NaN.

    Raises
    ------
    InputError
        If there are fewer than 2 or more than 30 different answers, there is one participant or item, or a cell
        has no answer.
    """
    from pandas import DataFrame
    from scipy.stats import chi2
    from scipy.stats import f as f_distribution

    data = frame_of(table)
    category = np.unique(numbers(data, value), return_inverse=True)[1]
    if not 1 <= category.max() < 30:
        raise InputError(f"column {value!r}: expected 2 to 30 different answers, got {category.max() + 1}")
    people, person = levels(column(data, participant))
    found = [levels(column(data, name)) for name in within]
    shape = [len(order) for order, _ in found]
    if short := [name for name, size in zip(within, shape, strict=True) if size < 2]:
        raise InputError(f"factor {short[0]!r}: expected two or more levels, got one; remove it from `within`")
    cell = np.ravel_multi_index(tuple(number for _, number in found), shape)
    if empty := int((np.bincount(cell, minlength=int(np.prod(shape))) == 0).sum()):
        raise InputError(f"cells: expected answers in every cell, got none in {empty}; remove a factor")
    blocks = [np.prod(shape) ** 0.5 * contrasts(shape, effect).T[cell] for effect in effects(list(within))]
    factors = [person]
    if slopes:
        often = len(np.unique(person * int(np.prod(shape)) + cell)) < len(cell)
        inside = effects(list(within))
        for effect in inside if often or len(inside) == 1 else inside[:-1]:
            columns = np.stack([person, *(found[i][1] for i in effect)])
            factors.append(np.unique(columns, axis=1, return_inverse=True)[1].ravel())
    if item:
        factors.append(levels(column(data, item))[1])
    if any(factor.max() == 0 for factor in (factors[0], factors[-1])):
        raise InputError("participants and items: expected two or more for a mixed model, got 1")

    random = np.stack(factors, axis=1)
    full = fit_cumulative(category, np.hstack(blocks), random)
    rows: list[dict[str, Any]] = []
    for number, effect in enumerate(effects(list(within))):
        rest = [block for other, block in enumerate(blocks) if other != number]
        less = fit_cumulative(category, np.hstack([np.empty((len(cell), 0)), *rest]), random)
        df, many = blocks[number].shape[1], len(people)
        ratio = max(2 * (full.log_likelihood - less.log_likelihood), 0.0)
        row = {"effect": ":".join(within[i] for i in effect), "df": df, "chi2": ratio, "df2": np.nan, "F": np.nan}
        row |= {"p": float(chi2.sf(ratio, df)), "spread": np.nan}
        if slopes and number + 1 < len(factors) - bool(item):
            row["spread"] = float(full.spread[number + 1])
        if slopes and not item:
            f, df2 = (many - 1) * float(np.expm1(ratio / (many * df))), df * (many - 1)
            row |= {"df2": df2, "F": f, "p": float(f_distribution.sf(f, df, df2))}
        done = full.converged and less.converged
        rows.append({**row, "note": "" if done else "the optimiser did not converge: unreliable"})
    return DataFrame(rows)


def fit_cumulative(category: Indices, fixed: Array, random: Indices) -> CumulativeFit:
    """Fit logit P(category <= k) = threshold_k - fixed @ coefficient - sum of the random effects of the levels.

    `category` (answer,) from 0; `fixed` (answer, term) without an intercept; `random` (answer, random factor) the index
    of the level of each factor. Laplace approximation at the mode of the random effects, with an exact gradient.
    """
    from scipy.optimize import minimize

    model = _Likelihood(category, fixed, random)
    share = np.cumsum(np.bincount(category))[:-1] / len(category)
    threshold = np.log(share / (1 - share))
    begin = np.r_[threshold[0], np.log(np.diff(threshold)), np.zeros(fixed.shape[1]), np.full(random.shape[1], 0.25)]
    # As in `fit_logistic`: variances, and bounds far beyond values that answers can distinguish.
    cuts, terms = len(threshold), fixed.shape[1]
    limits = [(-25.0, 25.0)] + [(-12.0, 4.0)] * (cuts - 1) + [(-25.0, 25.0)] * terms
    limits += [(1e-10, 400.0)] * random.shape[1]
    found = minimize(
        model.loss, begin, jac=True, method="L-BFGS-B", bounds=limits, options={"maxiter": 1000, "ftol": 1e-12}
    )
    x = np.asarray(found.x, np.float64)
    variance = x[cuts + terms :]
    return CumulativeFit(
        threshold=np.cumsum(np.r_[x[0], np.exp(x[1:cuts])]),
        coefficient=x[cuts : cuts + terms],
        spread=np.where(variance > 1e-7, np.sqrt(variance), 0.0),
        log_likelihood=-float(found.fun),
        converged=bool(found.success) and bool(np.isfinite(x).all()),
    )


class _Likelihood:
    """Likelihood of one model; keeps the mode of the random effects as a warm start for the next call."""

    def __init__(self, category: Indices, fixed: Array, random: Indices) -> None:
        from scipy.sparse import csr_array

        self._category, self._fixed = category, fixed
        sizes = random.max(axis=0) + 1
        self._factor = np.repeat(np.arange(len(sizes)), sizes)
        where = random + np.r_[0, np.cumsum(sizes)[:-1]]
        row = np.repeat(np.arange(len(random)), random.shape[1])
        self._levels = csr_array((np.ones(where.size), (row, where.ravel())), shape=(len(random), int(sizes.sum())))
        self._mode = np.zeros(int(sizes.sum()))

    def loss(self, parameters: Array) -> tuple[float, Array]:
        """Negative log likelihood and its gradient by threshold, logarithms of their steps, coefficients, variances."""
        cuts, terms = int(self._category.max()), self._fixed.shape[1]
        steps = np.exp(parameters[1:cuts])
        cut = np.r_[-np.inf, np.cumsum(np.r_[parameters[0], steps]), np.inf]
        level = self._fixed @ parameters[cuts : cuts + terms]
        spread = np.sqrt(parameters[cuts + terms :])
        # Without a type: the stubs of sparse arrays lose it in products.
        scaled: Any = self._levels * spread[self._factor]
        upper, lower = cut[self._category + 1] - level, cut[self._category] - level
        u, inverse = self._find_mode(upper, lower, scaled)

        shift = scaled @ u
        a, b, slope, weight = _derivatives(upper - shift, lower - shift)
        reach = scaled @ inverse  # (answer, level of a random factor)
        width = np.asarray(scaled.multiply(reach).sum(axis=1)).ravel()
        # Derivative of the log determinant by the predictor, and through it by the mode.
        bend = -width * (a * (1 - a) * (1 - 2 * a) + b * (1 - b) * (1 - 2 * b))
        pull = inverse @ (scaled.T @ bend)
        moved = scaled @ pull
        by_level = slope - (bend - weight * moved) / 2
        gap = 1 / np.expm1(np.minimum(upper - lower, 700))
        by_upper = 1 - a + gap - a * (1 - a) * (width * (1 - 2 * a) + moved) / 2
        by_lower = -b - gap - b * (1 - b) * (width * (1 - 2 * b) + moved) / 2
        by_cut = np.bincount(self._category + 1, by_upper, len(cut)) + np.bincount(self._category, by_lower, len(cut))
        tail = np.cumsum(by_cut[-2:0:-1])[::-1]  # a step moves all thresholds above it
        each = (self._levels.T @ by_level) * u - pull * (self._levels.T @ slope) / 2
        shrink = np.bincount(self._factor, 1 - np.diag(inverse)) / spread
        by_spread = np.bincount(self._factor, each) - shrink
        value = _log_joint(upper - shift, lower - shift, u) + np.linalg.slogdet(inverse)[1] / 2
        gradient = np.r_[tail[0], tail[1:] * steps, by_level @ self._fixed, by_spread / (2 * spread)]
        return -float(value), -gradient

    def _find_mode(self, upper: Array, lower: Array, scaled: Any) -> tuple[Array, Array]:
        """Mode of the standardised random effects u, and the inverse of the negative Hessian there."""
        u, curvature = self._mode, np.eye(len(self._mode))
        for _ in range(60):
            shift = scaled @ u
            _, _, slope, weight = _derivatives(upper - shift, lower - shift)
            curvature = (scaled.T @ (scaled * weight[:, None])).toarray() + np.eye(len(u))
            step = np.linalg.solve(curvature, scaled.T @ slope - u)
            if np.abs(step).max() < 1e-9:
                break
            # Halved until the density increases: a full Newton step may pass the single maximum.
            height = _log_joint(upper - shift, lower - shift, u)
            for _ in range(30):
                other = scaled @ (u + step)
                if _log_joint(upper - other, lower - other, u + step) >= height - 1e-9:
                    break
                step = step / 2
            u = u + step
        self._mode = u
        return u, np.asarray(np.linalg.inv(curvature), np.float64)


def _derivatives(upper: Array, lower: Array) -> tuple[Array, Array, Array, Array]:
    """Logistic distribution at both ends of the category; log probability's slope by the predictor and curvature."""
    from scipy.special import expit

    a, b = expit(upper), expit(lower)
    return a, b, a + b - 1, a * (1 - a) + b * (1 - b)


def _log_joint(upper: Array, lower: Array, u: Array) -> float:
    """Log density of answers and u without its constant: F(a) - F(b) = F(a) F(-b) (1 - exp(b - a))."""
    from scipy.special import log_expit

    with np.errstate(divide="ignore"):
        gap = np.log(-np.expm1(lower - upper))
    return float((log_expit(upper) + log_expit(-lower) + gap).sum() - (u**2).sum() / 2)
