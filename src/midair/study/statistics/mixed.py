"""Correct or not: a logistic model in which people differ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, MissingExtraError
from midair.study.statistics.anova import contrasts, effects
from midair.study.statistics.columns import column, frame_of, levels, numbers

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pandas import DataFrame

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LogisticFit:
    """A random-intercept logistic regression.

    Attributes
    ----------
    coefficient : ndarray, shape (term,)
        In logits, the intercept first; factors in orthonormal contrasts.
    spread : float
        Standard deviation of people, in logits.
    log_likelihood : float
        Logarithm of the likelihood at its maximum.
    converged : bool
        Whether the optimiser said so.
    """

    coefficient: Array
    spread: float
    log_likelihood: float
    converged: bool


def logistic_mixed(
    table: DataFrame | Mapping[str, Any], *, correct: str, participant: str, within: Sequence[str]
) -> DataFrame:
    """Test each effect on the chance of a right answer: correct ~ factors + (1 | participant).

    Maximum likelihood with the integral over people by Gauss-Hermite quadrature; each effect by the likelihood ratio of
    the model without it. People have one level each and no slopes of their own: where effects differ between people the
    tests are liberal, and the analysis of each person's share of right answers is the safe one.

    Parameters
    ----------
    table : DataFrame or dict of arrays
        One row an answer; cells may hold different numbers of them.
    correct : str
        Column of 0 and 1.
    participant : str
        Column of who answered.
    within : sequence of str
        Columns of the factors; their interactions are tested too.

    Returns
    -------
    DataFrame
        Columns effect, df, chi2, p, note. The note speaks where the model runs off: a cell that everyone answers right
        (or wrong) has an infinite logit.

    Raises
    ------
    InputError
        If answers are not 0 and 1, or all the same.
    """
    from pandas import DataFrame
    from scipy.stats import chi2

    y, person, blocks = _design(table, correct, participant, within)
    full = fit_logistic(y, np.hstack(blocks), person)
    note = _note(y, np.hstack(blocks), full)
    rows: list[dict[str, Any]] = []
    for number, effect in enumerate(effects(list(within)), start=1):
        kept = np.hstack([block for i, block in enumerate(blocks) if i != number])
        statistic = max(2 * (full.log_likelihood - fit_logistic(y, kept, person).log_likelihood), 0.0)
        df = blocks[number].shape[1]
        name = ":".join(within[i] for i in effect)
        rows.append({"effect": name, "df": df, "chi2": statistic, "p": float(chi2.sf(statistic, df)), "note": note})
    return DataFrame(rows)


def fit_logistic(y: Array, design: Array, person: NDArray[np.int64], *, nodes: int = 41) -> LogisticFit:
    """Maximum likelihood of logit P(y = 1) = design @ coefficient + spread * u, u ~ N(0, 1) for each person.

    Parameters
    ----------
    y : ndarray, shape (trial,)
        0 or 1.
    design : ndarray, shape (trial, term)
        First column ones.
    person : ndarray of int, shape (trial,)
        Number of the person who answered, from 0 on.
    nodes : int
        Number of nodes of the quadrature over u.
    """
    from scipy.optimize import minimize

    u, weight = np.polynomial.hermite_e.hermegauss(nodes)
    log_weight = np.log(weight / weight.sum())
    order = np.argsort(person, kind="stable")
    y, design, person = y[order], design[order], person[order]
    # Sorted by person, so that the trials of each are one stretch that can be summed at once.
    first = np.flatnonzero(np.r_[True, np.diff(person) > 0])
    sign = (2 * y - 1)[:, None]

    def loss(parameters: Array) -> tuple[float, Array]:
        spread = np.exp(parameters[-1])
        logit = (design @ parameters[:-1])[:, None] + spread * u
        log_p = -np.logaddexp(0, -sign * logit)
        joint = np.add.reduceat(log_p, first, axis=0) + log_weight
        # Taken out of the exponential: the product over many trials is below the smallest number.
        top = joint.max(axis=1, keepdims=True)
        part = np.exp(joint - top)
        marginal = part.sum(axis=1, keepdims=True)
        share = np.repeat(part / marginal, np.diff(np.r_[first, len(y)]), axis=0)
        residual = (y[:, None] - 1 / (1 + np.exp(-logit))) * share
        gradient = np.r_[design.T @ residual.sum(axis=1), (residual @ u).sum() * spread]
        return -float((np.log(marginal) + top).sum()), -gradient

    start = np.r_[np.zeros(design.shape[1]), np.log(0.5)]
    # Where a logit runs off to infinity this stops it, beyond all that answers could tell apart.
    limits = [(-25.0, 25.0)] * design.shape[1] + [(-6.0, 3.0)]
    found = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=limits, options={"maxiter": 500, "ftol": 1e-12})
    x = np.asarray(found.x, np.float64)
    return LogisticFit(
        coefficient=x[:-1], spread=float(np.exp(x[-1])), log_likelihood=-float(found.fun), converged=bool(found.success)
    )


def logistic_posterior(
    table: DataFrame | Mapping[str, Any], *, correct: str, participant: str, within: Sequence[str]
) -> DataFrame:
    """Fit the same model as statsmodels does: a variational posterior with normal priors.

    Returns
    -------
    DataFrame
        Columns term, mean, sd, in logits; the spread of people as the logarithm of a standard deviation.

    Raises
    ------
    MissingExtraError
        If statsmodels is not installed.
    InputError
        As `logistic_mixed`.
    """
    from pandas import DataFrame

    try:
        from statsmodels.genmod.bayes_mixed_glm import BinomialBayesMixedGLM
    except ImportError as missing:
        raise MissingExtraError(
            'posterior: expected the package statsmodels, it is not installed; pip install "midair[study]"'
        ) from missing
    y, person, blocks = _design(table, correct, participant, within)
    people = np.eye(int(person.max()) + 1)[person]
    names = ["intercept"]
    for effect, block in zip(effects(list(within)), blocks[1:], strict=True):
        names += [":".join(within[i] for i in effect) + f"[{i}]" for i in range(block.shape[1])]
    model = BinomialBayesMixedGLM(y, np.hstack(blocks), people, np.zeros(people.shape[1], int), vcp_p=1, fe_p=2)
    fit = model.fit_vb()
    mean = np.r_[fit.fe_mean, fit.vcp_mean]
    return DataFrame({"term": [*names, "log spread"], "mean": mean, "sd": np.r_[fit.fe_sd, fit.vcp_sd]})


def _note(y: Array, design: Array, fit: LogisticFit) -> str:
    _, cell = np.unique(design, axis=0, return_inverse=True)
    right, total = np.bincount(cell.ravel(), weights=y), np.bincount(cell.ravel())
    if ((right == 0) | (right == total)).any():
        return "a cell is all right or all wrong: its logit is infinite, the test unsafe"
    return "" if fit.converged else "the optimiser did not finish: unsafe"


def _design(
    table: DataFrame | Mapping[str, Any], correct: str, participant: str, within: Sequence[str]
) -> tuple[Array, NDArray[np.int64], list[Array]]:
    data = frame_of(table)
    y = numbers(data, correct)
    if not np.isin(y, (0.0, 1.0)).all():
        raise InputError(f"column {correct!r}: expected 0 and 1, got {np.unique(y)[:5].tolist()}")
    if len(np.unique(y)) < 2:
        raise InputError(f"column {correct!r}: expected right and wrong answers, got only {y[0]:g}; nothing to model")
    people, person = levels(column(data, participant))
    if len(people) < 2:
        raise InputError("participants: expected two or more for a model of how people differ, got 1")
    found = [levels(column(data, name)) for name in within]
    for name, (order, _) in zip(within, found, strict=True):
        if len(order) < 2:
            raise InputError(f"factor {name!r}: expected two or more levels, got {order}; leave it out of `within`")
    shape = [len(order) for order, _ in found]
    cell = np.ravel_multi_index(tuple(number for _, number in found), shape) if shape else np.zeros(len(y), int)
    blocks: list[Array] = [np.ones((len(y), 1))]
    # Scaled to a mean square of 1 over the cells, so that coefficients do not depend on their number.
    blocks += [np.sqrt(np.prod(shape)) * contrasts(shape, effect).T[cell] for effect in effects(list(within))]
    return y, person, blocks
