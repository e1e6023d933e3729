"""Maximum likelihood of logistic mixed models by adaptive quadrature or the Laplace approximation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LogisticFit:
    """Logistic regression with normal random effects of participants."""

    coefficient: Array
    """Shape (term,), in logits, the intercept first."""
    spread: Array
    """Shape (group of random terms,): standard deviation over participants, in logits."""
    log_likelihood: float
    """Maximum log likelihood without the constant binomial coefficients."""
    converged: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellCounts:
    """Correct answers and all answers, shape (participant, cell): sufficient statistics of a model of factors."""

    right: Array
    total: Array


def fit_logistic(
    counts: CellCounts,
    fixed: Array,
    varying: Array,
    group: NDArray[np.int64],
    *,
    start: LogisticFit | None = None,
) -> LogisticFit:
    """Fit logit P = fixed @ coefficient + varying @ (spread[group] * u), u ~ N(0, 1) per participant and column.

    One column of `varying`: adaptive Gauss-Hermite quadrature (Pinheiro and Bates, 1995, Journal of Computational and
    Graphical Statistics 4, 2.4). More columns: Laplace approximation, the same with one node (Bates et al., 2015,
    Journal of Statistical Software 67, and lme4's glmer).

    `fixed` (cell, term) is the design matrix of the fixed effects, whose first column is ones; `varying` (cell, column)
    that of the random effects; `group` (column,) the index of each column's spread. 25 nodes leave an error below 1e-6
    of the spread. `start` is an initial fit, such as that of a model with one more term.
    """
    from scipy.optimize import minimize

    terms, spreads = fixed.shape[1], int(group.max()) + 1
    model = _Likelihood(counts, fixed, varying, group, 25 if varying.shape[1] == 1 else 1)
    begin = np.r_[np.zeros(terms), np.full(spreads, 0.25)]
    if start is not None:
        begin = np.r_[start.coefficient, np.maximum(start.spread, 0.05) ** 2]
    # Optimised over variances: the derivative by a standard deviation is 0 at 0, where the search would stop.
    # The bounds stop logits that diverge, far beyond values that answers can distinguish.
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
    """Likelihood of one model; keeps the modes of the random effects as a warm start for the next call."""

    def __init__(self, counts: CellCounts, fixed: Array, varying: Array, group: NDArray[np.int64], nodes: int) -> None:
        self._right, self._total = counts.right, counts.total
        self._fixed, self._varying, self._group = fixed, varying, group
        self._node, weight = np.polynomial.hermite_e.hermegauss(nodes)
        # Divided by the weight function of the rule, so that the sum is the integral of the integrand.
        self._log_weight = np.log(weight / np.sqrt(2 * np.pi)) + self._node**2 / 2
        self._mode: Array = np.zeros((len(counts.right), varying.shape[1]))

    def loss(self, parameters: Array) -> tuple[float, Array]:
        """Negative log likelihood and its gradient."""
        coefficient, variance = np.split(parameters, [self._fixed.shape[1]])
        spread = np.sqrt(variance)
        level, scaled = self._fixed @ coefficient, self._varying * spread[self._group]
        mode, curvature = self._find_mode(level, scaled)
        many = len(self._node) > 1
        value, by_level, by_scaled = (self._quadrature if many else self._laplace)(level, scaled, mode, curvature)
        by_spread = np.bincount(self._group, (by_scaled * self._varying).sum(axis=0), minlength=len(spread))
        return -value, -np.r_[by_level @ self._fixed, by_spread / (2 * spread)]

    def _find_mode(self, level: Array, scaled: Array) -> tuple[Array, Array]:
        """Mode of u per participant, and the negative Hessian there, shape (participant, column, column)."""
        u = self._mode
        for _ in range(50):
            slope, curvature = self._slope(level, scaled, u)
            step = np.asarray(np.linalg.solve(curvature, slope[..., None])[..., 0], np.float64)
            if np.abs(step).max() < 1e-9:
                break
            u = self._damped_step(level, scaled, u, step)
        self._mode = u
        return u, self._slope(level, scaled, u)[1]

    def _slope(self, level: Array, scaled: Array, u: Array) -> tuple[Array, Array]:
        """Gradient and negative Hessian of the log joint density with respect to u."""
        from scipy.special import expit

        p = expit(level + u @ scaled.T)
        weight = self._total * p * (1 - p)
        curvature = np.eye(scaled.shape[1]) + np.einsum("pc,ci,cj->pij", weight, scaled, scaled)
        return (self._right - self._total * p) @ scaled - u, curvature

    def _damped_step(self, level: Array, scaled: Array, u: Array, step: Array) -> Array:
        """Newton step, halved until the density increases: a full step may pass the single maximum."""
        height = self._joint(level + u @ scaled.T, u)
        for _ in range(30):
            worse = self._joint(level + (u + step) @ scaled.T, u + step) < height - 1e-9
            if not worse.any():
                break
            step = np.where(worse[:, None], step / 2, step)
        return u + step

    def _joint(self, logit: Array, u: Array) -> Array:
        """Log density of answers and u without its constant, shape (participant,)."""
        return (self._right * logit - self._total * np.logaddexp(0, logit)).sum(axis=1) - (u**2).sum(axis=1) / 2

    def _laplace(self, level: Array, scaled: Array, mode: Array, curvature: Array) -> tuple[float, Array, Array]:
        """Value, and derivatives by the level of each cell and by `scaled`, including the change of the mode."""
        from scipy.special import expit

        logit = level + mode @ scaled.T
        p = expit(logit)
        rest, weight = self._right - self._total * p, self._total * p * (1 - p)
        inverse = np.linalg.inv(curvature)
        reach = scaled @ inverse  # shape (person, cell, column)
        # Derivative of log det of the curvature by the logit of a cell, and through it by the mode.
        bend = (reach * scaled).sum(axis=2) * weight * (1 - 2 * p)
        pull = np.einsum("pij,pj->pi", inverse, bend @ scaled)
        by_logit = rest - (bend - weight * (pull @ scaled.T)) / 2
        by_scaled = by_logit.T @ mode - rest.T @ pull / 2 - np.einsum("pc,pcj->cj", weight, reach)
        value = float((self._joint(logit, mode) - np.linalg.slogdet(curvature)[1] / 2).sum())
        return value, by_logit.sum(axis=0), by_scaled

    def _quadrature(self, level: Array, scaled: Array, mode: Array, curvature: Array) -> tuple[float, Array, Array]:
        """As `_laplace` by quadrature; with enough nodes the derivative is the weighted mean of the integrand's."""
        from scipy.special import expit

        width = curvature[:, :, 0] ** -0.5
        u = mode + width * self._node  # shape (person, node)
        logit = level + u[..., None] * scaled[:, 0]
        right, total = self._right[:, None], self._total[:, None]
        joint = (right * logit - total * np.logaddexp(0, logit)).sum(axis=2) - u**2 / 2 + self._log_weight
        # Subtracted before exp: the likelihood of many trials underflows.
        top = joint.max(axis=1, keepdims=True)
        part = np.exp(joint - top)
        sums = part.sum(axis=1, keepdims=True)
        rest = (right - total * expit(logit)) * (part / sums)[..., None]
        value = float((np.log(sums) + top + np.log(width)).sum())
        return value, rest.sum(axis=(0, 1)), np.einsum("pkc,pk->c", rest, u)[:, None]
