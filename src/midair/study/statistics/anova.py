"""Repeated-measures analysis of variance with corrections for sphericity."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import scipy
from pandas import DataFrame

from midair.array_types import Array
from midair.errors import InputError
from midair.study.statistics.columns import cell_means


def sphericity(covariance: Array, df: int) -> tuple[dict[str, float], str]:
    """Epsilons of Greenhouse and Geisser and of Huynh and Feldt, Mauchly's W and its p; and a note on undefined values.

    `covariance` (contrast, contrast) has `df` degrees of freedom: participants minus one.
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
        note = f"Mauchly's test needs {d} or more participants beyond one, got {df}"
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


def rm_anova(table: DataFrame | Mapping[str, Any], *, value: str, participant: str, within: Sequence[str]) -> DataFrame:
    """Repeated-measures analysis of variance; every participant has every cell of the within-subject factors.

    Each effect is the Kronecker product of orthonormal Helmert contrasts of its factors and of averages over the
    others: Z = Y C'. With n participants, d contrasts, m their means and S their covariance:

    - F = n m m' / tr S, with d and d (n - 1) degrees of freedom (type III sums of squares).
    - Greenhouse and Geisser (1959): eps_GG = tr(S)^2 / (d sum S^2).
    - Huynh and Feldt (1976): eps_HF = (n d eps_GG - 2) / (d (n - 1 - d eps_GG)). The returned value may exceed 1; its
      p-value uses at most 1.
    - Mauchly (1940): W = det S / (tr S / d)^d, with p from the second-order expansion of Box (1949).
    - Partial eta squared np2, and generalised eta squared ges of Olejnik and Algina (2003) with all factors
      manipulated.

    Several answers in one cell are averaged first. Raises InputError if there are fewer than two participants, a cell
    is empty, a factor has one level, or all answers are equal. `table` has one row per answer; `within` names columns.

    Returns one row per effect, with columns effect, df1, df2, F, p, eps_GG, p_GG, eps_HF, p_HF, W, p_W, np2, ges, note.
    An effect with one contrast is spherical: its epsilons and W are 1. A value that is undefined is NaN, and `note`
    gives the reason.
    """
    if not within:
        raise InputError("within: expected one factor or more, got none")
    cells = cell_means(table, value=value, participant=participant, within=within)
    if (people := len(cells.participants)) < 2:
        raise InputError(f"participants: expected two or more, got {people}; one participant gives no error term")
    if np.ptp(cells.mean) == 0:
        raise InputError(f"column {value!r}: expected answers that vary, got {cells.mean.flat[0]:g} everywhere")
    answers = cells.mean.reshape(people, -1)
    projected = {effect: answers @ contrasts(cells.mean.shape[1:], effect).T for effect in ((), *effects(within))}
    noise = sum(float(((z - z.mean(axis=0)) ** 2).sum()) for z in projected.values())
    scale = float(np.abs(answers).max())
    return DataFrame(
        [
            {"effect": ":".join(within[i] for i in effect), **_row(projected[effect], noise, scale)}
            for effect in effects(within)
        ]
    )


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


def _row(z: Array, noise: float, scale: float) -> dict[str, object]:
    """Statistics of one effect, from its contrasts (participant, contrast) and the sum of all error sums of squares."""
    people, d = z.shape
    df1, df2 = d, d * (people - 1)
    rest = z - z.mean(axis=0)
    effect, error = people * float((z.mean(axis=0) ** 2).sum()), float((rest**2).sum())
    # Smaller sums of squares are rounding errors.
    negligible = people * d * (1e-12 * scale) ** 2
    shares = {
        "np2": effect / (effect + error) if effect + error > negligible else np.nan,
        "ges": effect / (effect + noise) if effect + noise > negligible else np.nan,
    }
    if error <= negligible:
        void = dict.fromkeys(("F", "p", "eps_GG", "p_GG", "eps_HF", "p_HF", "W", "p_W"), np.nan)
        note = "every participant shows the same effect: no error to compare it with"
        return {"df1": df1, "df2": df2, **void, **shares, "note": note}
    ratio = (effect / df1) / (error / df2)
    round_, note = sphericity(rest.T @ rest / (people - 1), people - 1)
    p = {
        name: float(scipy.stats.f.sf(ratio, df1 * min(1, epsilon), df2 * min(1, epsilon)))
        for name, epsilon in (("p", 1.0), ("p_GG", round_["eps_GG"]), ("p_HF", round_["eps_HF"]))
    }
    row: dict[str, object] = {"df1": df1, "df2": df2, "F": ratio, "p": p["p"]}
    row |= {"eps_GG": round_["eps_GG"], "p_GG": p["p_GG"], "eps_HF": round_["eps_HF"], "p_HF": p["p_HF"]}
    return row | {"W": round_["W"], "p_W": round_["p_W"], **shares, "note": note}
