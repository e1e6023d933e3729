"""The plan of a study as an HTML page for preregistration."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from midair.figures import render_page
from midair.study.design import (
    Analysis,
    Block,
    Design,
    Exclusions,
    Incomplete,
    Plan,
    PlannedPower,
    Question,
    UnpresentedAnswers,
    block_order,
)
from midair.study.statistics import (
    EquivalenceExperiment,
    Experiment,
    IdentificationExperiment,
    RatingExperiment,
    power_paired_t,
    simulated_power,
)
from midair.version import __version__

_INCOMPLETE: Mapping[Incomplete, str] = {
    "leave out": "Participants without an answer in every cell are excluded from the analysis of variance.",
    "refuse": "There is no analysis of variance if a participant has an empty cell.",
}
_FOILS: Mapping[UnpresentedAnswers, str] = {
    "wrong": "Answers that name an object that was never presented count as wrong.",
    "leave out": "Answers that name an object that was never presented are excluded.",
    "refuse": "There is no analysis of choices if an answer names an object that was never presented.",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanPart:
    """One part of the page: text lines and an optional table."""

    title: str
    lines: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    digests: bool = False


def plan_page(plan: Plan, *, runs: int = 500) -> str:
    """The plan as a self-contained, reproducible HTML page, with `runs` simulated studies per power analysis."""
    design = plan.design
    return render_page(
        "study/registration.html.j2",
        title=design.title or design.name,
        simulated=False,
        digest=plan.digest,
        seed=design.seed,
        participants=design.participants,
        parts=plan_parts(plan, runs=runs),
        notes=f"midair {__version__}",
    )


def plan_parts(plan: Plan, *, runs: int = 500) -> list[PlanPart]:
    """Parts of the page."""
    design = plan.design
    return [
        PlanPart(title="Hypotheses", lines=design.hypotheses or ("No hypotheses are stated.",)),
        PlanPart(
            title="Blocks",
            lines=(_counterbalanced(design),),
            names=("block", "session", "trials", "order", "beside them", "asked"),
            rows=tuple(_block_row(plan, block) for block in block_order(design, 1)),
        ),
        PlanPart(
            title="Questions",
            names=("name", "kind", "asked", "answers"),
            rows=tuple((one.name, one.kind, one.text, _answers(one)) for one in design.questions),
        ),
        PlanPart(title="Exclusions", lines=exclusions_in_words(design.exclusions)),
        PlanPart(title="Planned analyses", lines=analysis_in_words(design.analysis)),
        PlanPart(
            title="Power",
            lines=tuple(_power_in_words(one, design, runs) for one in design.power)
            or ("No power analysis is stated.",),
        ),
        PlanPart(
            title="Drives",
            lines=() if plan.drives else ("The plan was drawn without drives.",),
            names=("file", "SHA-256"),
            rows=tuple(plan.drives.items()),
            digests=True,
        ),
    ]


def exclusions_in_words(rules: Exclusions) -> tuple[str, ...]:
    """Exclusion rules, one sentence each."""
    sentences = [
        f"Answers faster than {rules.fastest_s:g} s." if rules.fastest_s else "",
        f"Answers slower than {rules.slowest_s:g} s." if rules.slowest_s else "",
        _participants_below(rules.attention, "attention checks"),
        _participants_below(rules.catch, "catch trials"),
        f"Participants who exceed the time limit in more than {100 * rules.timeouts:g} % of the questions."
        if rules.timeouts < 1
        else "",
        "Participants who did not reach the criterion of a training block." if rules.training else "",
        "Trials whose presentation failed and was repeated." if rules.failed_plays else "",
        "Participants with unfinished sessions." if rules.unfinished else "",
    ]
    return tuple(line for line in sentences if line) or ("No participants; only answers after the time limit.",)


def analysis_in_words(analysis: Analysis) -> tuple[str, ...]:
    """Planned analyses, one sentence each."""
    only = ", ".join(f"{factor} is {level}" for factor, level in analysis.only.items())
    sentences = [
        f"Analysed trials: {only}." if only else "",
        f"Answers to “{analysis.choice}”: confusion matrix, F-measures, permutation test of macro F."
        if analysis.choice
        else "",
        f"Levels of {analysis.condition} compared: macro F over people (paired t-test, sign-flip test), equivalence"
        f" within {analysis.margin:g}, a Bayes factor, and a logistic mixed model of correct answers."
        if analysis.choice and analysis.condition
        else "",
        f"Ratings {', '.join(analysis.rated)}: repeated-measures analysis of variance over "
        f"{', '.join(analysis.within)}, with the corrections of Greenhouse and Geisser and of Holm."
        if analysis.rated
        else "",
        f"Factors between people: {', '.join(analysis.between)}." if analysis.between else "",
        _INCOMPLETE[analysis.incomplete] if analysis.rated else "",
        _FOILS[analysis.foils] if analysis.choice else "",
        f"Psychometric function of correct answers over {analysis.strength}, guess rate {analysis.guess:g}, lapse"
        f" rate up to {analysis.lapse_most:g}."
        if analysis.strength
        else "",
    ]
    return tuple(line for line in sentences if line) or ("No analyses are planned.",)


def _participants_below(share: float, what: str) -> str:
    return f"Participants with correct answers in fewer than {100 * share:g} % of the {what}." if share else ""


def _counterbalanced(design: Design) -> str:
    if not design.counterbalanced:
        return "The order of the blocks is the same for all participants."
    return f"Balanced Latin square over participants: {', '.join(design.counterbalanced)}. Order of participant 1:"


def _block_row(plan: Plan, block: Block) -> tuple[str, ...]:
    trials = [trial for trial in plan.of(1) if trial.block == block.name]
    order = block.adaptive or block.order
    if block.longest_run:
        order += f", at most {block.longest_run} equal in a row"
    beside = [f"{extra.role} {extra.repetitions} x {len(extra.stimuli)}" for extra in block.extras]
    if block.criterion:
        beside.append(f"ends when {100 * block.criterion.right:g} % of the last {block.criterion.last} are correct")
    if not block.scored:
        beside.append("not scored")
    return (block.name, str(block.session), str(len(trials)), order, "; ".join(beside), ", ".join(block.questions))


def _answers(question: Question) -> str:
    return f"{question.low} to {question.high}" if question.kind == "slider" else ", ".join(question.answers)


def _power_in_words(power: PlannedPower, design: Design, runs: int) -> str:
    """Power for the planned number of participants, as a sentence."""
    people, effect = design.participants, power.effect
    if power.test in ("paired", "threshold"):
        what = (
            f"Paired t-test over {people} people at d_z = {effect:g}"
            if power.test == "paired"
            else f"Confidence interval of the mean of {people} thresholds that excludes a bound at {effect:g} times the"
            " standard deviation of their logarithms"
        )
        return f"{what}: power {power_paired_t(people, d_z=effect):.2f}, by formula."
    experiment, what = _experiment(power, design)
    found = simulated_power(experiment, people, rng=np.random.default_rng(design.seed), runs=runs)
    limits = f"{found.low:.2f} to {found.high:.2f}"
    return f"{what}, {people} people: power {found.power:.2f} ({limits}), {runs} simulated studies."


def _experiment(power: PlannedPower, design: Design) -> tuple[Experiment, str]:
    effect = power.effect
    if power.test == "identification":
        what = f"Identification of {power.objects} objects at d' = {effect:g}, {power.trials} trials each"
        return IdentificationExperiment(objects=power.objects, trials=power.trials, d_prime=effect), what
    if power.test == "equivalence":
        what = f"Equivalence within {effect:g} times the standard deviation of the people's differences"
        return EquivalenceExperiment(margin=effect), what
    # Levels of the further factors of the ratings, within and between participants.
    parts = [part.levels for part in (*design.stimuli, *design.blocks, *design.questions)]
    within = [len({levels[name] for levels in parts if name in levels}) for name in design.analysis.within[1:]]
    between = [len(design.question(name).answers) for name in design.analysis.between if name in design.form]
    others, groups = tuple(within), tuple(between)
    effects = 2 ** (1 + len(others)) - 1 if not groups else 2 ** len(groups) * 2 ** (1 + len(others)) - 1
    what = f"Difference of {effect:g} rating steps, with Holm's correction for {effects} effects"
    return RatingExperiment(means=(0.0, effect), others=others, groups=groups), what
