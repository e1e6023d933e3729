"""Tests of paired values: t-test, equivalence, Bayes factor and Holm's correction."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from midair.array_types import Array
from midair.errors import InputError, NonFiniteError, ShapeError


@dataclass(frozen=True, slots=True, kw_only=True)
class PairedT:
    """Result of a two-sided paired t-test."""

    t: float
    df: int
    p: float
    difference: float
    low: float
    high: float
    """`difference`, `low`, `high`: mean difference and its confidence interval, in the unit of the values."""
    d_z: float
    """Mean difference over its standard deviation."""
    n: int
    """Number of pairs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Equivalence:
    """Result of two one-sided tests (TOST)."""

    p: float
    """Small if the difference lies within the margin."""
    margin: float
    """Equivalence margin, in the unit of the values."""
    low: float
    high: float
    """`low`, `high`: 90 % confidence interval; equivalent at 0.05 if it lies within the margin."""


def paired_t(first: Sequence[float] | Array, second: Sequence[float] | Array, *, level: float = 0.95) -> PairedT:
    """Student's t-test of the differences first - second.

    Raises ShapeError if there are fewer than two pairs or the lengths differ and InputError if all differences are
    equal: the standard error is 0.
    """
    from scipy.stats import t as t_distribution

    mean, error, n = _difference(first, second)
    t = mean / error
    half = error * float(t_distribution.ppf((1 + level) / 2, n - 1))
    p = float(2 * t_distribution.sf(abs(t), n - 1))
    return PairedT(t=t, df=n - 1, p=p, difference=mean, low=mean - half, high=mean + half, d_z=t / n**0.5, n=n)


def equivalence(first: Sequence[float] | Array, second: Sequence[float] | Array, *, margin: float) -> Equivalence:
    """Test whether two conditions are equivalent within a margin that was chosen beforehand: TOST (Schuirmann, 1987).

    Raises ShapeError or InputError as `paired_t`; also if the margin is not above 0.
    """
    from scipy.stats import t as t_distribution

    if not margin > 0:
        raise InputError(f"margin: expected a difference above 0, got {margin:g}")
    mean, error, n = _difference(first, second)
    # The test at the nearer margin has the larger p-value, which is the p-value of TOST.
    p = t_distribution.sf((margin - abs(mean)) / error, n - 1)
    half = error * float(t_distribution.ppf(0.95, n - 1))
    return Equivalence(p=float(p), margin=float(margin), low=mean - half, high=mean + half)


def bayes_factor(t: float, n: int, *, width: float = 2**-0.5) -> float:
    """Bayes factor BF10 of a paired t-test with n pairs (Rouder et al., 2009); values below 1 favour no difference.

    Under the alternative, the effect has a Cauchy prior of the given width in units of d_z. BF10 is the integral over g
    of
    (1 + n g)^(-1/2) (1 + t^2 / ((1 + n g) df))^(-n/2) with g inverse-gamma(1/2, width^2/2), divided by
    (1 + t^2 / df)^(-n/2).
    """
    from scipy.integrate import quad

    if n < 2 or not np.isfinite(t):
        raise InputError(f"Bayes factor: expected a finite t of two or more pairs, got t = {t:g}, n = {n}")
    df = n - 1
    null = -n / 2 * np.log1p(t**2 / df)

    def weight(x: float) -> float:  # g = exp(x)
        g = np.exp(x)
        prior = 0.5 * np.log(width**2 / (2 * np.pi)) - 1.5 * x - width**2 / (2 * g)
        return float(np.exp(prior + x - 0.5 * np.log1p(n * g) - n / 2 * np.log1p(t**2 / ((1 + n * g) * df)) - null))

    # Integrated over log g, where the integrand is smooth; over g it is a spike near 0 with a long tail.
    value, _ = quad(weight, -25, 40, limit=400, points=[-5.0, 0.0, 5.0])
    return float(value)


def holm(p: Sequence[float] | Array) -> Array:
    """P-values corrected for multiple tests (Holm, 1979), in the given order; raises NonFiniteError for NaN."""
    raw = np.asarray(p, float)
    if not np.isfinite(raw).all():
        raise NonFiniteError("p-values: expected numbers, got NaN; remove the tests that could not be computed")
    order = np.argsort(raw, kind="stable")
    # Corrected p-values keep the order of the raw ones.
    stepped = np.maximum.accumulate(raw[order] * np.arange(len(raw), 0, -1))
    corrected = np.empty_like(raw)
    corrected[order] = np.minimum(stepped, 1)
    return corrected


def _difference(first: Any, second: Any) -> tuple[float, float, int]:
    """Mean of the differences, its standard error, and the number of pairs."""
    a, b = np.asarray(first, float), np.asarray(second, float)
    if a.ndim != 1 or a.shape != b.shape or len(a) < 2:
        raise ShapeError(f"pairs: expected two sequences of one length, 2 or more, got shapes {a.shape} and {b.shape}")
    if not np.isfinite(a - b).all():
        raise NonFiniteError("pairs: expected finite numbers, got NaN or infinity; remove incomplete pairs")
    difference = a - b
    error = float(difference.std(ddof=1)) / len(a) ** 0.5
    # Variation within rounding error counts as none.
    if error <= 1e-13 * max(1.0, float(np.abs(difference).max())):
        raise InputError(
            f"pairs: expected differences that vary, got {difference[0]:g} from all participants; the"
            " standard error is 0, inspect the answers instead"
        )
    return float(difference.mean()), error, len(a)
