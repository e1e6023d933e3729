"""Report on thresholds: psychometric functions over all participants, and adaptive blocks of each participant."""

import numpy as np
from numpy.typing import NDArray

from midair.study.findings.finding import Finding, limits_words
from midair.study.findings.study_data import StudyData
from midair.study.statistics import PRIORS, fit_psychometric, fit_threshold, levels


def psychometric(data: StudyData, *, rng: np.random.Generator) -> list[Finding]:
    """One Weibull function for the answers of all participants, with jackknife limits over participants."""
    from pandas import DataFrame

    if data.strengths is None:
        return []
    rows = data.strengths
    guess, lapse_most = (float(rows[name].iloc[0]) for name in ("guess", "lapse_most"))
    people, person = levels(rows.loc[:, "participant"])
    strength, place = np.unique(rows["level"], return_inverse=True)
    cell = person * len(strength) + place
    size = len(people) * len(strength)
    sums = [np.bincount(cell, weights=each, minlength=size) for each in (rows["correct"], np.ones(len(rows)))]
    counts = np.stack(sums, axis=-1).reshape(len(people), len(strength), 2)
    right, total = counts.sum(axis=0).T
    fit = fit_psychometric(strength, right, total, rng=rng, guess=guess, shape="weibull", lapse_most=lapse_most)

    def threshold(drawn: NDArray[np.float64]) -> float:
        hits, trials = drawn.sum(axis=0).T
        seen = trials > 0
        return fit_threshold(
            strength[seen],
            hits[seen],
            trials[seen],
            guess=guess,
            shape="weibull",
            near=fit.function,
            lapse_most=lapse_most,
        )

    rate = guess + (1 - guess - fit.function.lapse) * (1 - float(np.exp(-1)))
    over_people = limits_words(threshold, counts, "positive", form=".3g")
    words = (
        f"Threshold {fit.function.threshold:.3g} ({100 * rate:.0f} % correct answers),"
        f" slope {fit.function.slope:.2g}; 95 % limits from trials {fit.threshold_low:.3g} to {fit.threshold_high:.3g},"
        f" valid for these people only; {over_people}"
    )
    fits = "fits" if fit.deviance_p > 0.05 else "does NOT fit"
    words += f". The Weibull function {fits} the answers (deviance {fit.deviance:.1f}, p = {fit.deviance_p:.2f})."
    if data.thresholds is not None:
        words += (
            f" It assumes a guess rate of {guess:g} and no side bias for all people; the thresholds of the adaptive"
            " blocks do not."
        )
    table = DataFrame({"level": strength, "right": right.astype(int), "answers": total.astype(int)})
    table["share"] = right / total
    return [Finding(title="Psychometric function", words=words, table=table)]


def adaptive(data: StudyData) -> list[Finding]:
    """Thresholds of adaptive blocks, and their geometric mean over participants."""
    if data.thresholds is None:
        return []
    known = data.thresholds.loc[np.isfinite(data.thresholds["threshold"])]
    several = len(set(data.thresholds["block"])) > 1
    parts: list[str] = []
    # Blocks may have different strengths, and their thresholds are not those of different people.
    for block, rows in known.groupby("block", sort=False):
        values = rows["threshold"].to_numpy(float)
        limits = limits_words(_geometric_mean, values, "positive", form=".3g")
        name = f"Block {block}: geometric" if several else "Geometric"
        parts.append(f"{name} mean of {len(rows)} thresholds: {_geometric_mean(values):.3g} ({limits}).")
    words = " ".join(parts) or "No threshold could be estimated."
    if len(known) < len(data.thresholds):
        words += f" {len(data.thresholds) - len(known)} missing: the notes give the reasons."
    words += (
        " Each threshold is the median of the posterior of a Weibull function, at 63 % of its rise; its slope, lapse"
        f" rate, and false-alarm rate or side bias are estimated too. {PRIORS}"
    )
    return [Finding(title="Thresholds of adaptive blocks", words=words, table=data.thresholds)]


def _geometric_mean(values: NDArray[np.float64]) -> float:
    return float(np.exp(np.log(values).mean()))
