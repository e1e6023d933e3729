"""The plan of a study as an HTML page for preregistration."""

import numpy as np

from midair.figures import render_page
from midair.study.design import (
    Block,
    Design,
    Plan,
    PlannedPower,
    block_order,
)
from midair.study.statistics import (
    EquivalenceExperiment,
    Experiment,
    IdentificationExperiment,
    RatingExperiment,
    power_median,
    power_paired_t,
    simulated_power,
)
from midair.version import __version__


def plan_page(plan: Plan, *, runs: int = 500) -> str:
    """The plan as a self-contained, reproducible HTML page, with `runs` simulated studies per power analysis."""
    design = plan.design
    return render_page(
        "study/registration.html.j2",
        title=design.title or design.name,
        simulated=False,
        plan=plan,
        design=design,
        blocks=[_block_row(plan, block) for block in block_order(design, 1)],
        power=[power_in_words(one, design, runs) for one in design.power],
        notes=f"midair {__version__}",
    )


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


def power_in_words(power: PlannedPower, design: Design, runs: int) -> str:
    """Power for the planned number of participants, as a sentence."""
    people, effect = design.participants, power.effect
    if power.test == "paired":
        what, share = f"Paired t-test over {people} people at d_z = {effect:g}", power_paired_t(people, d_z=effect)
        return f"{what}: power {share:.2f}, by formula."
    if power.test == "threshold":
        return (
            f"Confidence interval of the median of {people} thresholds that excludes a bound at {effect:g} times the"
            f" standard deviation of their logarithms: power {power_median(people, distance=effect):.2f}, by formula."
        )
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
