"""Sphericity of within-subject contrasts, and the epsilon corrections of the F-test."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
    from scipy.stats import chi2

    rho = 1 - (2 * d**2 + d + 2) / (6 * d * df)
    weight = (d + 2) * (d - 1) * (d - 2) * (2 * d**3 + 6 * d**2 + 3 * d + 2) / (288 * (df * d * rho) ** 2)
    z, f = -df * rho * log_w, d * (d + 1) / 2 - 1
    first, second = chi2.sf(z, f), chi2.sf(z, f + 4)
    return float(np.clip(first + weight * (second - first), 0, 1))
