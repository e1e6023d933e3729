"""Maximum likelihood of a logistic model in which people differ, by adaptive quadrature or Laplace's approximation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LogisticFit:
    """A logistic regression with normal differences between people.

    Attributes
    ----------
    coefficient : ndarray, shape (term,)
        In logits, the intercept first.
    spread : ndarray, shape (group of random terms,)
        Standard deviation over people of the coefficients of each group, in logits; 0 where none was found.
    log_likelihood : float
        Logarithm of the likelihood at its maximum, without the binomial coefficients, which no model changes.
    converged : bool
        Whether the optimiser said so.
    """

    coefficient: Array
    spread: Array
    log_likelihood: float
    converged: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellCounts:
    """Right answers of each person in each cell: all that a model of factors needs to know of the trials.

    Attributes
    ----------
    right, total : ndarray, shape (person, cell)
        Number of right answers and of answers; a total may be 0.
    """

    right: Array
    total: Array


def fit_logistic(
    counts: CellCounts,
    fixed: Array,
    varying: Array,
    group: NDArray[np.int64],
    *,
    nodes: int = 25,
    start: LogisticFit | None = None,
) -> LogisticFit:
    """Fit logit P = fixed @ coefficient + varying @ (spread[group] * u), u ~ N(0, 1) for each person and column.

    One column of `varying`: the integral over u by Gauss-Hermite quadrature whose nodes lie about each person's mode
    with that person's curvature (Pinheiro and Bates, 1995, Journal of Computational and Graphical Statistics 4,
    2.4). More columns: Laplace's approximation, the same with one node (Bates et al., 2015, Journal of Statistical
    Software 67, and lme4's glmer).

    Parameters
    ----------
    counts : CellCounts
        Answers of people in cells.
    fixed : ndarray, shape (cell, term)
        Of the coefficients that everybody shares; first column ones.
    varying : ndarray, shape (cell, column)
        Of those that differ between people.
    group : ndarray of int, shape (column,)
        Which spread a column has, from 0 on.
    nodes : int
        Nodes of the quadrature; 25 leave an error below 1e-6 of the spread.
    start : LogisticFit, optional
        Where to begin, such as the fit of a model with one more term.

    Raises
    ------
    InputError
        If there are no nodes.
    """
    from scipy.optimize import minimize

    if nodes < 1:
        raise InputError(f"nodes: expected 1 or more, got {nodes}")
    terms, spreads = fixed.shape[1], int(group.max()) + 1
    model = _Likelihood(counts, fixed, varying, group, nodes if varying.shape[1] == 1 else 1)
    begin = np.r_[np.zeros(terms), np.full(spreads, 0.25)]
    if start is not None:
        begin = np.r_[start.coefficient, np.maximum(start.spread, 0.05) ** 2]
    # Variances, not spreads: the slope of the likelihood by a spread is 0 at 0, where a search would stay for ever.
    # Where a logit runs off to infinity its limits stop it, beyond all that answers could tell apart.
    limits = [(-25.0, 25.0)] * terms + [(1e-10, 400.0)] * spreads
    found = minimize(
        model.loss, begin, jac=True, method="L-BFGS-B", bounds=limits, options={"maxiter": 500, "ftol": 1e-11}
    )
    x = np.asarray(found.x, np.float64)
    return LogisticFit(
        coefficient=x[:terms],
        spread=np.where(x[terms:] > 1e-7, np.sqrt(x[terms:]), 0.0),
        log_likelihood=-float(found.fun),
        converged=bool(found.success) and bool(np.isfinite(x).all()),
    )


class _Likelihood:
    """The likelihood of one model; keeps the modes of people from one call to the next, as a place to begin."""

    def __init__(self, counts: CellCounts, fixed: Array, varying: Array, group: NDArray[np.int64], nodes: int) -> None:
        self._right, self._total = counts.right, counts.total
        self._fixed, self._varying, self._group = fixed, varying, group
        self._node, weight = np.polynomial.hermite_e.hermegauss(nodes)
        # Over the weight of the rule, so that the sum is that of the integrand itself.
        self._log_weight = np.log(weight / np.sqrt(2 * np.pi)) + self._node**2 / 2
        self._mode: Array = np.zeros((len(counts.right), varying.shape[1]))

    def loss(self, parameters: Array) -> tuple[float, Array]:
        """Minus the logarithm of the likelihood, and its gradient."""
        coefficient, variance = np.split(parameters, [self._fixed.shape[1]])
        spread = np.sqrt(variance)
        level, scaled = self._fixed @ coefficient, self._varying * spread[self._group]
        mode, curvature = self._find_mode(level, scaled)
        many = len(self._node) > 1
        value, by_level, by_scaled = (self._quadrature if many else self._laplace)(level, scaled, mode, curvature)
        by_spread = np.bincount(self._group, (by_scaled * self._varying).sum(axis=0), minlength=len(spread))
        return -value, -np.r_[by_level @ self._fixed, by_spread / (2 * spread)]

    def _find_mode(self, level: Array, scaled: Array) -> tuple[Array, Array]:
        """Most likely u of each person, and the negative second derivative there, shape (person, column, column)."""
        u = self._mode
        for _ in range(50):
            slope, curvature = self._slope(level, scaled, u)
            step = np.asarray(np.linalg.solve(curvature, slope[..., None])[..., 0], np.float64)
            if np.abs(step).max() < 1e-9:
                break
            u = self._climb(level, scaled, u, step)
        self._mode = u
        return u, self._slope(level, scaled, u)[1]

    def _slope(self, level: Array, scaled: Array, u: Array) -> tuple[Array, Array]:
        """First and negative second derivatives of the joint density by u."""
        from scipy.special import expit

        p = expit(level + u @ scaled.T)
        weight = self._total * p * (1 - p)
        curvature = np.eye(scaled.shape[1]) + np.einsum("pc,ci,cj->pij", weight, scaled, scaled)
        return (self._right - self._total * p) @ scaled - u, curvature

    def _climb(self, level: Array, scaled: Array, u: Array, step: Array) -> Array:
        """The next u. The density has one maximum, but Newton's step can leap over it: halved until it climbs."""
        height = self._joint(level + u @ scaled.T, u)
        for _ in range(30):
            worse = self._joint(level + (u + step) @ scaled.T, u + step) < height - 1e-9
            if not worse.any():
                break
            step = np.where(worse[:, None], step / 2, step)
        return u + step

    def _joint(self, logit: Array, u: Array) -> Array:
        """Logarithm of the density of answers and u but for its constant, shape (person,)."""
        return (self._right * logit - self._total * np.logaddexp(0, logit)).sum(axis=1) - (u**2).sum(axis=1) / 2

    def _laplace(self, level: Array, scaled: Array, mode: Array, curvature: Array) -> tuple[float, Array, Array]:
        """Value, and derivatives by the level of each cell and by `scaled`, the mode moving with both."""
        from scipy.special import expit

        logit = level + mode @ scaled.T
        p = expit(logit)
        rest, weight = self._right - self._total * p, self._total * p * (1 - p)
        inverse = np.linalg.inv(curvature)
        reach = scaled @ inverse  # shape (person, cell, column)
        # How log det of the curvature changes with the logit of a cell, and through it with the mode.
        bend = (reach * scaled).sum(axis=2) * weight * (1 - 2 * p)
        pull = np.einsum("pij,pj->pi", inverse, bend @ scaled)
        by_logit = rest - (bend - weight * (pull @ scaled.T)) / 2
        by_scaled = by_logit.T @ mode - rest.T @ pull / 2 - np.einsum("pc,pcj->cj", weight, reach)
        value = float((self._joint(logit, mode) - np.linalg.slogdet(curvature)[1] / 2).sum())
        return value, by_logit.sum(axis=0), by_scaled

    def _quadrature(self, level: Array, scaled: Array, mode: Array, curvature: Array) -> tuple[float, Array, Array]:
        """The same by quadrature; with enough nodes its derivative is the mean of that of the integrand."""
        from scipy.special import expit

        width = curvature[:, :, 0] ** -0.5
        u = mode + width * self._node  # shape (person, node)
        logit = level + u[..., None] * scaled[:, 0]
        right, total = self._right[:, None], self._total[:, None]
        joint = (right * logit - total * np.logaddexp(0, logit)).sum(axis=2) - u**2 / 2 + self._log_weight
        # Taken out of the exponential: the product over many trials is below the smallest number.
        top = joint.max(axis=1, keepdims=True)
        part = np.exp(joint - top)
        sums = part.sum(axis=1, keepdims=True)
        rest = (right - total * expit(logit)) * (part / sums)[..., None]
        value = float((np.log(sums) + top + np.log(width)).sum())
        return value, rest.sum(axis=(0, 1)), np.einsum("pkc,pk->c", rest, u)[:, None]
