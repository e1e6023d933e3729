"""Repeated-measures analysis of variance, with corrections for sphericity, limits of effect sizes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from pandas import DataFrame

from midair.array_types import Array
from midair.errors import InputError
from midair.study.statistics.columns import CellMeans, cell_means, column, factors, frame_of, levels


def sphericity(covariance: Array, df: int) -> tuple[dict[str, float], str]:
    """Epsilons of Greenhouse and Geisser and of Huynh and Feldt, Mauchly's W and its p; and a note on undefined values.

    `covariance` (contrast, contrast) is pooled within groups with `df` degrees of freedom: participants minus groups.
    """
    d = len(covariance)
    if d == 1:
        return {"eps_GG": 1.0, "eps_HF": 1.0, "W": 1.0, "p_W": 1.0}, ""
    trace = float(np.trace(covariance))
    gg = trace**2 / (d * float((covariance**2).sum()))
    room = df - d * gg
    # Where the estimate is not finite, no correction is applied: 1.
    hf = ((df + 1) * d * gg - 2) / (d * room) if room > 1e-9 else 1.0
    if df < d:
        note = f"Mauchly's test needs {d} or more participants beyond one per group, got {df}"
        return {"eps_GG": gg, "eps_HF": hf, "W": np.nan, "p_W": np.nan}, note
    sign, logarithm = np.linalg.slogdet(covariance / (trace / d))
    if sign <= 0 or logarithm < -200:
        note = "contrasts are linearly dependent: Mauchly's test is undefined"
        return {"eps_GG": gg, "eps_HF": hf, "W": 0.0, "p_W": np.nan}, note
    return {"eps_GG": gg, "eps_HF": hf, "W": float(np.exp(logarithm)), "p_W": _mauchly(logarithm, d, df)}, ""


def _mauchly(log_w: float, d: int, df: int) -> float:
    """P-value of Mauchly's W by Box's expansion to second order (Anderson, Multivariate Analysis, 10.7).

    R's mauchly.test uses the number of cells for d in one term: above d = 2 the third decimal differs.
    """
    rho = 1 - (2 * d**2 + d + 2) / (6 * d * df)
    weight = (d + 2) * (d - 1) * (d - 2) * (2 * d**3 + 6 * d**2 + 3 * d + 2) / (288 * (df * d * rho) ** 2)
    z, f = -df * rho * log_w, d * (d + 1) / 2 - 1
    first, second = scipy.stats.chi2.sf(z, f), scipy.stats.chi2.sf(z, f + 4)
    return float(np.clip(first + weight * (second - first), 0, 1))


def noncentral_t_limits(t: float, df: float, *, level: float = 0.95) -> tuple[float, float]:
    """Confidence limits of the noncentrality of an observed t (Cumming and Finch, 2001)."""
    tail = (1 - level) / 2
    # The limits lie between t S - z and t S + z, for quantiles of S = sqrt(chi2 / df) and z at half of the tail.
    reach = t * np.sqrt(scipy.special.chdtri(df, np.array([1 - tail / 2, tail / 2])) / df)
    if abs(t) > 1000:  # the numerator's error is negligible, and nctdtr is NaN for t of 1e6
        reach = t * np.sqrt(scipy.special.chdtri(df, np.array([1 - tail, tail])) / df)
        return float(reach.min()), float(reach.max())
    begin, end = float(reach.min() + scipy.special.ndtri(tail / 2)), float(reach.max() - scipy.special.ndtri(tail / 2))

    def excess(ncp: float, share: float) -> float:
        return float(scipy.special.nctdtr(df, ncp, t)) - share

    low, high = (
        float(scipy.optimize.brentq(excess, begin, end, args=(share,), xtol=1e-10)) for share in (1 - tail, tail)
    )
    return low, high


def eta_squared_limits(f: float, df1: float, df2: float, *, level: float = 0.9) -> tuple[float, float]:
    """Confidence limits of partial eta squared from an F statistic with fixed effects (Steiger, 2004).

    A noncentrality L corresponds to the partial eta squared L / (L + df2). Limits at level 0.9 exclude 0 if p < 0.05.
    """

    def excess(ncp: float, tail: float) -> float:
        return float(scipy.special.ncfdtr(df1, df2, ncp, f)) - tail

    if not np.isfinite(f):
        return np.nan, np.nan
    limits: list[float] = []
    for tail in ((1 + level) / 2, (1 - level) / 2):
        most, ncp = 4 * df1 * f + 10, 0.0
        if f > 1e6:  # as for t
            ncp = df1 * f * float(scipy.special.chdtri(df2, tail)) / df2
        elif scipy.special.fdtr(df1, df2, f) > tail:
            while scipy.special.ncfdtr(df1, df2, most, f) > tail:
                most *= 2
            ncp = float(scipy.optimize.brentq(excess, 0, most, args=(tail,), xtol=1e-10))
        limits.append(ncp / (ncp + df2))
    return limits[0], limits[1]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Groups:
    """Group of each participant, as an index over the levels of the between-subject factors."""

    number: NDArray[np.int64]
    shape: tuple[int, ...]
    """Number of levels of each between-subject factor; empty without one."""
    levels: tuple[tuple[Any, ...], ...]
    """Levels of each between-subject factor."""

    @property
    def sizes(self) -> Array:
        """Participants per group."""
        return np.bincount(self.number, minlength=int(np.prod(self.shape))).astype(float)

    def means(self, z: Array) -> Array:
        """Mean of each group, shape (group, contrast)."""
        sums = np.array([np.bincount(self.number, column, minlength=len(self.sizes)) for column in z.T])
        return (sums / self.sizes).T


def rm_anova(
    table: DataFrame | Mapping[str, Any],
    *,
    value: str,
    participant: str,
    within: Sequence[str],
    between: Sequence[str] = (),
) -> DataFrame:
    """Repeated-measures or mixed analysis of variance; every participant has every cell of the within-subject factors.

    Each within-subject effect is the Kronecker product of orthonormal Helmert contrasts of its factors and of averages
    over the others: Z = Y C'. With n participants in G groups, d within-subject and r between-subject contrasts (rows
    of c), M the group means of Z, D the diagonal of 1 / group size, and S the pooled covariance of Z within groups:

    - F = tr[(c M)' (c D c')^-1 (c M)] / (r tr S), with r d and d (n - G) degrees of freedom. These are type III sums of
      squares: unweighted group means.
    - Greenhouse and Geisser (1959): eps_GG = tr(S)^2 / (d sum S^2).
    - Huynh and Feldt (1976): eps_HF = ((n - G + 1) d eps_GG - 2) / (d (n - G - d eps_GG)). The returned value may
      exceed 1; its p-value uses at most 1.
    - Mauchly (1940): W = det S / (tr S / d)^d, with p from the second-order expansion of Box (1949).
    - Partial eta squared np2, and generalised eta squared ges of Olejnik and Algina (2003) with all factors
      manipulated. 90 % limits of np2 from the noncentral F, with degrees of freedom times eps_GG; they exclude 0 if
      p_GG < 0.05. Those of ges are converted from them with the observed ratio of the error sums of squares.

    Several answers in one cell are averaged first. Raises InputError if there are fewer participants than groups + 1, a
    cell or group is empty, a factor has one level, a participant is in two groups, or all answers are equal.

    `table` has one row per answer; `within` and `between` name columns of factors, such as the dominant hand.

    Returns one row per effect, with columns effect, df1, df2, F, p, eps_GG, p_GG, eps_HF, p_HF, W, p_W, np2, ges,
    np2_low, np2_high, ges_low, ges_high, note. An effect with one contrast is spherical: its epsilons and W are 1. A
    value that is undefined is NaN, and `note` gives the reason.
    """
    if not within:
        raise InputError("within: expected one factor or more, got none")
    if both := set(within) & set(between):
        raise InputError(f"factors: expected within- or between-subject factors, got {sorted(both)} in both")
    cells = cell_means(table, value=value, participant=participant, within=within)
    groups = between_groups(frame_of(table), cells, participant, list(between))
    people, needed = len(cells.participants), len(groups.sizes) + 1
    if people < needed:
        what = "one participant gives no error term" if needed == 2 else "every group needs an error term"
        raise InputError(f"participants: expected {'two' if needed == 2 else needed} or more, got {people}; {what}")
    if np.ptp(cells.mean) == 0:
        raise InputError(f"column {value!r}: expected answers that vary, got {cells.mean.flat[0]:g} everywhere")
    return DataFrame(_rows(cells, groups, list(within), list(between)))


def effects(factors: Sequence[str]) -> list[tuple[int, ...]]:
    """Every main effect and interaction as indices of factors, lowest order first."""
    return [chosen for size in range(1, len(factors) + 1) for chosen in combinations(range(len(factors)), size)]


def contrasts(shape: Sequence[int], effect: Sequence[int]) -> Array:
    """Orthonormal contrasts of one effect over the cells of a design, shape (contrast, cell).

    `shape` gives the levels of each factor; the design is averaged over the factors that are not in `effect`.
    """
    product: Array = np.ones((1, 1))
    for factor, count in enumerate(shape):
        part = scipy.linalg.helmert(count) if factor in effect else np.full((1, count), count**-0.5)
        product = np.asarray(np.kron(product, part), np.float64)
    return product


def between_groups(data: DataFrame, cells: CellMeans, participant: str, between: list[str]) -> Groups:
    """Group of each participant; raises InputError if a group is empty or a participant is in two."""
    person = levels(column(data, participant))[1]
    _, first = np.unique(person, return_index=True)
    found = factors(data, between, option="between")
    for name, (_, number) in zip(between, found, strict=True):
        if (strange := number != number[first][person]).any():
            who = cells.participants[person[strange][0]]
            raise InputError(f"factor {name!r}: expected one level per participant, got several from participant {who}")
    shape = tuple(len(order) for order, _ in found)
    where = np.ravel_multi_index(tuple(number[first] for _, number in found), shape) if found else first * 0
    groups = Groups(number=np.asarray(where, np.int64), shape=shape, levels=tuple(tuple(order) for order, _ in found))
    if (groups.sizes == 0).any():
        empty = np.unravel_index(int(np.argmin(groups.sizes)), shape)
        what = ", ".join(f"{name}={order[i]}" for name, (order, _), i in zip(between, found, empty, strict=True))
        raise InputError(f"groups: expected participants in every group, got none with {what}; remove the factor")
    return groups


def _rows(cells: CellMeans, groups: Groups, within: list[str], between: list[str]) -> list[dict[str, object]]:
    answers = cells.mean.reshape(len(cells.participants), -1)
    inside = [(), *effects(within)]
    projected = {effect: answers @ contrasts(cells.mean.shape[1:], effect).T for effect in inside}
    rest = {effect: z - groups.means(z)[groups.number] for effect, z in projected.items()}
    noise = sum(float((error**2).sum()) for error in rest.values())
    scale = float(np.abs(answers).max())
    rows: list[dict[str, object]] = []
    for effect in effects([*between, *within]):
        outer = tuple(i for i in effect if i < len(between))
        inner = tuple(i - len(between) for i in effect if i >= len(between))
        row = _row(projected[inner], rest[inner], groups, contrasts(groups.shape, outer), noise, scale)
        rows.append({"effect": ":".join([*between, *within][i] for i in effect), **row})
    return rows


def _row(z: Array, rest: Array, groups: Groups, outer: Array, noise: float, scale: float) -> dict[str, object]:
    """Statistics of one effect.

    `z`: within-subject contrasts (participant, contrast); `rest`: their deviations from the group means; `outer`:
    between-subject contrasts; `noise`: sum of all error sums of squares.
    """
    d, degrees = z.shape[1], len(z) - len(groups.sizes)
    df1, df2 = d * len(outer), d * degrees
    shown = outer @ groups.means(z)
    weight = np.linalg.inv((outer / groups.sizes) @ outer.T)
    effect, error = float(np.einsum("ij,ik,kj->", shown, weight, shown)), float((rest**2).sum())
    # Smaller sums of squares are rounding errors.
    negligible = len(z) * d * (1e-12 * scale) ** 2
    shares = {
        "np2": effect / (effect + error) if effect + error > negligible else np.nan,
        "ges": effect / (effect + noise) if effect + noise > negligible else np.nan,
    }
    limits = ("np2_low", "np2_high", "ges_low", "ges_high")
    if error <= negligible:
        void = dict.fromkeys(("F", "p", "eps_GG", "p_GG", "eps_HF", "p_HF", "W", "p_W", *limits), np.nan)
        note = "every participant shows the same effect: no error to compare it with"
        return {"df1": df1, "df2": df2, **void, **shares, "note": note}
    ratio = (effect / df1) / (error / df2)
    round_, note = sphericity(rest.T @ rest / degrees, degrees)
    p = {
        name: float(scipy.stats.f.sf(ratio, df1 * min(1, epsilon), df2 * min(1, epsilon)))
        for name, epsilon in (("p", 1.0), ("p_GG", round_["eps_GG"]), ("p_HF", round_["eps_HF"]))
    }
    # Partial eta squared as a ratio effect / error, of which generalised eta squared has another denominator.
    partial = eta_squared_limits(ratio, df1 * round_["eps_GG"], df2 * round_["eps_GG"])
    sizes = [np2 / (1 - np2) * error for np2 in partial]
    shares |= dict(zip(limits, (*partial, *(size / (size + noise) for size in sizes)), strict=True))
    row: dict[str, object] = {"df1": df1, "df2": df2, "F": ratio, "p": p["p"]}
    row |= {"eps_GG": round_["eps_GG"], "p_GG": p["p_GG"], "eps_HF": round_["eps_HF"], "p_HF": p["p_HF"]}
    return row | {"W": round_["W"], "p_W": round_["p_W"], **shares, "note": note}
