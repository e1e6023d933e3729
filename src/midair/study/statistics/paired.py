"""Paired values: t-test, equivalence, Bayes factor, Holm's correction, and comparisons of the levels of factors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np
import scipy
from pandas import DataFrame

from midair.array_types import Array
from midair.errors import InputError, NonFiniteError, ShapeError
from midair.study.statistics.columns import cell_means


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


def order_rank(people: int, *, alpha: float = 0.05) -> int:
    """Rank from each end of the values that are the limits of their median at the level 1 - `alpha`; 0 if none are."""
    return int(scipy.stats.binom.ppf(alpha / 2, people, 0.5))


def paired_t(first: Sequence[float] | Array, second: Sequence[float] | Array, *, level: float = 0.95) -> PairedT:
    """Student's t-test of the differences first - second.

    Raises ShapeError if there are fewer than two pairs or the lengths differ and InputError if all differences are
    equal: the standard error is 0.
    """
    mean, error, n = _difference(first, second)
    t = mean / error
    half = error * float(scipy.stats.t.ppf((1 + level) / 2, n - 1))
    p = float(2 * scipy.stats.t.sf(abs(t), n - 1))
    return PairedT(t=t, df=n - 1, p=p, difference=mean, low=mean - half, high=mean + half, d_z=t / n**0.5, n=n)


def equivalence(first: Sequence[float] | Array, second: Sequence[float] | Array, *, margin: float) -> Equivalence:
    """Test whether two conditions are equivalent within a margin that was chosen beforehand: TOST (Schuirmann, 1987).

    Raises ShapeError or InputError as `paired_t`; also if the margin is not above 0.
    """
    if not margin > 0:
        raise InputError(f"margin: expected a difference above 0, got {margin:g}")
    mean, error, n = _difference(first, second)
    # The test at the nearer margin has the larger p-value, which is the p-value of TOST.
    p = scipy.stats.t.sf((margin - abs(mean)) / error, n - 1)
    half = error * float(scipy.stats.t.ppf(0.95, n - 1))
    return Equivalence(p=float(p), margin=float(margin), low=mean - half, high=mean + half)


def bayes_factor(t: float, n: int, *, width: float = 2**-0.5) -> float:
    """Bayes factor BF10 of a paired t-test with n pairs (Rouder et al., 2009); values below 1 favour no difference.

    Under the alternative, the effect has a Cauchy prior of the given width in units of d_z. BF10 is the integral over g
    of
    (1 + n g)^(-1/2) (1 + t^2 / ((1 + n g) df))^(-n/2) with g inverse-gamma(1/2, width^2/2), divided by
    (1 + t^2 / df)^(-n/2).
    """
    if n < 2 or not np.isfinite(t):
        raise InputError(f"Bayes factor: expected a finite t of two or more pairs, got t = {t:g}, n = {n}")
    df = n - 1
    null = -n / 2 * np.log1p(t**2 / df)

    def weight(x: float) -> float:  # g = exp(x)
        g = np.exp(x)
        prior = 0.5 * np.log(width**2 / (2 * np.pi)) - 1.5 * x - width**2 / (2 * g)
        return float(np.exp(prior + x - 0.5 * np.log1p(n * g) - n / 2 * np.log1p(t**2 / ((1 + n * g) * df)) - null))

    # Integrated over log g, where the integrand is smooth; over g it is a spike near 0 with a long tail.
    value, _ = scipy.integrate.quad(weight, -25, 40, limit=400, points=[-5.0, 0.0, 5.0])
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


def pairwise(
    table: DataFrame | Mapping[str, Any],
    *,
    value: str,
    participant: str,
    within: Sequence[str],
    effects: Sequence[str] = (),
) -> DataFrame:
    """Compare each pair of levels of each within-subject factor; the effects and means are those of `rm_anova`.

    The t-test of each participant's difference (paired t), which does not assume sphericity, with Holm's correction
    (1979) for the pairs of the effect. For an interaction such as "surface:object": the pairs of its cells that differ
    in one factor. Raises InputError as `rm_anova`; also if an effect names an unknown factor.

    `effects` are factors, or interactions with factors joined by colons; all factors by default.

    Returns the columns effect, first, second, difference (first - second), low, high (95 % limits, uncorrected), df, t,
    p, p_pairs (corrected), d (d_z, the difference over the standard deviation of the differences), note. Where all
    differences are equal the tests are NaN, and `note` gives the reason.
    """
    cells = cell_means(table, value=value, participant=participant, within=within)
    if (people := len(cells.participants)) < 2:
        raise InputError(f"participants: expected two or more, got {people}; no error term")
    rows: list[dict[str, Any]] = []
    for effect in effects or within:
        chosen = effect.split(":")
        if unknown := set(chosen) - set(within):
            raise InputError(f"effects: expected factors among {', '.join(within)}, got {', '.join(sorted(unknown))}")
        order = [within.index(name) for name in chosen]
        found: list[dict[str, Any]] = []
        for pair in combinations(product(*(range(len(cells.levels[i])) for i in order)), 2):
            if sum(a != b for a, b in zip(*pair, strict=True)) == 1:
                means = [_mean_within(cells.mean, dict(zip(order, cell, strict=True))) for cell in pair]
                first, second = (
                    ", ".join(str(cells.levels[i][k]) for i, k in zip(order, cell, strict=True)) for cell in pair
                )
                found.append({"effect": effect, "first": first, "second": second, **_comparison(*means)})
        known = [row for row in found if np.isfinite(row["p"])]
        for row, p in zip(known, holm([row["p"] for row in known]), strict=True):
            row["p_pairs"] = float(p)
        rows += found
    return DataFrame(rows)


def _comparison(first: Array, second: Array) -> dict[str, Any]:
    """Paired t-test of two columns of means, one per participant; `p_pairs` is left to the caller."""
    try:
        found = paired_t(first, second)
    except InputError:
        void = dict.fromkeys(("low", "high", "df", "t", "p", "p_pairs", "d"), np.nan)
        note = "the same difference in every participant: no error to compare it with"
        return {"difference": float((first - second).mean()), **void, "df": len(first) - 1, "note": note}
    row = {"difference": found.difference, "low": found.low, "high": found.high, "df": found.df, "t": found.t}
    return row | {"p": found.p, "p_pairs": np.nan, "d": found.d_z, "note": ""}


def _mean_within(y: Array, cell: dict[int, int]) -> Array:
    """Mean of each participant over the cells with the given levels of some factors."""
    chosen = y[(slice(None), *(cell.get(axis, slice(None)) for axis in range(y.ndim - 1)))]
    return chosen.reshape(len(y), -1).mean(axis=1)
