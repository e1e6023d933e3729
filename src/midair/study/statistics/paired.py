"""Two conditions, one pair of figures a person: difference, equivalence, and evidence for either."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, NonFiniteError, ShapeError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class PairedT:
    """What a paired t-test found.

    Attributes
    ----------
    t, df, p : float
        Two-sided.
    difference, low, high : float
        Mean difference and its 95 % limits, in the unit of the figures.
    d_z : float
        Mean difference over its standard deviation.
    n : int
        Pairs.
    """

    t: float
    df: int
    p: float
    difference: float
    low: float
    high: float
    d_z: float
    n: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Equivalence:
    """What two one-sided tests for equivalence found.

    Attributes
    ----------
    p : float
        Small if the difference lies within the margin for certain.
    margin : float
        Largest difference that does not matter, in the unit of the figures.
    low, high : float
        90 % limits of the difference: equivalent at .05 if they lie within the margin.
    """

    p: float
    margin: float
    low: float
    high: float


def paired_t(first: Sequence[float] | Array, second: Sequence[float] | Array, *, level: float = 0.95) -> PairedT:
    """Student's t of the differences first - second.

    Raises
    ------
    ShapeError
        If there are not two or more pairs.
    InputError
        If every pair differs by the same: there is no error to compare the difference with.
    """
    from scipy.stats import t as t_distribution

    mean, error, n = _difference(first, second)
    t = mean / error
    half = error * float(t_distribution.ppf((1 + level) / 2, n - 1))
    p = float(2 * t_distribution.sf(abs(t), n - 1))
    return PairedT(t=t, df=n - 1, p=p, difference=mean, low=mean - half, high=mean + half, d_z=t / n**0.5, n=n)


def equivalence(first: Sequence[float] | Array, second: Sequence[float] | Array, *, margin: float) -> Equivalence:
    """Whether two conditions are the same within a margin: TOST (Schuirmann, 1987).

    Parameters
    ----------
    first, second : sequence of float, length pair
        A figure of each person in each condition.
    margin : float
        Largest difference that does not matter; chosen before the data are seen.

    Raises
    ------
    ShapeError, InputError
        As `paired_t`; also if the margin is not above 0.
    """
    from scipy.stats import t as t_distribution

    if not margin > 0:
        raise InputError(f"margin: expected a difference above 0, got {margin:g}")
    mean, error, n = _difference(first, second)
    # Of the two tests the one at the nearer margin has the larger p, and decides.
    p = t_distribution.sf((margin - abs(mean)) / error, n - 1)
    half = error * float(t_distribution.ppf(0.95, n - 1))
    return Equivalence(p=float(p), margin=float(margin), low=mean - half, high=mean + half)


def bayes_factor(t: float, n: int, *, width: float = 2**-0.5) -> float:
    """Evidence of a paired t for a difference over none, BF10 (Rouder et al., 2009): below 1 speaks for no difference.

    The effect has a Cauchy prior of the given width under the hypothesis of a difference:
    the integral over g of (1 + n g)^(-1/2) (1 + t^2 / ((1 + n g) df))^(-n/2) with g inverse-gamma(1/2, width^2/2),
    over (1 + t^2 / df)^(-n/2).

    Parameters
    ----------
    t : float
        Student's t of the paired test.
    n : int
        Pairs, 2 or more.
    width : float
        Scale of the prior, in units of d_z.
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

    # Over the logarithm of g the integrand is one wide hump; over g it is a spike near 0 with a long tail.
    value, _ = quad(weight, -25, 40, limit=400, points=[-5.0, 0.0, 5.0])
    return float(value)


def holm(p: Sequence[float] | Array) -> Array:
    """P-values corrected for their number (Holm, 1979), in the order given.

    Parameters
    ----------
    p : sequence of float
        P-values of one family of tests.

    Raises
    ------
    NonFiniteError
        If one is NaN: drop tests that could not be made before correcting.
    """
    raw = np.asarray(p, float)
    if not np.isfinite(raw).all():
        raise NonFiniteError("p-values: expected numbers, got NaN; drop the tests that could not be made")
    order = np.argsort(raw, kind="stable")
    # A larger p must not come out with a smaller corrected one.
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
        raise NonFiniteError("pairs: expected finite numbers; leave out the pair that is not complete")
    difference = a - b
    error = float(difference.std(ddof=1)) / len(a) ** 0.5
    # Differences that vary by no more than rounding do not vary.
    if error <= 1e-13 * max(1.0, float(np.abs(difference).max())):
        raise InputError(
            f"pairs: expected differences that vary, got {difference[0]:g} from everyone; there is no error to"
            " compare it with, look at the answers instead"
        )
    return float(difference.mean()), error, len(a)
