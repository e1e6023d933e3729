"""The plan of a study as a page to be registered before its first participant, with its digest."""

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
    "leave out": "People who lack a cell of the analysis of variance are left out of it.",
    "refuse": "No analysis of variance is made if somebody lacks a cell.",
}
_FOILS: Mapping[UnpresentedAnswers, str] = {
    "wrong": "Answers that name what was never presented count as wrong.",
    "leave out": "Answers that name what was never presented are left out.",
    "refuse": "No analysis of choices is made if an answer names what was never presented.",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanPart:
    """One part of the page: words, and a table if there is one."""

    title: str
    lines: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    digests: bool = False


def plan_page(plan: Plan, *, runs: int = 500) -> str:
    """The plan as HTML that needs nothing from outside; the same plan gives the same page.

    Parameters
    ----------
    plan : Plan
        As drawn.
    runs : int
        Simulated studies for each statement of power.
    """
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
    """What the page says, part by part."""
    design = plan.design
    return [
        PlanPart(title="Hypotheses", lines=design.hypotheses or ("None were stated.",)),
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
        PlanPart(title="Who and what is left out", lines=exclusions_in_words(design.exclusions)),
        PlanPart(title="What will be tested", lines=analysis_in_words(design.analysis)),
        PlanPart(title="Power", lines=_power(design, runs)),
        PlanPart(
            title="Drives",
            lines=() if plan.drives else ("The plan was drawn without drives.",),
            names=("file", "SHA-256"),
            rows=tuple(plan.drives.items()),
            digests=True,
        ),
    ]


def exclusions_in_words(rules: Exclusions) -> tuple[str, ...]:
    """The rules of exclusion, a sentence each."""
    said = [
        f"Answers given sooner than {rules.fastest_s:g} s after the question." if rules.fastest_s else "",
        f"Answers given later than {rules.slowest_s:g} s after the question." if rules.slowest_s else "",
        _people("answered rightly", rules.attention, "attention checks"),
        _people("answered rightly", rules.catch, "catch trials"),
        f"People who let the time run out in more than {100 * rules.timeouts:g} % of the questions."
        if rules.timeouts < 1
        else "",
        "People who did not reach the criterion of a training." if rules.training else "",
        "Trials whose presentation failed and was made again." if rules.failed_plays else "",
        "People whose sessions are not finished." if rules.unfinished else "",
    ]
    return tuple(line for line in said if line) or ("Nobody and nothing, but answers that were not given in time.",)


def analysis_in_words(analysis: Analysis) -> tuple[str, ...]:
    """The analyses that the report makes, a sentence each."""
    only = ", ".join(f"{factor} is {level}" for factor, level in analysis.only.items())
    said = [
        f"Of the trials, those where {only}." if only else "",
        f"Answers to “{analysis.choice}”: confusion matrix, F-measures, macro F against shuffled answers."
        if analysis.choice
        else "",
        f"Levels of {analysis.condition} compared: macro F over people (paired t, turned signs), equivalence within "
        f"{analysis.margin:g}, a Bayes factor, and a logistic mixed model of right answers."
        if analysis.choice and analysis.condition
        else "",
        f"Ratings {', '.join(analysis.rated)}: repeated-measures analysis of variance over "
        f"{', '.join(analysis.within)}, Greenhouse and Geisser, Holm over its effects."
        if analysis.rated
        else "",
        f"Factors between people: {', '.join(analysis.between)}." if analysis.between else "",
        _INCOMPLETE[analysis.incomplete] if analysis.rated else "",
        _FOILS[analysis.foils] if analysis.choice else "",
        f"A psychometric function of right answers over {analysis.strength}, chance {analysis.guess:g}."
        if analysis.strength
        else "",
    ]
    return tuple(line for line in said if line) or ("Nothing was said.",)


def _people(did: str, share: float, what: str) -> str:
    return f"People who {did} fewer than {100 * share:g} % of the {what}." if share else ""


def _counterbalanced(design: Design) -> str:
    if not design.counterbalanced:
        return "The order of the blocks is the same for everybody."
    return f"In balanced Latin squares over people: {', '.join(design.counterbalanced)}. As participant 1 has them:"


def _block_row(plan: Plan, block: Block) -> tuple[str, ...]:
    trials = [trial for trial in plan.of(1) if trial.block == block.name]
    order = block.adaptive or block.order
    if block.longest_run:
        order += f", at most {block.longest_run} alike in a row"
    beside = [f"{extra.role} {extra.repetitions} x {len(extra.stimuli)}" for extra in block.extras]
    if block.criterion:
        beside.append(f"ends when {100 * block.criterion.right:g} % of the last {block.criterion.last} are right")
    if not block.scored:
        beside.append("not scored")
    return (block.name, str(block.session), str(len(trials)), order, "; ".join(beside), ", ".join(block.questions))


def _answers(question: Question) -> str:
    return f"{question.low} to {question.high}" if question.kind == "slider" else ", ".join(question.answers)


def _power(design: Design, runs: int) -> tuple[str, ...]:
    return tuple(_power_in_words(one, design, runs) for one in design.power) or ("Not stated.",)


def _power_in_words(power: PlannedPower, design: Design, runs: int) -> str:
    """One statement of power, worked out for the number of people planned."""
    people, effect = design.participants, power.effect
    if power.test == "paired":
        found = power_paired_t(people, d_z=effect)
        return f"Paired t over {people} people at d_z = {effect:g}: power {found:.2f}, by formula."
    if power.test == "threshold":
        found = power_paired_t(people, d_z=effect)
        return (
            f"Limits of the mean of {people} thresholds that leave out a bound at {effect:g} times the standard"
            f" deviation of their logarithms: power {found:.2f}, by formula."
        )
    experiment, what = _experiment(power, design)
    found = simulated_power(experiment, people, rng=np.random.default_rng(design.seed), runs=runs)
    limits = f"{found.low:.2f} to {found.high:.2f}"
    return f"{what}, {people} people: power {found.power:.2f} ({limits}), {runs} simulated studies."


def _experiment(power: PlannedPower, design: Design) -> tuple[Experiment, str]:
    """A study to be simulated, and what it is about."""
    effect = power.effect
    if power.test == "identification":
        what = f"{power.objects} objects told apart at d' = {effect:g}, {power.trials} trials each"
        return IdentificationExperiment(objects=power.objects, trials=power.trials, d_prime=effect), what
    if power.test == "equivalence":
        what = f"No difference, shown within {effect:g} times the standard deviation of people's differences"
        return EquivalenceExperiment(margin=effect), what
    others, groups = _other_levels(design)
    effects = 2 ** (1 + len(others)) - 1 if not groups else 2 ** len(groups) * 2 ** (1 + len(others)) - 1
    what = f"A difference of {effect:g} steps of a rating among {effects} effects that Holm's correction is for"
    return RatingExperiment(means=(0.0, effect), others=others, groups=groups), what


def _other_levels(design: Design) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Levels of the factors of the ratings beside the first, within and between people, for Holm's correction."""
    parts = [part.levels for part in (*design.stimuli, *design.blocks, *design.questions)]
    within = [len({levels[name] for levels in parts if name in levels}) for name in design.analysis.within[1:]]
    between = [len(design.question(name).answers) for name in design.analysis.between if name in design.form]
    return tuple(within), tuple(between)
