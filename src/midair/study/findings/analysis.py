"""Analysis of a study: all findings in the order of the report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from midair.progress import report_progress
from midair.study.findings.choice_findings import choice_findings, compared, confusions, mixed
from midair.study.findings.finding import Choices, Finding, attempt
from midair.study.findings.question_findings import every_question, question_findings
from midair.study.findings.rating_findings import adaptive, anova, cumulative, pairs, psychometric, ranks, rating_means
from midair.study.findings.study_data import StudyData

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Report:
    """Result of an analysis."""

    findings: tuple[Finding, ...]
    """Parts in the order of the report."""
    choices: tuple[Choices, ...]
    """Confusion matrices, for the figures."""
    ratings: DataFrame | None
    """Mean rating of each cell with 95 % limits over participants: one column per factor, mean, low, high."""
    simulated: bool
    """Whether any answer comes from a simulated participant."""
    seed: int
    """Seed of the resampling."""


def analyse(data: StudyData, *, seed: int = 0, draws: int = 10_000) -> Report:
    """Run every analysis that the data allow; the report gives the reason for each that cannot be computed.

    `seed` is that of permutations and simulated data, `draws` the number of permutations.
    """
    rng = np.random.default_rng(seed)
    choices, failed = confusions(data)
    findings = [_participants_finding(data), *failed]
    jobs: list[Callable[[], Sequence[Finding]]] = [
        lambda one=one: attempt(f"Identification: {one.name}", lambda: choice_findings(one, rng=rng, draws=draws))
        for one in choices
    ]
    conditions = [] if data.choices is None else data.choices["condition"].map(str).tolist()
    pair = tuple(one for one in choices if one.name in conditions)
    if len(pair) == 2:
        jobs.append(lambda: compared(pair, data, rng=rng))
    if data.choices is not None:
        jobs.append(lambda: attempt("Mixed model of correct answers", lambda: mixed(data)))
    if data.ratings is not None:
        jobs.append(lambda: attempt("Ratings: analysis of variance", lambda: anova(data)))
        jobs.append(lambda: attempt("Ratings: pairwise comparisons", lambda: pairs(data)))
        jobs.append(lambda: attempt("Ratings: cumulative-link model", lambda: cumulative(data)))
        jobs.append(lambda: attempt("Ratings: check on ranks", lambda: ranks(data, rng=rng)))
    jobs.append(lambda: question_findings(data))
    jobs.append(lambda: attempt("Psychometric function", lambda: psychometric(data, rng=rng)))
    jobs.append(lambda: attempt("Thresholds of adaptive blocks", lambda: adaptive(data)))
    # The order matters: all jobs use the same random generator.
    for job in report_progress(jobs, len(jobs)):
        findings += job()
    if data.questions is not None:
        findings.append(every_question(data.questions))
    if data.files:
        findings.append(Finding(title="Check of the files", words=data.files))
    return Report(
        findings=tuple(findings), choices=choices, ratings=rating_means(data), simulated=data.simulated, seed=seed
    )


def _participants_finding(data: StudyData) -> Finding:
    known = None if data.thresholds is None else data.thresholds.loc[np.isfinite(data.thresholds["threshold"])]
    parts = [data.choices, data.other_choices, data.ratings, data.others, data.strengths, known]
    people = {who for part in parts if part is not None for who in part["participant"].tolist()}
    # Answers in `strengths` may also be in `others`.
    answers = [data.choices, data.other_choices, data.ratings, data.strengths if data.others is None else data.others]
    many = sum(len(part) for part in answers if part is not None) if data.analysed is None else data.analysed
    words = f"{len(people)} participant(s), {many} answers analysed"
    words += (
        f", {data.left_out} answers left out (familiarisation, checks, exclusions by the plan)."
        if data.left_out
        else "."
    )
    if data.excluded is not None:
        out = sorted(set(data.excluded["participant"].tolist()))
        words += f" The plan excludes {', '.join(out)}." if out else " The plan excludes no participant."
    if len(people) < 2:
        words += " With one person there are no limits and no tests over people."
    elif len(people) < 5:
        words += " With fewer than five people there are no limits over people: their coverage would be below 95 %."
    title = ("SIMULATED: no person was asked. " if data.simulated else "") + words
    excluded = data.excluded if data.excluded is not None and len(data.excluded) else None
    return Finding(title="Participants", words=title, table=excluded)
