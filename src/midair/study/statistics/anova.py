"""Repeated-measures analysis of variance with any number of factors, and its corrections for sphericity."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.study.statistics.cell_averages import CellMeans, cell_means

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pandas import DataFrame

Array = NDArray[np.float64]


def rm_anova(table: DataFrame | Mapping[str, Any], *, value: str, participant: str, within: Sequence[str]) -> DataFrame:
    """Analysis of variance of a design in which every participant sees every cell.

    Each effect is the Kronecker product of orthonormal Helmert contrasts of its factors and of averages over the
    others: Z = Y C'. With n participants and d = df1 contrasts, S is the covariance of Z.

    - F = n |mean Z|^2 / tr S, on d and d (n - 1) degrees of freedom.
    - Greenhouse and Geisser (1959): eps_GG = tr(S)^2 / (d sum S^2).
    - Huynh and Feldt (1976): eps_HF = (n d eps_GG - 2) / (d (n - 1 - d eps_GG)), as it comes out, even above 1; its
      p-value takes 1 then.
    - Mauchly (1940): W = det S / (tr S / d)^d, with p from the second-order expansion of Box (1949).
    - Partial eta squared np2, and generalised eta squared ges of Olejnik and Algina (2003) with every factor
      manipulated.

    Several answers in one cell are averaged first.

    Parameters
    ----------
    table : DataFrame or dict of arrays
        One row an answer.
    value, participant : str
        Names of the columns of the answer and of who gave it.
    within : sequence of str
        Names of the columns of the factors.

    Returns
    -------
    DataFrame
        One row an effect; columns effect, df1, df2, F, p, eps_GG, p_GG, eps_HF, p_HF, W, p_W, np2, ges, note. An effect
        with one contrast is spherical: its epsilons and W are 1. Where a number does not exist it is NaN and `note`
        says why.

    Raises
    ------
    InputError
        If there is one participant, a cell is empty, a factor has one level, or every answer is the same.
    """
    from pandas import DataFrame

    if not within:
        raise InputError("within: expected one factor or more, got none")
    cells = cell_means(table, value=value, participant=participant, within=within)
    people = len(cells.participants)
    if people < 2:
        raise InputError(f"participants: expected two or more, got {people}; one person has no error term")
    if np.ptp(cells.mean) == 0:
        raise InputError(f"column {value!r}: expected answers that vary, got {cells.mean.flat[0]:g} everywhere")
    return DataFrame(_rows(cells, list(within)))


def effects(factors: Sequence[str]) -> list[tuple[int, ...]]:
    """Every main effect and interaction as numbers of factors, the small ones first."""
    return [chosen for size in range(1, len(factors) + 1) for chosen in combinations(range(len(factors)), size)]


def contrasts(shape: Sequence[int], effect: Sequence[int]) -> Array:
    """Orthonormal contrasts of one effect over the cells of a design, shape (contrast, cell).

    Parameters
    ----------
    shape : sequence of int
        Levels of each factor.
    effect : sequence of int
        Factors that take part; the design is averaged over the others.
    """
    from scipy.linalg import helmert

    product: Array = np.ones((1, 1))
    for factor, count in enumerate(shape):
        part = helmert(count) if factor in effect else np.full((1, count), count**-0.5)
        product = np.asarray(np.kron(product, part), np.float64)
    return product


def _rows(cells: CellMeans, within: list[str]) -> list[dict[str, object]]:
    people = len(cells.participants)
    answers = cells.mean.reshape(people, -1)
    shape = cells.mean.shape[1:]
    projected = {effect: answers @ contrasts(shape, effect).T for effect in effects(within)}
    errors = {effect: float(((z - z.mean(axis=0)) ** 2).sum()) for effect, z in projected.items()}
    between = answers.shape[1] * float(((answers.mean(axis=1) - answers.mean()) ** 2).sum())
    noise = between + sum(errors.values())
    return [
        {"effect": ":".join(within[i] for i in effect), **_row(z, noise, scale=float(np.abs(answers).max()))}
        for effect, z in projected.items()
    ]


def _row(z: Array, noise: float, *, scale: float) -> dict[str, object]:
    """One effect from its contrasts `z` (participant, contrast); `noise`: all sums of squares that are no effect."""
    from scipy.stats import f as f_distribution

    people, d = z.shape
    df1, df2 = d, d * (people - 1)
    between = people * float((z.mean(axis=0) ** 2).sum())
    within = float(((z - z.mean(axis=0)) ** 2).sum())
    # Sums of squares as small as this are the rounding of the answers.
    negligible = people * d * (1e-12 * scale) ** 2
    shares = {
        "np2": between / (between + within) if between + within > negligible else np.nan,
        "ges": between / (between + noise) if between + noise > negligible else np.nan,
    }
    if within <= negligible:
        void = dict.fromkeys(("F", "p", "eps_GG", "p_GG", "eps_HF", "p_HF", "W", "p_W"), np.nan)
        note = "every participant shows the same effect: no error to compare it with"
        return {"df1": df1, "df2": df2, **void, **shares, "note": note}
    ratio = (between / df1) / (within / df2)
    sphericity, note = _sphericity(np.atleast_2d(np.cov(z, rowvar=False)), people)
    p = {
        name: float(f_distribution.sf(ratio, df1 * min(1, epsilon), df2 * min(1, epsilon)))
        for name, epsilon in (("p", 1.0), ("p_GG", sphericity["eps_GG"]), ("p_HF", sphericity["eps_HF"]))
    }
    row: dict[str, object] = {"df1": df1, "df2": df2, "F": ratio, "p": p["p"]}
    row |= {"eps_GG": sphericity["eps_GG"], "p_GG": p["p_GG"], "eps_HF": sphericity["eps_HF"], "p_HF": p["p_HF"]}
    return row | {"W": sphericity["W"], "p_W": sphericity["p_W"], **shares, "note": note}


def _sphericity(covariance: Array, people: int) -> tuple[dict[str, float], str]:
    """Epsilons, W and its p from the covariance of the contrasts; the note says what could not be had."""
    d = len(covariance)
    if d == 1:
        return {"eps_GG": 1.0, "eps_HF": 1.0, "W": 1.0, "p_W": 1.0}, ""
    trace = float(np.trace(covariance))
    gg = trace**2 / (d * float((covariance**2).sum()))
    room = people - 1 - d * gg
    # Where the estimate has no finite value there is nothing to correct by: 1.
    hf = (people * d * gg - 2) / (d * room) if room > 1e-9 else 1.0
    if people - 1 < d:
        note = f"Mauchly's test needs more than {d} participants, got {people}"
        return {"eps_GG": gg, "eps_HF": hf, "W": np.nan, "p_W": np.nan}, note
    sign, logarithm = np.linalg.slogdet(covariance / (trace / d))
    if sign <= 0 or logarithm < -200:
        note = "contrasts that depend on each other: Mauchly's test does not exist"
        return {"eps_GG": gg, "eps_HF": hf, "W": 0.0, "p_W": np.nan}, note
    return {"eps_GG": gg, "eps_HF": hf, "W": float(np.exp(logarithm)), "p_W": _mauchly(logarithm, d, people - 1)}, ""


def _mauchly(log_w: float, d: int, df: int) -> float:
    """P-value of Mauchly's W by Box's expansion to second order (Anderson, Multivariate Analysis, 10.7).

    R's mauchly.test writes the number of cells for d in one term of it: beyond d = 2 the third decimal differs.
    """
    from scipy.stats import chi2

    rho = 1 - (2 * d**2 + d + 2) / (6 * d * df)
    weight = (d + 2) * (d - 1) * (d - 2) * (2 * d**3 + 6 * d**2 + 3 * d + 2) / (288 * (df * d * rho) ** 2)
    z, f = -df * rho * log_w, d * (d + 1) / 2 - 1
    first, second = chi2.sf(z, f), chi2.sf(z, f + 4)
    return float(np.clip(first + weight * (second - first), 0, 1))
