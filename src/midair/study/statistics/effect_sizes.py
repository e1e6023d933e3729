"""Confidence limits of effect sizes, from noncentral distributions."""

import numpy as np


def noncentral_t_limits(t: float, df: float, *, level: float = 0.95) -> tuple[float, float]:
    """Confidence limits of the noncentrality of an observed t (Cumming and Finch, 2001)."""
    from scipy.optimize import brentq
    from scipy.special import chdtri, nctdtr, ndtri

    tail = (1 - level) / 2
    # The limits lie between t S - z and t S + z, for quantiles of S = sqrt(chi2 / df) and z at half of the tail.
    reach = t * np.sqrt(chdtri(df, np.array([1 - tail / 2, tail / 2])) / df)
    if abs(t) > 1000:  # the numerator's error is negligible, and nctdtr is NaN for t of 1e6
        reach = t * np.sqrt(chdtri(df, np.array([1 - tail, tail])) / df)
        return float(reach.min()), float(reach.max())
    begin, end = float(reach.min() + ndtri(tail / 2)), float(reach.max() - ndtri(tail / 2))

    def excess(ncp: float, share: float) -> float:
        return float(nctdtr(df, ncp, t)) - share

    low, high = (float(brentq(excess, begin, end, args=(share,), xtol=1e-10)) for share in (1 - tail, tail))
    return low, high


def eta_squared_limits(f: float, df1: float, df2: float, *, level: float = 0.9) -> tuple[float, float]:
    """Confidence limits of partial eta squared from an F statistic with fixed effects (Steiger, 2004).

    A noncentrality L corresponds to the partial eta squared L / (L + df2). Limits at level 0.9 exclude 0 if p < 0.05.
    """
    from scipy.optimize import brentq
    from scipy.special import chdtri, fdtr, ncfdtr

    def excess(ncp: float, tail: float) -> float:
        return float(ncfdtr(df1, df2, ncp, f)) - tail

    if not np.isfinite(f):
        return np.nan, np.nan
    limits: list[float] = []
    for tail in ((1 + level) / 2, (1 - level) / 2):
        most, ncp = 4 * df1 * f + 10, 0.0
        if f > 1e6:  # as for t
            ncp = df1 * f * float(chdtri(df2, tail)) / df2
        elif fdtr(df1, df2, f) > tail:
            while ncfdtr(df1, df2, most, f) > tail:
                most *= 2
            ncp = float(brentq(excess, 0, most, args=(tail,), xtol=1e-10))
        limits.append(ncp / (ncp + df2))
    return limits[0], limits[1]
